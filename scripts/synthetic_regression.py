"""The synthetic regression problems of Ting et al. (2006), §IV-A: noisy, redundant and irrelevant inputs.

Needs NumPy only. Ten relevant inputs are drawn from ``N(0, A Aᵀ)`` with ``A`` standard normal and explain the output by
``b = [1, ..., 10]``; redundant inputs are convex combinations of the noisy relevant ones; the rest is noise. The paper
does not say whether its signal-to-noise ratios compare variances or standard deviations; here they compare variances.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sample:
    """Rows of one draw.

    Attributes:
        x: Inputs, shape (N, dimensions): relevant, redundant, irrelevant columns in this order.
        y: Output, shape (N,).
    """

    x: Array
    y: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """One trial: noisy training rows, and the two test sets of the paper from the same source.

    Attributes:
        train: Noisy inputs and output.
        clean_test: Noiseless inputs and output.
        noisy_test: Inputs and output with the noise of the training rows.
        truth: Regression vector of the relevant inputs, zero elsewhere, shape (dimensions,).
        input_noise_std: Noise of each relevant input, shape (relevant,).
        output_noise_std: Noise of the output.
    """

    train: Sample
    clean_test: Sample
    noisy_test: Sample
    truth: Array
    input_noise_std: Array
    output_noise_std: float


@dataclass(frozen=True, eq=False)
class _Source:
    """What the samples of one trial share."""

    mixing: Array  # A, (relevant, relevant)
    redundancy: Array  # convex weights, (relevant, redundant)
    regression: Array  # b, (relevant,)
    irrelevant: int
    input_noise_std: Array  # (relevant,)
    output_noise_std: float

    def sample(self, rng: np.random.Generator, samples: int, *, noisy: bool) -> Sample:
        relevant = len(self.regression)
        t = rng.standard_normal((samples, relevant)) @ self.mixing.T  # (N, relevant)
        y = t @ self.regression
        if noisy:
            y = y + self.output_noise_std * rng.standard_normal(samples)
            t = t + self.input_noise_std * rng.standard_normal((samples, relevant))
        noise = rng.standard_normal((samples, self.irrelevant))
        return Sample(np.hstack([t, t @ self.redundancy, noise]), y)


def draw_problem(
    rng: np.random.Generator,
    samples: int = 1000,
    input_snr: float = 2.0,
    output_snr: float = 5.0,
    redundant: int = 0,
    *,
    relevant: int = 10,
    dimensions: int = 100,
    snr_is_power_ratio: bool = True,
) -> Problem:
    """One trial of §IV-A: training rows and both test sets, ``samples`` rows each.

    Args:
        rng: Source of all randomness.
        samples: Rows of each set.
        input_snr: Signal-to-noise ratio of the relevant inputs, per column.
        output_snr: Signal-to-noise ratio of the output.
        redundant: Number of columns that are convex combinations of the relevant ones.
        relevant: Number of relevant inputs.
        dimensions: Number of inputs in all; what is left over is irrelevant, ``N(0, 1)``.
        snr_is_power_ratio: Ratios compare variances (else standard deviations).
    """
    if not 0 <= redundant <= dimensions - relevant:
        raise ValueError(f"redundant must lie in [0, {dimensions - relevant}]; got {redundant}")
    exponent = 0.5 if snr_is_power_ratio else 1.0
    mixing = rng.standard_normal((relevant, relevant))
    regression = np.arange(1.0, relevant + 1.0)
    source = _Source(
        mixing=mixing,
        redundancy=rng.dirichlet(np.ones(relevant), redundant).T,
        regression=regression,
        irrelevant=dimensions - relevant - redundant,
        input_noise_std=np.linalg.norm(mixing, axis=1) / input_snr**exponent,
        output_noise_std=float(np.linalg.norm(mixing.T @ regression) / output_snr**exponent),
    )
    return Problem(
        train=source.sample(rng, samples, noisy=True),
        clean_test=source.sample(rng, samples, noisy=False),
        noisy_test=source.sample(rng, samples, noisy=True),
        truth=np.concatenate([regression, np.zeros(dimensions - relevant)]),
        input_noise_std=source.input_noise_std,
        output_noise_std=source.output_noise_std,
    )

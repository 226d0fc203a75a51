"""What a de-noising regression has learnt, able to check itself against the moments it came from."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.estimation.base import Status
from casysid.estimation.denoising_em import DenoisingModel, GammaPrior, State
from casysid.moments import NormalEquations


@dataclass(frozen=True, eq=False, kw_only=True)
class DenoisingPosterior:
    """What was learnt of one regression problem; arrays of shape (d,).

    Attributes:
        output_weight: ``⟨wz⟩``.
        input_weight: ``⟨wx⟩``.
        output_weight_variance: ``σ²_wz``, zeros in Joint Factor Analysis.
        input_weight_variance: ``σ²_wx``, zeros in Joint Factor Analysis.
        input_noise: ``ψx``.
        hidden_noise: ``ψz``.
        output_noise: ``ψy``.
        relevance: ``⟨α⟩``, zeros in Joint Factor Analysis.
        prior: Of the precisions; None is Joint Factor Analysis.
        bounds: The bound at the start and after every iteration.
        start_bounds: The last bound of every start, the largest of which was kept.
        evaluations: E-steps of the start that was kept.
        status: Why it stopped.
    """

    output_weight: Array
    input_weight: Array
    output_weight_variance: Array
    input_weight_variance: Array
    input_noise: Array
    hidden_noise: Array
    output_noise: float
    relevance: Array
    prior: GammaPrior | None
    bounds: Array
    start_bounds: Array
    evaluations: int
    status: Status

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                object.__setattr__(self, field.name, frozen(value))

    @property
    def bound(self) -> float:
        """The variational bound (Joint Factor Analysis: the log likelihood)."""
        return float(self.bounds[-1])

    @cached_property
    def noisy_regression(self) -> Array:
        """``b_noise``, for noisy inputs: the paper's Eq. (3), which collapses to ``wz wx / (ψx + wx²)``."""
        return frozen(self.output_weight * self.input_weight / self.mean_square)

    @cached_property
    def noiseless_regression(self) -> Array:
        """``b_true``, for noiseless inputs: the paper's Eq. (4), as ``wz wx / ⟨wx²⟩``.

        That is zero where a column is switched off; as printed, Eq. (4) collapses to ``wz / wx``, which is 0/0 there.
        """
        square = self.input_weight**2 + self.input_weight_variance
        return frozen(self.output_weight * self.input_weight / square)

    @property
    def noise_fraction(self) -> Array:
        """Share of every column that is noise, shape (d,)."""
        return self.input_noise / self.mean_square

    @property
    def is_relevant(self) -> npt.NDArray[np.bool_]:
        """Columns whose weight is larger than its standard deviation; all in Joint Factor Analysis."""
        return self.output_weight**2 > self.output_weight_variance

    def bound_of(self, normal: NormalEquations) -> float:
        """The bound, computed anew from the moments that were fitted."""
        return DenoisingModel(normal, self.prior).expect(self._state).bound

    def gain_of_one_more_iteration(self, normal: NormalEquations) -> float:
        """By how much one more EM iteration raises the bound: zero, but for rounding, at a stationary point."""
        model = DenoisingModel(normal, self.prior)
        expected = model.expect(self._state)
        return model.expect(model.maximise(self._state, expected)).bound - expected.bound

    @property
    def mean_square(self) -> Array:
        """Of every column, as the model has it: ``wx² + ψx``, shape (d,)."""
        return self.input_noise + self.input_weight**2

    @property
    def conditional_variance(self) -> float:
        """Of the output given noisy inputs: the appendix's ``ψy + 1ᵀM1``."""
        kappa = 1.0 + self.input_weight_variance / self.input_noise + self.output_weight_variance / self.hidden_noise
        hidden = self.output_weight**2 / (kappa + self.input_weight**2 / self.input_noise)
        return self.output_noise + float((self.hidden_noise + hidden).sum())

    @property
    def _state(self) -> State:
        return State(
            self.output_weight,
            self.input_weight,
            self.input_noise,
            self.hidden_noise,
            self.output_weight_variance,
            self.input_weight_variance,
            self.output_noise,
        )

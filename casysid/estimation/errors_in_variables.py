"""Structured errors in variables: any estimator, on moments from which the encoders' noise has been taken out.

Noise in the measured motion attenuates least squares, whatever the amount of data. Its share of the moments is known
(:attr:`casysid.moments.Moments.noise`), so it is subtracted. In directions where noise is so heavy that the rest would
hardly be positive, less is subtracted, and only there: Fuller's modification, direction by direction. The energy of
residuals keeps what noise adds to it, because joints are to be weighted by all the noise in their equations.

The blocks of the denoised moments scatter with the noise and with the draws by which its share was found, so standard
errors from blocks hold both. The error of the noise's level, which is the same in all blocks, is added.

Source: Fuller 1987, *Measurement Error Models*, §2.5 (the modification) and §3.1 (noise covariance by observation).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Estimator
from casysid.estimation.ridge import Ridge
from casysid.estimation.standardise import (
    NOISE_FLOOR,
    check_prior,
    estimate_noise_std,
    seen_directions,
    solve_least_squares,
)
from casysid.memory import NUMBER, require_memory
from casysid.moments import Moments

DENSE = 6
"""Sums of all columns by all columns for each block and joint that live at once: two, their products, and copies."""
REWEIGHTINGS = 3
"""Of the joints, before the energy of their residuals is settled."""


@dataclass(frozen=True)
class ErrorsInVariables:
    """An estimator on denoised moments; without knowledge of the noise, the estimator itself.

    Attributes:
        estimator: Takes the denoised moments.
        margin: Fraction of a direction's energy that noise may explain at most.
    """

    estimator: Estimator = field(default_factory=Ridge)
    margin: float = 0.95
    name: ClassVar[str] = "eiv"

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < 1.0:
            raise ParameterError(f"errors in variables: margin must lie between 0 and 1; got {self.margin}")

    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Parameters without the attenuation by input noise; unseen directions stay at the prior."""
        if moments.noise is None:
            return dataclasses.replace(self.estimator.estimate(moments, prior), method=self.name)
        theta0 = check_prior(moments, prior)
        limited = limit_noise(moments.shifted(theta0), self.margin)
        denoised = _with_noisy_residuals(limited.moments)
        estimate = self.estimator.estimate(denoised.shifted(-theta0), prior)
        level = _level_error(limited.moments, estimate, theta0)
        spread = estimate.spread
        if spread is not None:
            spread = dataclasses.replace(spread, covariance=spread.covariance + np.outer(level, level))
        return dataclasses.replace(
            estimate,
            method=self.name,
            covariance=estimate.covariance + np.outer(level, level) if spread is None else spread.marked,
            spread=spread,
            diagnostics={
                **estimate.diagnostics,
                "noise_share_of_weakest_direction": limited.heaviest,
                "directions_too_noisy": float(limited.directions),
            },
        )


@dataclass(frozen=True, eq=False)
class LimitedNoise:
    """Moments whose noise explains no direction to more than a margin.

    Attributes:
        moments: The same sums, with less noise where there was too much.
        heaviest: The largest share of any direction's energy in ``x`` that was noise, a generalised eigenvalue.
        directions: Of how many directions there was too much.
    """

    moments: Moments
    heaviest: float
    directions: int


def limit_noise(moments: Moments, margin: float) -> LimitedNoise:
    """Take ``N - ½ (G M + Mᵀ G)`` for the noise N in ``Σ x xᵀ = G`` of every block and joint.

    ``M = W (Λ - margin)₊ Wᵀ G`` with the pooled sums G and ``Wᵀ G W = 1``, ``Wᵀ N W = Λ``; pooled, the noise is then
    no more than the margin in any direction, and untouched where it was not.

    Raises:
        ParameterError: Noise was too heavy in some direction, and the sums of so many joints, which then hold all
            columns, would not fit into memory.
    """
    assert moments.noise is not None
    weights = estimate_noise_std(moments) ** -2.0
    gram, noise = moments.pooled(weights).xx, moments.pooled_noise(weights)[:-1, :-1]
    whitened = _unit_directions(gram)
    shares, turned = np.linalg.eigh(whitened.T @ noise @ whitened)
    excess = shares > margin
    heaviest = float(shares.max(initial=0.0))
    if not excess.any():
        return LimitedNoise(moments, heaviest, 0)
    joints, p = len(moments.joints), len(moments.columns)
    require_memory(
        DENSE * NUMBER * moments.blocks * joints * (p + 1.0) ** 2,
        f"errors in variables: taking out noise as heavy as this at {joints} joints with {p} columns",
        "Take method ridge, lock joints that do not move, or take fewer blocks",
    )
    W = whitened @ turned[:, excess]
    M = (W * (shares[excess] - margin)) @ W.T @ gram
    sums, limited = moments.gram, np.array(moments.dense_noise)
    product = sums[..., :-1, :-1] @ M
    limited[..., :-1, :-1] -= 0.5 * (product + np.swapaxes(product, 2, 3))
    dense = Moments.from_dense(
        sums, moments.count, moments.columns, moments.joints, noise=limited, noise_error=moments.noise_error
    )
    return LimitedNoise(dense, heaviest, int(excess.sum()))


def _with_noisy_residuals(moments: Moments) -> Moments:
    """Denoised moments, but for the energy of residuals, which keeps what noise adds to it."""
    assert moments.noise is not None
    noise = tuple(sums.copy() for sums in moments.noise)
    weights = estimate_noise_std(moments) ** -2.0
    for _ in range(REWEIGHTINGS):
        normal = dataclasses.replace(moments, noise=noise).denoised().pooled(weights)
        theta, rank = solve_least_squares(normal.xx, normal.xy)
        for own, sums in zip(moments.row_columns, noise, strict=True):
            r = np.append(-theta[own], 1.0)
            sums[:, -1, -1] -= (sums @ r) @ r
        rows = moments.count.sum(axis=0)
        energy = moments.residual_energy(theta).sum(axis=0)
        floor = NOISE_FLOOR**2 * np.maximum(moments.target_energy().sum(axis=0), np.finfo(np.float64).tiny)
        weights = np.maximum(rows - rank * rows / max(rows.sum(), 1.0), 1.0) / np.maximum(energy, floor)
    return dataclasses.replace(moments, noise=noise).denoised()


def _level_error(moments: Moments, estimate: Estimate, theta0: Array) -> Array:
    """Standard error of the parameters that comes of the noise's level, shape (p,): ``H⁺ N_x [-θ, 1] δ``."""
    assert moments.noise is not None
    weights = estimate.noise_std**-2.0
    pushed = moments.pooled_noise(weights)[:-1] @ np.append(theta0 - estimate.parameters, 1.0)
    W = _unit_directions(estimate.metric)
    return np.asarray(moments.noise_error * W @ (W.T @ pushed))


def _unit_directions(gram: Array) -> Array:
    """Directions ``W`` that the sums see, shape (p, r), with ``Wᵀ G W = 1``."""
    energy = np.diag(gram)
    scale = np.where(energy > 0.0, 1.0 / np.sqrt(np.where(energy > 0.0, energy, 1.0)), 0.0)
    values, vectors = seen_directions(gram * np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors / np.sqrt(values))

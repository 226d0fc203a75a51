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
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Estimator, Feasible
from casysid.estimation.empirical_bayes import EmpiricalBayes
from casysid.estimation.standardise import (
    NOISE_FLOOR,
    check_prior,
    estimate_noise_std,
    seen_directions,
    solve_least_squares,
)
from casysid.moments import Moments

REWEIGHTINGS = 3
"""Of the joints, before the energy of their residuals is settled."""


@dataclass(frozen=True)
class ErrorsInVariables(Estimator):
    """An estimator on denoised moments; without knowledge of the noise, the estimator itself.

    Attributes:
        estimator: Takes the denoised moments.
        margin: Fraction of a direction's energy that noise may explain at most.
    """

    estimator: Estimator = field(default_factory=EmpiricalBayes)
    margin: float = 0.95
    name: ClassVar[str] = "eiv"
    needs_input_noise: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < 1.0:
            raise ParameterError(f"errors in variables: margin must lie between 0 and 1; got {self.margin}")

    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Parameters without the attenuation by input noise; unseen directions stay at the prior."""
        return self._estimate(moments, prior, self.estimator.estimate)

    def estimate_among(self, moments: Moments, prior: Array | None, feasible: Feasible) -> Estimate:
        """The same, possible parameters only."""
        return self._estimate(moments, prior, partial(self.estimator.estimate_among, feasible=feasible))

    def _estimate(
        self, moments: Moments, prior: Array | None, estimate_from: Callable[[Moments, Array | None], Estimate]
    ) -> Estimate:
        if moments.noise is None:
            return dataclasses.replace(estimate_from(moments, prior), method=self.name)
        theta0 = check_prior(moments, prior)
        limited = limit_noise(moments.shifted(theta0), self.margin)
        denoised = _with_noisy_residuals(limited.moments)
        estimate = estimate_from(denoised.shifted(-theta0), prior)
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
    """Moments whose noise explains no direction of any joint's rows to more than a margin.

    Attributes:
        moments: The same sums, with less noise where there was too much.
        heaviest: The largest share of any direction's energy in ``x`` that was noise, a generalised eigenvalue.
        directions: Of how many directions there was too much.
    """

    moments: Moments
    heaviest: float
    directions: int


def limit_noise(moments: Moments, margin: float) -> LimitedNoise:
    """Take ``N - ½ (G M + Mᵀ G)`` for the noise N in ``Σ x xᵀ = G`` of every block, joint by joint.

    ``M = W (Λ - margin)₊ Wᵀ G`` with the joint's sums G over all blocks and ``Wᵀ G W = 1``, ``Wᵀ N W = Λ``. What is
    left of each joint's sums is positive, and so is any weighted sum of the joints', by construction.
    """
    assert moments.noise is not None
    noise, heaviest, directions = [], 0.0, 0
    for sums, own in zip(moments.squares, moments.noise, strict=True):
        G, N = sums.sum(axis=0)[:-1, :-1], own.sum(axis=0)[:-1, :-1]
        W = _unit_directions(G)
        shares, turned = np.linalg.eigh(W.T @ N @ W)
        excess = shares > margin
        heaviest, directions = max(heaviest, float(shares.max(initial=0.0))), directions + int(excess.sum())
        limited = own.copy()
        if excess.any():
            V = W @ turned[:, excess]
            M = (V * (shares[excess] - margin)) @ V.T @ G
            product = sums[:, :-1, :-1] @ M
            limited[:, :-1, :-1] -= 0.5 * (product + np.swapaxes(product, 1, 2))
        noise.append(limited)
    return LimitedNoise(dataclasses.replace(moments, noise=tuple(noise)), heaviest, directions)


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

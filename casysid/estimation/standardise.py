"""The common treatment of moments before a fit, and its undoing after.

Rows are taken relative to the prior, each joint's rows are divided by its residual standard deviation, columns and
target are scaled to unit root mean square, and columns without energy are set aside: they stay at the prior. What is
left is a plain regression problem without units, ``β`` explaining a target of mean square one, whatever the robot.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.estimation.base import LEVERAGE_TOLERANCE, Estimate, Status
from casysid.moments import Moments, NormalEquations

SPECTRUM_TOLERANCE = 1e-11
"""Eigenvalues of a Gram matrix below this fraction of the largest are rounding, not data."""
ENERGY_TOLERANCE = 1e-24
"""A column with less than this fraction of the strongest column's energy is zero."""
NOISE_FLOOR = 1e-6
"""Smallest residual standard deviation of a joint, as a fraction of its target's root mean square."""


@dataclass(frozen=True, eq=False)
class StandardisedProblem:
    """A regression problem without units, by block of time.

    Attributes:
        moments: ``Σ r rᵀ / N``, ``r = [x, y]`` weighted and standardised, of d columns; summed over blocks and joints
            its diagonal is one.
        live: Indices of the d columns that have energy, shape (d,).
        scale: ``θ - θ0`` for ``β = 1``, shape (d,).
        prior: ``θ0``, shape (p,).
        noise_std: Residual standard deviation of each joint, by which its rows were divided, shape (joints,).
        metric: Weighted ``S_xx`` of all columns in the regressor's units, shape (p, p).
        target_rms: Root mean square of the weighted target; zero when the prior explains all.
    """

    moments: Moments
    live: npt.NDArray[np.intp]
    scale: Array
    prior: Array
    noise_std: Array
    metric: Array
    target_rms: float

    @cached_property
    def count(self) -> Array:
        """Rows in each block, shape (blocks,)."""
        return frozen(self.moments.count.sum(axis=1))

    @cached_property
    def normal(self) -> NormalEquations:
        """All blocks: ``xx`` with unit diagonal, ``yy`` of one, means over rows."""
        return self.moments.pooled()

    @property
    def is_degenerate(self) -> bool:
        """Nothing to estimate: no column has energy, or the prior leaves nothing to explain."""
        return len(self.live) == 0 or self.target_rms == 0.0

    def restricted_to(self, columns: npt.NDArray[np.intp]) -> StandardisedProblem:
        """The same with some of the d columns only; the others stay at the prior."""
        moments = self.moments.select_columns(columns)
        return dataclasses.replace(self, moments=moments, live=self.live[columns], scale=frozen(self.scale[columns]))

    def normal_of(self, blocks: npt.ArrayLike) -> NormalEquations:
        """The given blocks only, still divided by the number of all rows."""
        return self.moments.select_blocks(blocks).pooled()

    def restore(self, coefficients: Array) -> Array:
        """``θ`` of shape (p,) from standardised ``β`` of shape (d,)."""
        theta = self.prior.copy()
        theta[self.live] += self.scale * coefficients
        return theta

    def restore_covariance(self, covariance: Array) -> Array:
        """Covariance of ``θ``, (p, p), from that of ``β``, (d, d); infinite variance where the data see nothing."""
        full = np.zeros((len(self.prior), len(self.prior)))
        full[np.ix_(self.live, self.live)] = covariance * np.outer(self.scale, self.scale)
        unseen = np.ones(len(self.prior), dtype=bool)
        unseen[self.live] = unseen_coordinates(self.normal.xx)
        full[unseen, :] = full[:, unseen] = 0.0
        full[unseen, unseen] = np.inf
        return full

    def to_estimate(
        self,
        method: str,
        coefficients: Array,
        covariance: Array,
        *,
        status: Status = Status.CONVERGED,
        diagnostics: Mapping[str, float] | None = None,
    ) -> Estimate:
        """The estimate in the regressor's units, from standardised ``β`` (d,) and its covariance (d, d)."""
        return Estimate(
            method=method,
            parameters=self.restore(coefficients),
            covariance=self.restore_covariance(covariance),
            metric=self.metric,
            noise_std=self.noise_std,
            rank=len(seen_directions(self.normal.xx)[0]),
            status=status,
            diagnostics=diagnostics or {},
        )

    def degenerate_estimate(self, method: str) -> Estimate:
        """The prior, for want of anything to estimate."""
        d = len(self.live)
        return self.to_estimate(method, np.zeros(d), np.zeros((d, d)), status=Status.DEGENERATE)


def standardise(moments: Moments, prior: Array | None = None) -> StandardisedProblem:
    """The moments as a problem without units, relative to ``prior`` of shape (p,) (zeros when None)."""
    theta0 = check_prior(moments, prior)
    shifted = moments.shifted(theta0)
    noise_std = estimate_noise_std(shifted)
    total, rows = shifted.pooled(noise_std**-2.0), max(float(moments.count.sum()), 1.0)
    energy = np.diag(total.xx) / rows
    live = np.flatnonzero(energy > ENERGY_TOLERANCE * max(energy.max(initial=0.0), np.finfo(np.float64).tiny))
    target_rms = float(np.sqrt(max(total.yy, 0.0) / rows))
    divisor = np.append(np.sqrt(energy[live]), target_rms or 1.0)
    return StandardisedProblem(
        moments=_scaled(shifted.select_columns(live), noise_std**-2.0 / rows, 1.0 / divisor),
        live=live,
        scale=frozen(divisor[-1] / divisor[:-1]),
        prior=frozen(theta0),
        noise_std=frozen(noise_std),
        metric=total.xx,
        target_rms=target_rms,
    )


def _scaled(moments: Moments, weights: Array, units: Array) -> Moments:
    """Moments of rows multiplied by roots of ``weights``, (joints,), in columns multiplied by ``units``, (p + 1,)."""
    own = [np.append(units[columns], units[-1]) for columns in moments.row_columns]
    squares = zip(moments.squares, weights, own, strict=True)
    scaled = tuple(sums * (weight * np.outer(unit, unit)) for sums, weight, unit in squares)
    return dataclasses.replace(moments, squares=scaled, noise=None, noise_error=0.0)


def check_prior(moments: Moments, prior: Array | None) -> Array:
    """The prior as an array of shape (p,), zeros when None; raises :class:`ParameterError` when it does not fit."""
    p = len(moments.columns)
    theta0 = np.zeros(p) if prior is None else np.asarray(prior, dtype=np.float64)
    if theta0.shape != (p,) or not np.isfinite(theta0).all():
        raise ParameterError(f"prior: wanted {p} finite numbers, one for each column; got shape {theta0.shape}")
    return theta0


def estimate_noise_std(moments: Moments, *, iterations: int = 3) -> Array:
    """Residual standard deviation of each joint under least squares re-weighted by them, shape (joints,), [N m]."""
    count = moments.count.sum(axis=0)
    target_std = np.sqrt(np.maximum(moments.target_energy().sum(axis=0), 0.0) / np.maximum(count, 1.0))
    floor = NOISE_FLOOR * np.where(target_std > 0.0, target_std, target_std.max(initial=0.0))
    floor = np.where(floor > 0.0, floor, 1.0)
    std: Array = np.maximum(target_std, floor)
    for _ in range(iterations):
        normal = moments.pooled(std**-2.0)
        theta, rank = solve_least_squares(normal.xx, normal.xy)
        freedom = np.maximum(count - rank * count / max(count.sum(), 1.0), 1.0)
        std = np.maximum(np.sqrt(moments.residual_energy(theta).sum(axis=0) / freedom), floor)
    return std


def solve_least_squares(xx: Array, xy: Array) -> tuple[Array, int]:
    """Least squares of smallest norm in columns scaled to unit energy: ``θ`` of shape (p,), and the rank."""
    energy = np.diag(xx)
    live = energy > ENERGY_TOLERANCE * energy.max(initial=0.0)
    scale = np.where(live, 1.0 / np.sqrt(np.where(live, energy, 1.0)), 0.0)
    values, vectors = seen_directions(xx * np.outer(scale, scale))
    return scale * (vectors @ ((vectors.T @ (scale * xy)) / values)), len(values)


def seen_directions(xx: Array) -> tuple[Array, Array]:
    """Eigenvalues (r,) and eigenvectors (d, r) of a Gram matrix, without those that are rounding."""
    values, vectors = np.linalg.eigh(xx)
    seen = values > SPECTRUM_TOLERANCE * values.max(initial=0.0)
    return values[seen], vectors[:, seen]


def unseen_coordinates(xx: Array) -> npt.NDArray[np.bool_]:
    """Which coordinates a Gram matrix of shape (d, d) leaves open, because a direction in its null space moves them."""
    _, vectors = seen_directions(xx)
    return np.asarray(1.0 - np.einsum("mk,mk->m", vectors, vectors) > LEVERAGE_TOLERANCE)

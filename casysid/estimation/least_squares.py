"""Least squares on moments: ordinary, and with every joint's rows weighted by its own noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.estimation.base import Estimate, Estimator, Status
from casysid.estimation.covariance import covariance_from_blocks
from casysid.estimation.standardise import check_prior, solve_least_squares, standardise
from casysid.moments import Moments
from casysid.threads import single_threaded


@dataclass(frozen=True)
class OrdinaryLeastSquares(Estimator):
    """All torque rows alike, rank-revealing; directions that the data do not see stay at the prior.

    Joints of large torque dominate: it is the field's plain baseline.
    """

    name: ClassVar[str] = "ols"

    @single_threaded()
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Parameters of least ``Σ (y - xᵀθ)²``, closest to the prior in columns scaled to unit energy."""
        theta0 = check_prior(moments, prior)
        shifted = moments.shifted(theta0)
        normal = shifted.pooled()
        step, rank = solve_least_squares(normal.xx, normal.xy)
        rows = moments.count.sum(axis=0)
        residual = shifted.residual_energy(step).sum(axis=0)
        noise_std = np.sqrt(residual / np.maximum(rows * (1.0 - rank / max(rows.sum(), rank + 1.0)), 1.0))
        spread = covariance_from_blocks(shifted, step, np.ones(len(rows)))
        return Estimate(
            method=self.name,
            parameters=theta0 + step,
            covariance=spread.marked,
            spread=spread,
            metric=normal.xx,
            noise_std=noise_std,
            rank=rank,
            status=Status.CONVERGED if rank else Status.DEGENERATE,
        )


@dataclass(frozen=True)
class WeightedLeastSquares(Estimator):
    """Every joint's rows divided by its residual standard deviation, which is re-estimated until it settles.

    Source: the field's iteratively re-weighted IDIM-WLS (Gautier 1997), with the weights by joint.
    """

    name: ClassVar[str] = "wls"

    @single_threaded()
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Parameters of least ``Σ_j Σ (y - xᵀθ)² / σ_j²``, closest to the prior in columns scaled to unit energy."""
        problem = standardise(moments, prior)
        if problem.is_degenerate:
            return problem.degenerate_estimate(self.name)
        normal = problem.normal
        coefficients, rank = solve_least_squares(normal.xx, normal.xy)
        theta = problem.restore(coefficients)
        shifted = moments.shifted(problem.prior)
        spread = covariance_from_blocks(shifted, theta - problem.prior, problem.noise_std**-2.0)
        return Estimate(
            method=self.name,
            parameters=theta,
            covariance=spread.marked,
            spread=spread,
            metric=problem.metric,
            noise_std=problem.noise_std,
            rank=rank,
            status=Status.CONVERGED,
        )

"""Empirical Bayes: each group of parameters is as far from the model file as the evidence asks.

All links follow the file as bodies do, each kind of friction is measured from zero, and how far a group may go is
decided together with the joints' noise (:mod:`casysid.estimation.evidence`). So friction that is not there costs next
to nothing, and what the data hardly see stays near the file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Estimator, Feasible, Status
from casysid.estimation.covariance import covariance_from_blocks
from casysid.estimation.evidence import Start, build_evidence_problem, centre_of, seen_columns
from casysid.estimation.standardise import check_prior
from casysid.moments import Moments

SIZE, INFLATION = "size_", "score_inflation"
"""Names among the diagnostics."""


@dataclass(frozen=True)
class EmpiricalBayes(Estimator):
    """Weighted least squares with Gaussian priors by group, whose sizes maximise the evidence.

    Attributes:
        iterations: At most.
        tolerance: Of the change of the parameters in units of their noise.
        standard_errors: Whether the covariance is taken from blocks; it is the posterior's without, which is faster.
        like: The estimate of a similar model from the same rows, from whose sizes and variances the search goes on.
    """

    iterations: int = 100
    tolerance: float = 3e-3
    standard_errors: bool = True
    like: Estimate | None = None
    name: ClassVar[str] = "empirical-bayes"

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise ParameterError(f"empirical Bayes: iterations must be at least 1; got {self.iterations}")
        if not self.tolerance > 0.0:
            raise ParameterError(f"empirical Bayes: tolerance must be positive; got {self.tolerance}")

    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """The posterior's mean at the sizes and variances of most evidence, its precision as the metric.

        Columns without data have no part in the metric.

        Raises:
            ParameterError: The prior does not fit the columns.
        """
        return self._estimate(moments, prior, None)

    def estimate_among(self, moments: Moments, prior: Array | None, feasible: Feasible) -> Estimate:
        """The same, sizes and variances being those of the most probable among the possible parameters."""
        return self._estimate(moments, prior, feasible)

    def _start(self) -> Start | None:
        if self.like is None:
            return None
        said = self.like.diagnostics
        sizes = {name.removeprefix(SIZE): size for name, size in said.items() if name.startswith(SIZE)}
        return Start(self.like.noise_std**2, said[INFLATION], sizes)

    def _estimate(self, moments: Moments, prior: Array | None, feasible: Feasible | None) -> Estimate:
        centre = centre_of(moments, check_prior(moments, prior))
        problem = build_evidence_problem(moments, centre)
        fit = problem.maximise(
            self.iterations,
            self.tolerance,
            None if feasible is None else lambda mean, P, energy: feasible(centre + mean, P, energy) - centre,
            self._start(),
        )
        weights = 1.0 / fit.variance
        size, seen = np.sqrt(fit.kappa / fit.size_by_column), seen_columns(moments)
        own = np.where(seen, size, 0.0)
        spread = None
        if self.standard_errors:
            K = problem.covariance / np.outer(size, size)
            spread = covariance_from_blocks(problem.moments, fit.mean, weights, K)
        return Estimate(
            method=self.name,
            parameters=centre + fit.mean,
            covariance=fit.covariance if spread is None else spread.marked,
            spread=spread,
            metric=moments.pooled(weights).xx + problem.precision * np.outer(own, own),
            noise_std=np.sqrt(fit.variance),
            rank=round(sum(fit.decided.values())),
            status=fit.status if seen.any() else Status.DEGENERATE,
            diagnostics={
                INFLATION: fit.kappa,
                "iterations": float(fit.iterations),
                **{f"{SIZE}{name}": found for name, found in fit.sizes.items()},
                **{f"decided_{name}": number for name, number in fit.decided.items()},
            },
        )

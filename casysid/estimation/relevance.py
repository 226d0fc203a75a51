"""Automatic relevance determination: every column has a prior precision of its own, which the data decide.

MacKay's fixed point on the evidence (MacKay 1992, *Neural Computation* 4; Tipping 2001, *JMLR* 1, Eqs. 12, 13, 16-18).
Its noise precision depends on the number of rows, so scikit-learn's ``ARDRegression`` on rows that merely have the same
Gram matrix would be wrong; on moments the iteration is as short.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Estimator, Status
from casysid.estimation.selection import conditional_covariance
from casysid.estimation.standardise import standardise
from casysid.moments import Moments, NormalEquations
from casysid.threads import single_threaded


@dataclass(frozen=True, kw_only=True)
class RelevanceRegression(Estimator):
    """ARD regression in standardised columns, relative to the prior.

    Attributes:
        largest_precision: A column whose prior precision exceeds this, in standardised units, is irrelevant for good.
        tolerance: The iteration stops when no coefficient moves by more than this fraction of the largest.
        max_iterations: Iterations at most.
    """

    name: ClassVar[str] = "ard"

    largest_precision: float = 1e6
    tolerance: float = 1e-5
    max_iterations: int = 5000

    def __post_init__(self) -> None:
        if min(self.largest_precision, self.tolerance) <= 0.0 or self.max_iterations < 1:
            raise ParameterError(
                "ard: wanted largest_precision > 0, tolerance > 0 and max_iterations >= 1; "
                f"got {self.largest_precision}, {self.tolerance} and {self.max_iterations}"
            )

    @single_threaded()
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Posterior mean and covariance at the most likely precisions; irrelevant columns stay at the prior."""
        problem = standardise(moments, prior)
        if problem.is_degenerate:
            return problem.degenerate_estimate(self.name)
        normal = problem.normal
        fit = maximise_evidence(normal, self.largest_precision, self.tolerance, self.max_iterations)
        return problem.to_estimate(
            self.name,
            fit.coefficients,
            conditional_covariance(problem, fit.coefficients, fit.active, penalty=fit.penalty),
            status=Status.CONVERGED if fit.converged else Status.MAX_ITERATIONS,
            diagnostics={"selected": float(fit.active.sum()), "iterations": float(fit.iterations)},
        )


@dataclass(frozen=True, eq=False)
class EvidenceFit:
    """Where the fixed point stopped.

    Attributes:
        coefficients: Posterior mean, shape (d,).
        active: Columns still relevant, shape (d,).
        penalty: Prior precision over the noise's precision and the number of rows, shape (d,), zero where not active.
        iterations: Iterations done.
        converged: Whether the coefficients had come to rest.
    """

    coefficients: Array
    active: npt.NDArray[np.bool_]
    penalty: Array
    iterations: int
    converged: bool


def maximise_evidence(
    normal: NormalEquations, largest_precision: float, tolerance: float, max_iterations: int
) -> EvidenceFit:
    """MacKay's fixed point for the precisions ``α`` of the columns and the noise variance, from means over rows."""
    d, n = len(normal.xy), normal.count
    alpha, noise, active, old = np.ones(d), normal.yy, np.ones(d, dtype=bool), np.zeros(d)
    for iteration in range(1, max_iterations + 1):
        beta = np.zeros(d)
        penalty = np.where(active, alpha, 0.0) * noise / n
        inverse = np.linalg.inv(normal.xx[np.ix_(active, active)] + np.diag(penalty[active]))
        beta[active] = inverse @ normal.xy[active]
        gamma = np.clip(1.0 - penalty[active] * np.diag(inverse), 0.0, 1.0)  # well-determinedness, Eq. 17
        converged = bool(np.abs(beta - old).max() <= tolerance * np.abs(beta).max())
        if converged or iteration == max_iterations:
            break
        alpha[active] = gamma / np.maximum(beta[active] ** 2, _TINY)  # Eq. 16
        noise = max(n * normal.residual_energy(beta), _TINY) / max(n - gamma.sum(), 1.0)  # Eq. 18
        active = active & (alpha < largest_precision)
        old = beta
    return EvidenceFit(beta, active, penalty, iteration, converged)


_TINY = 1e-14  # smallest variance, as a fraction of the target's

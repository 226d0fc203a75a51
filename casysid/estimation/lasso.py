"""LASSO regression: least squares with an L1 penalty, which sets weak columns to the prior.

Tibshirani (1996), *J. Royal Statistical Society B* 58(1). Coordinate descent is scikit-learn's; it is given d + 1 rows
whose Gram matrix is that of the data.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Estimator, Status
from casysid.estimation.cross_validation import cross_validate
from casysid.estimation.selection import conditional_covariance
from casysid.estimation.standardise import standardise
from casysid.moments import Moments, NormalEquations
from casysid.threads import single_threaded


@dataclass(frozen=True, kw_only=True)
class LassoRegression(Estimator):
    r"""Minimises :math:`\tfrac12 β^T S β - s^T β + λ \|β\|_1` in standardised columns, relative to the prior.

    Attributes:
        strength: ``λ`` as a fraction of the smallest value that leaves every column at the prior, in [0, 1]. None:
            chosen by cross-validation over blocks of time.
        strengths: Number of candidates for the cross-validation, logarithmically spaced.
        smallest_strength: The smallest candidate.
        folds: Number of folds, contiguous in time.
        tolerance: Coordinate descent stops when the duality gap is below this fraction of the target's energy.
        max_iterations: Sweeps of coordinate descent at most.
    """

    name: ClassVar[str] = "lasso"

    strength: float | None = None
    strengths: int = 50
    smallest_strength: float = 1e-4
    folds: int = 5
    tolerance: float = 1e-5
    max_iterations: int = 20_000

    def __post_init__(self) -> None:
        if self.strength is not None and not 0.0 <= self.strength <= 1.0:
            raise ParameterError(f"lasso: strength must lie in [0, 1], or be None to be chosen; got {self.strength}")
        if not 0.0 < self.smallest_strength < 1.0 or self.strengths < 2 or self.folds < 2:
            raise ParameterError(
                "lasso: wanted smallest_strength in (0, 1), at least 2 strengths and 2 folds; "
                f"got {self.smallest_strength}, {self.strengths} and {self.folds}"
            )

    @single_threaded()
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Shrunk coefficients; columns that do not survive stay at the prior.

        Raises:
            ParameterError: The strength is to be chosen and there is a single block.
        """
        problem = standardise(moments, prior)
        normal = problem.normal
        strongest = float(np.abs(normal.xy).max(initial=0.0))
        if problem.is_degenerate or strongest == 0.0:
            return problem.degenerate_estimate(self.name)
        candidates = strongest * self._fractions()
        best = 0
        if self.strength is None:
            errors = cross_validate(problem, self.folds, lambda part: self._path(part, candidates)[0], choice="lasso")
            best = int(errors.argmin())
        path, gaps = self._path(normal, candidates[: best + 1])
        active = path[best] != 0.0
        return problem.to_estimate(
            self.name,
            path[best],
            conditional_covariance(problem, path[best], active),
            status=Status.CONVERGED if gaps[best] <= 2.0 * self.tolerance else Status.MAX_ITERATIONS,
            diagnostics={"selected": float(active.sum()), "strength": float(candidates[best] / strongest)},
        )

    def _fractions(self) -> Array:
        """Candidate strengths, strongest first: each solution is the start of the next."""
        if self.strength is not None:
            return np.array([self.strength])
        return np.geomspace(1.0, self.smallest_strength, self.strengths)

    def _path(self, normal: NormalEquations, penalties: Array) -> tuple[Array, Array]:
        """Coefficients (penalties, d) and duality gaps (penalties,) as fractions of the target's energy."""
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.linear_model import lasso_path

        rows = pseudo_sample(normal)
        n = len(rows)
        x, y = np.asfortranarray(rows[:, :-1]), rows[:, -1]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # told by the duality gap
            _, coefficients, gaps = lasso_path(
                x,
                y,
                alphas=penalties / n,
                precompute=x.T @ x,
                Xy=x.T @ y,
                tol=self.tolerance,
                max_iter=self.max_iterations,
            )
        return np.asarray(coefficients.T), np.asarray(gaps) * n / max(normal.yy, np.finfo(np.float64).tiny)


def pseudo_sample(normal: NormalEquations) -> Array:
    """As few rows ``[x, y]`` as have the Gram matrix of the data, shape (d + 1, d + 1); it may be singular."""
    gram = np.block([[normal.xx, normal.xy[:, None]], [normal.xy, normal.yy]])
    values, vectors = np.linalg.eigh(gram)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)

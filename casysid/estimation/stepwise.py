"""Stepwise regression: columns enter and leave one at a time by their F statistics.

After each entry every column in the model is tested again. The sweep operator turns the Gram matrix into that of the
residuals beside the chosen columns, so a step costs O(d²). Draper and Smith, *Applied Regression Analysis*, "stepwise
regression procedure"; sweep: Goodnight (1979), *The American Statistician* 33(3).
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
from casysid.estimation.standardise import solve_least_squares, standardise
from casysid.moments import Moments, NormalEquations
from casysid.threads import single_threaded


@dataclass(frozen=True, kw_only=True)
class StepwiseRegression(Estimator):
    """Forward selection with backward elimination on partial F tests.

    Attributes:
        f_to_enter: A column enters when its F statistic is the largest and above this (4: about 5 % significance).
        f_to_remove: A column leaves when its F statistic is the smallest and below this; at most ``f_to_enter``.
        tolerance: A column enters only if at least this fraction of its energy is not explained by those already in.
        max_steps: Entries and removals at most.
    """

    name: ClassVar[str] = "stepwise"

    f_to_enter: float = 4.0
    f_to_remove: float = 3.9
    tolerance: float = 1e-8
    max_steps: int = 10_000

    def __post_init__(self) -> None:
        if not 0.0 < self.f_to_remove <= self.f_to_enter:
            raise ParameterError(
                f"stepwise: wanted 0 < f_to_remove <= f_to_enter, or columns would enter and leave for ever; "
                f"got {self.f_to_remove} and {self.f_to_enter}"
            )
        if not 0.0 < self.tolerance < 1.0 or self.max_steps < 1:
            raise ParameterError(
                f"stepwise: wanted tolerance in (0, 1) and max_steps >= 1; got {self.tolerance} and {self.max_steps}"
            )

    @single_threaded()
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Least squares on the columns that pass; the others stay at the prior."""
        problem = standardise(moments, prior)
        if problem.is_degenerate:
            return problem.degenerate_estimate(self.name)
        normal = problem.normal
        active, steps, finished = self._select(normal)
        coefficients = np.zeros(len(active))
        coefficients[active], _ = solve_least_squares(normal.xx[np.ix_(active, active)], normal.xy[active])
        return problem.to_estimate(
            self.name,
            coefficients,
            conditional_covariance(problem, coefficients, active),
            status=Status.CONVERGED if finished else Status.MAX_ITERATIONS,
            diagnostics={"selected": float(active.sum()), "steps": float(steps)},
        )

    def _select(self, normal: NormalEquations) -> tuple[npt.NDArray[np.bool_], int, bool]:
        """The chosen columns, the number of steps, and whether no further step was due."""
        tableau = np.block([[normal.xx, normal.xy[:, None]], [normal.xy, normal.yy]])
        active = np.zeros(len(normal.xy), dtype=bool)
        for step in range(self.max_steps):
            k = self._due(tableau, active, normal.count)
            if k is None:
                return active, step, True
            _sweep(tableau, k, -1.0 if active[k] else 1.0)
            active[k] = not active[k]
        return active, self.max_steps, False

    def _due(self, tableau: Array, active: npt.NDArray[np.bool_], count: float) -> int | None:
        """The column that has to leave, else the one that may enter, else None."""
        pivot, share, rest = np.diag(tableau)[:-1], tableau[:-1, -1] ** 2, max(tableau[-1, -1], 0.0)
        freedom = count - active.sum()
        if active.any() and freedom > 0:
            f = np.where(active, -share / np.where(active, pivot, -1.0), np.inf) * freedom / max(rest, _TINY)
            if f.min() < self.f_to_remove:
                return int(f.argmin())
        eligible = ~active & (pivot > self.tolerance)
        if eligible.any() and freedom > 1 and rest > _TINY:
            gain = np.where(eligible, share / np.where(eligible, pivot, 1.0), 0.0)
            f = gain * (freedom - 1.0) / np.maximum(rest - gain, _TINY)
            if f.max() > self.f_to_enter:
                return int(f.argmax())
        return None


_TINY = 1e-14  # residual energy below this fraction of the target's is rounding


def _sweep(tableau: Array, k: int, sign: float) -> None:
    """Sweep column k into (+1) or out of (-1) a symmetric tableau, in place; swept diagonals are ``-(S_AA)⁻¹``."""
    pivot = tableau[k, k]
    column = tableau[:, k].copy()
    tableau -= np.outer(column, column) / pivot
    tableau[:, k] = tableau[k, :] = sign * column / pivot
    tableau[k, k] = -1.0 / pivot

"""The consistent parameters nearest to an estimate, for searches that ask again and again with another metric."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cholesky

from casysid.arrays import Array
from casysid.errors import SolverError
from casysid.projection.certificate import USUAL_WEIGHT, certify, rough_answer
from casysid.projection.cuts import HalfSpaces, cuts_at, half_spaces_at
from casysid.projection.misfit import misfit_of_estimate
from casysid.projection.problem import ProjectionProblem
from casysid.projection.task import Task, task_of
from casysid.threads import single_threaded


class PossibleParameters:
    """The function ``(θ, G, residual energy) -> θ``, which remembers its last answer.

    The first answer is the convex solver's. Each further one is looked for by cutting planes from the one before,
    where the metric is regular; what they do not settle goes to the convex solver. Where that has no answer either,
    parameters stay as they are.
    """

    def __init__(self, problem: ProjectionProblem, prior: npt.ArrayLike | None = None) -> None:
        """For one problem.

        Args:
            problem: From :func:`build_projection`.
            prior: As for :func:`project`.
        """
        self._problem, self._prior = problem, prior
        self._task: Task | None = None
        self._scaled: Array | None = None

    @single_threaded()
    def __call__(self, estimate: Array, metric: Array, residual_energy: float) -> Array:
        """The nearest consistent parameters, shape (p,).

        Args:
            estimate: ``θ``, shape (p,).
            metric: ``G``, shape (p, p).
            residual_energy: As for :func:`project`.
        """
        near = self._by_cuts(estimate, metric)
        return self._by_convex_solver(estimate, metric, residual_energy) if near is None else near

    def half_spaces(self) -> HalfSpaces:
        """Half-spaces that hold the consistent parameters, and bound them near the last answer; none before it."""
        if self._task is None or self._scaled is None:
            size = len(self._problem.layout)
            return HalfSpaces(np.zeros((0, size)), np.zeros(0))
        rows, lower = half_spaces_at(self._task.cone, self._scaled)
        return HalfSpaces(np.asarray(np.linalg.solve(self._task.frame.transform.T, rows.T).T), lower)

    def _by_cuts(self, estimate: Array, metric: Array) -> Array | None:
        if self._task is None or self._scaled is None:
            return None
        transform = self._task.frame.transform
        try:
            factor = cholesky(transform.T @ metric @ transform)
        except LinAlgError:
            return None
        target = factor @ np.linalg.solve(transform, estimate)
        scaled = cuts_at(self._task.cone, factor, self._scaled).nearest(target)
        if scaled is None:
            return None
        self._scaled = self._task.polished(scaled)
        return np.asarray(transform @ self._scaled)

    def _by_convex_solver(self, estimate: Array, metric: Array, residual_energy: float) -> Array:
        task = task_of(self._problem, misfit_of_estimate(metric, estimate, residual_energy), self._prior)
        try:
            certificate = certify(task, USUAL_WEIGHT)
        except SolverError:
            certificate = None
        scaled = rough_answer(task) if certificate is None else certificate.scaled
        self._task, self._scaled = task, scaled
        return estimate if scaled is None else np.asarray(task.frame.transform @ scaled)

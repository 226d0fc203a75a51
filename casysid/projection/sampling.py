"""Many projections of similar estimates, for uncertainty, by cutting planes from where the estimate itself came to lie.

All samples share the metric and the laws. Those that need too many cuts go to the convex solver.
"""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import CasysidWarning, ParameterError, SolverError
from casysid.projection.certificate import USUAL_WEIGHT, certify
from casysid.projection.cuts import cuts_at
from casysid.projection.misfit import DataMisfit, misfit_of_estimate
from casysid.projection.objective import objective_of
from casysid.projection.problem import ProjectionProblem
from casysid.projection.results import ProjectionResult
from casysid.projection.task import Task, task_of
from casysid.threads import single_threaded

PATIENCE = 2
"""After so many samples in a row that cuts did not settle, the convex solver takes them all."""


@single_threaded()
def project_samples(
    problem: ProjectionProblem,
    estimates: npt.ArrayLike,
    metric: npt.ArrayLike,
    prior: npt.ArrayLike | None,
    like: ProjectionResult,
    *,
    residual_energy: float | None = None,
) -> Array:
    """Consistent parameters of many estimates, shape (n, p), such as samples of the estimate's distribution.

    Args:
        problem: As for the projection of the estimate itself.
        estimates: Shape (n, p).
        metric: As for the estimate itself.
        prior: As for the estimate itself.
        like: The projection of the estimate itself, whose prior weight all samples take.
        residual_energy: As for the estimate itself.

    Returns:
        Shape (n, p). A row is nan where no solver found an answer, and a warning says how many are.

    Raises:
        ParameterError: Estimates have another shape.
    """
    points, G = np.asarray(estimates, dtype=np.float64), np.asarray(metric, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != len(problem.layout):
        raise ParameterError(f"projection: samples must have shape (n, {len(problem.layout)}); got {points.shape}")
    weight = like.prior_weight if np.isfinite(like.prior_weight) else USUAL_WEIGHT
    misfit = misfit_of_estimate(G, points.mean(axis=0), residual_energy)
    task = task_of(problem, misfit, prior)
    cuts = cuts_at(
        task.cone,
        objective_of(misfit, task.frame, weight).factor,
        np.asarray(np.linalg.solve(task.frame.transform, like.parameters)),
    )
    result, unsettled = np.full(points.shape, np.nan), 0
    for row, point in enumerate(points):
        sample = dataclasses.replace(misfit, target=misfit.seen @ point)
        scaled = cuts.nearest(objective_of(sample, task.frame, weight).target) if unsettled < PATIENCE else None
        unsettled = unsettled + 1 if scaled is None else 0
        scaled = _by_convex_solver(task, sample, weight) if scaled is None else task.polished(scaled)
        if scaled is not None:
            result[row] = task.frame.transform @ scaled
    missing = int(np.isnan(result[:, 0]).sum())
    if missing:
        message = f"projection: {missing} of {len(points)} samples have no answer and are nan"
        warnings.warn(message, CasysidWarning, stacklevel=3)
    return result


def _by_convex_solver(task: Task, sample: DataMisfit, weight: float) -> Array | None:
    try:
        certificate = certify(dataclasses.replace(task, misfit=sample), weight)
    except SolverError:  # the answer itself is feasible: the solver is mistaken
        return None
    return None if certificate is None else certificate.scaled

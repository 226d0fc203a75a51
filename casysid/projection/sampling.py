"""Many projections of similar estimates, for uncertainty: the convex solver alone, everything else prepared once."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import CasysidWarning, ParameterError
from casysid.projection.certificate import USUAL_WEIGHT, certify
from casysid.projection.misfit import misfit_of_estimate
from casysid.projection.problem import ProjectionProblem
from casysid.projection.results import ProjectionResult
from casysid.projection.task import task_of


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
        Shape (n, p). A row is nan where the convex solver did not find an answer, and a warning says how many are.

    Raises:
        ParameterError: Estimates have another shape.
    """
    points, G = np.asarray(estimates, dtype=np.float64), np.asarray(metric, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != len(problem.layout):
        raise ParameterError(f"projection: samples must have shape (n, {len(problem.layout)}); got {points.shape}")
    weight = like.prior_weight if np.isfinite(like.prior_weight) else USUAL_WEIGHT
    misfit = misfit_of_estimate(G, points.mean(axis=0), residual_energy)
    task = task_of(problem, misfit, prior)
    result = np.full(points.shape, np.nan)
    for row, point in enumerate(points):
        sample = dataclasses.replace(misfit, target=misfit.seen @ point)
        certificate = certify(dataclasses.replace(task, misfit=sample), weight)
        if certificate is not None:
            result[row] = task.frame.transform @ certificate.scaled
    missing = int(np.isnan(result[:, 0]).sum())
    if missing:
        message = f"projection: {missing} of {len(points)} samples have no answer and are nan"
        warnings.warn(message, CasysidWarning, stacklevel=2)
    return result

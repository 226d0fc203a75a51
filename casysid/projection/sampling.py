"""Many projections of similar estimates, for uncertainty, by cutting planes from where the estimate itself came to lie.

All samples share the metric and the laws. In coordinates in which the metric is the unit matrix, each asks for the
nearest point of a convex set. The laws are half-spaces there: those that touch the set at the answer, and, wherever a
sample's point is still outside, the one through the eigenvector that says so. The nearest point of some tens of
half-spaces is a small non-negative least-squares problem. Samples that need too many of them go to the convex solver.

Source: Lawson and Hanson (1974), *Solving Least Squares Problems*, ch. 23 (least distance programming).
"""

from __future__ import annotations

import dataclasses
import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from casysid.arrays import Array
from casysid.errors import CasysidWarning, ParameterError, SolverError
from casysid.projection.certificate import USUAL_WEIGHT, certify
from casysid.projection.convex import Cone
from casysid.projection.misfit import DataMisfit, misfit_of_estimate
from casysid.projection.objective import objective_of
from casysid.projection.problem import ProjectionProblem
from casysid.projection.results import ProjectionResult
from casysid.projection.task import Task, task_of
from casysid.threads import single_threaded

ROUNDS = 10
"""Cuts of a sample are renewed so many times before the convex solver takes over."""
OUTSIDE = 1e-4
"""A point is inside when no eigenvalue is further below zero, in the frame's units: a tenth of the floor."""
PATIENCE = 2
"""After so many samples in a row that cuts did not settle, the convex solver takes them all."""
NEAR = 0.3
"""Eigenvalues at the answer below this are cut from the start."""


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
    cuts = _cuts_at(task, weight, np.asarray(np.linalg.solve(task.frame.transform, like.parameters)))
    result, unsettled = np.full(points.shape, np.nan), 0
    for row, point in enumerate(points):
        sample = dataclasses.replace(misfit, target=misfit.seen @ point)
        scaled = cuts.nearest(sample) if unsettled < PATIENCE else None
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


@dataclass(frozen=True, eq=False)
class _Cuts:
    """The feasible set in whitened coordinates ``z = C φ``, as far as it is known at the answer.

    Attributes:
        task: With frame and cone.
        weight: Of the prior.
        factor: ``C``, upper triangular, shape (p, p).
        basis: Of the coordinates that equalities leave free, orthonormal, shape (p, f).
        origin: The answer in whitened coordinates, shape (p,).
        rows: ``N``, half-spaces ``N (z - origin) >= -slack``, shape (k, p).
        slack: Shape (k,).
    """

    task: Task
    weight: float
    factor: Array
    basis: Array
    origin: Array
    rows: Array
    slack: Array

    def nearest(self, sample: DataMisfit) -> Array | None:
        """The nearest feasible ``φ`` to a sample's estimate, shape (p,); None when cuts do not settle it."""
        target = objective_of(sample, self.task.frame, self.weight).target - self.origin
        free = self.basis.T @ target
        rows, slack = self.rows @ self.basis, self.slack
        for _ in range(ROUNDS):
            inside = _nearest_in_half_spaces(free, rows, -slack)
            if inside is None:
                return None
            scaled = solve_triangular(self.factor, self.origin + self.basis @ inside)
            normals, values = _eigenvalue_cuts(self.task.cone, scaled, -OUTSIDE)
            if not len(values):
                return np.asarray(scaled)
            more = _whitened(normals, self.factor) @ self.basis
            rows, slack = np.vstack([rows, more]), np.append(slack, values - more @ inside)
        return None


def _cuts_at(task: Task, weight: float, answer: Array) -> _Cuts:
    factor = objective_of(task.misfit, task.frame, weight).factor
    cone = task.cone
    matrix = cone.matrix.toarray()
    basis = np.eye(len(answer))
    if cone.equalities:
        _, size, directions = np.linalg.svd(_whitened(matrix[: cone.equalities], factor))
        basis = directions[int((size > 1e-9 * size[0]).sum()) :].T
    linear = slice(cone.equalities, cone.equalities + cone.inequalities)
    normals, values = _eigenvalue_cuts(cone, answer, NEAR)
    rows = np.vstack([_whitened(-matrix[linear], factor), _whitened(normals, factor)])
    slack = np.concatenate([cone.offset[linear] - matrix[linear] @ answer, values])
    return _Cuts(task, weight, factor, basis, factor @ answer, rows, np.maximum(slack, 0.0))


def _whitened(normals: Array, factor: Array) -> Array:
    """Gradients with respect to ``z`` of what has gradients ``normals`` with respect to ``φ``, shape (k, p)."""
    return np.asarray(solve_triangular(factor, normals.T, trans="T").T)


def _eigenvalue_cuts(cone: Cone, scaled: Array, below: float) -> tuple[Array, Array]:
    """Gradients (k, p) and values (k,) of the links' eigenvalues at ``φ`` that lie below a bound."""
    values, vectors = np.linalg.eigh(cone.matrices(scaled))
    body, place = np.nonzero(values < below)
    v = vectors[body, :, place]
    return cone.gradients(body, v), values[body, place]


def _nearest_in_half_spaces(target: Array, rows: Array, lower: Array) -> Array | None:
    """The nearest ``x`` to a target with ``rows x >= lower``, shape (f,); None when there is none to be found."""
    lacking = lower - rows @ target
    if not (lacking > 0.0).any():
        return target
    length = np.linalg.norm(rows, axis=1)
    sound = length > 0.0
    unit, lacking = rows[sound] / length[sound, None], lacking[sound] / length[sound]
    size = float(np.abs(lacking).max())
    stacked = np.vstack([unit.T, lacking / size])
    try:
        weights, _ = nnls(stacked, np.append(np.zeros(len(target)), 1.0), maxiter=20 * len(lacking))
    except RuntimeError:
        return None
    residual = stacked @ weights - np.append(np.zeros(len(target)), 1.0)
    return None if not residual[-1] < 0.0 else target - size * residual[:-1] / residual[-1]

"""The projection of an estimate, and constrained least squares in one step."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError, SolverError
from casysid.moments import NormalEquations
from casysid.nlp import Progress
from casysid.projection.certificate import USUAL_WEIGHT, certify
from casysid.projection.layout import as_vector
from casysid.projection.misfit import misfit_of_equations, misfit_of_estimate
from casysid.projection.problem import ProjectionProblem
from casysid.projection.results import ProjectionResult
from casysid.projection.solving import solve_task
from casysid.projection.task import task_of
from casysid.threads import single_threaded


@single_threaded()
def project(
    problem: ProjectionProblem,
    estimate: npt.ArrayLike,
    metric: npt.ArrayLike,
    prior: npt.ArrayLike | None = None,
    *,
    residual_energy: float | None = None,
    progress: Progress | None = None,
) -> ProjectionResult:
    """The physically consistent parameters nearest to an estimate, as the data measure distance.

    Minimises ``(θ - θ_est)ᵀ G (θ - θ_est)``; what is in the null space of ``G`` stays close to the prior.

    Args:
        problem: From :func:`build_projection`.
        estimate: ``θ_est``, shape (p,).
        metric: ``G``, shape (p, p): the data's metric, such as the estimator's weighted ``S_xx``.
        prior: The model file's parameters, shape (p,); zeros when None.
        residual_energy: ``Σ w (y - xᵀθ_est)²`` in the units of ``G``, the measure of what is a small misfit; None takes
            a fit to 3 % of the torque.
        progress: Called at every iteration of IPOPT; an answer that is true ends it, and the convex answer is taken.

    Raises:
        ParameterError: A shape is wrong, a number is not finite, or the metric has negative eigenvalues.
        SolverError: No consistent parameters satisfy what is known, or no solver found an answer.

    Source: Ting, Mistry, Peters, Schaal, Nakanishi (2006), Eq. (5) and (8).
    """
    p = len(problem.layout)
    G = np.asarray(metric, dtype=np.float64)
    if G.shape != (p, p) or not np.isfinite(G).all():
        raise ParameterError(f"projection: the metric must be ({p}, {p}) finite numbers; got shape {G.shape}")
    misfit = misfit_of_estimate(G, as_vector("the estimate", estimate, p), residual_energy)
    return solve_task(task_of(problem, misfit, prior), progress)


@single_threaded()
def constrained_least_squares(
    problem: ProjectionProblem,
    equations: NormalEquations,
    prior: npt.ArrayLike | None = None,
    *,
    progress: Progress | None = None,
) -> ProjectionResult:
    """The physically consistent parameters of least residual energy, in one step from the moments.

    The same as projecting the least-squares estimate in the metric ``S_xx``; arguments and errors as :func:`project`.
    """
    if equations.xx.shape[0] != len(problem.layout):
        raise ParameterError(
            f"projection: the moments have {equations.xx.shape[0]} columns, the problem {len(problem.layout)}"
        )
    return solve_task(task_of(problem, misfit_of_equations(equations), prior), progress)


@single_threaded()
def convex_least_squares(
    problem: ProjectionProblem, equations: NormalEquations, prior: npt.ArrayLike | None = None
) -> Array:
    """As :func:`constrained_least_squares`, by the convex solver alone: for searches that solve often.

    Raises:
        SolverError: The convex solver has no answer.
    """
    task = task_of(problem, misfit_of_equations(equations), prior)
    certificate = certify(task, USUAL_WEIGHT)
    if certificate is None:
        raise SolverError("projection: the convex solver found no consistent parameters; look at the moments")
    return np.asarray(task.frame.transform @ certificate.scaled)

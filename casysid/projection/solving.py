"""Solving a projection with IPOPT, under the eyes of the convex problem."""

from __future__ import annotations

import math
import time
import warnings

import numpy as np

from casysid.arrays import Array
from casysid.errors import CasysidWarning, SolverError
from casysid.inertia import smallest_eigenvalue
from casysid.nlp import NlpIteration, NlpSolution, NlpStatus, Progress, solve_nlp
from casysid.projection.certificate import USUAL_WEIGHT, Certificate, weigh_prior
from casysid.projection.frame import UNIT_BODY
from casysid.projection.objective import SCALE, Objective, objective_of
from casysid.projection.results import ProjectionResult, ProjectionStatus, Solver
from casysid.projection.task import Task

CLOSE = 1e-3
"""IPOPT is stopped when it exceeds the convex optimum by this fraction of the prior's term."""
SHORT = 1e-2
"""And its answer is not taken when it exceeds it by more than this fraction."""
LIFT = 1e-2
"""Starts lie this far inside: on the boundary the virtual parameters have stationary points that are no optimum."""
ROUNDING = 1e-7
"""Violations of constraints below this are rounding."""
AS_GOOD_AS_ZERO = 1e-9
"""Single numbers below this, in the frame's units, are a solver's idea of zero."""
AT_BOUND = 2e-3
"""What lies closer to its bound than this, in the frame's units, is on it."""


def solve_task(task: Task, progress: Progress | None) -> ProjectionResult:
    """The projection: nothing to do, IPOPT's answer, or the convex solver's, whichever is right."""
    began = time.perf_counter()
    estimate = objective_of(task.misfit, task.frame, USUAL_WEIGHT).minimum(task.frame)
    if task.cone.contains(estimate):
        return _result(task, task.polished(estimate), ProjectionStatus.UNCHANGED, Solver.NONE, None, math.nan, 0, began)
    certificate = weigh_prior(task)
    local, iterations = _solve_locally(task, certificate, progress)
    scaled, status, solver = _choose(local, certificate)
    if status is not ProjectionStatus.CERTIFIED:
        warnings.warn(f"projection: {status.value}", CasysidWarning, stacklevel=4)
    gap = math.nan if local is None or certificate is None else task.data_misfit(local) - certificate.misfit
    return _result(task, scaled, status, solver, certificate, gap, iterations, began)


def _choose(local: Array | None, certificate: Certificate | None) -> tuple[Array, ProjectionStatus, Solver]:
    if certificate is not None and not _is_good(local, certificate):
        return certificate.scaled, ProjectionStatus.CONVEX, Solver.CLARABEL
    if local is None:
        raise SolverError(
            "projection: neither IPOPT nor the convex solver found consistent parameters; look at the estimate's metric"
        )
    status = ProjectionStatus.UNCERTIFIED if certificate is None else ProjectionStatus.CERTIFIED
    return local, status, Solver.IPOPT


def _is_good(local: Array | None, certificate: Certificate) -> bool:
    return local is not None and certificate.objective(local) <= certificate.within(SHORT)


def _solve_locally(task: Task, certificate: Certificate | None, progress: Progress | None) -> tuple[Array | None, int]:
    """IPOPT's best answer, None if it has none, and its iterations.

    It starts from the convex optimum, whose bound holds wherever a local answer comes from: from the clipped estimate a
    robot of sixty links took thirty times as many iterations. The estimate and the prior are the next starts.
    """
    objective = objective_of(task.misfit, task.frame, USUAL_WEIGHT) if certificate is None else certificate.objective
    goal = -math.inf if certificate is None else certificate.within(CLOSE)
    best: Array | None = None
    iterations = 0
    starts = [task.start(objective, LIFT), task.lifted(task.frame.scaled_prior, LIFT)]
    if certificate is not None:
        starts.insert(0, task.lifted(certificate.scaled, LIFT))
    for start in starts:
        solution = _run_ipopt(task, objective, start, goal, progress)
        iterations += solution.iterations
        usable = solution.success if certificate is None else math.isfinite(solution.objective)
        if usable and solution.infeasibility < ROUNDING:
            found = task.problem.program.scaled(solution.variables, task.frame.scaled_prior)
            best = found if best is None or objective(found) < objective(best) else best
        slow = solution.status is NlpStatus.MAX_ITERATIONS
        if certificate is not None and (slow or _is_good(best, certificate)):
            break
    return best, iterations


def _run_ipopt(task: Task, objective: Objective, start: Array, goal: float, progress: Progress | None) -> NlpSolution:
    """One run, until the objective is at the goal or IPOPT's own tolerance."""

    def is_done(iteration: NlpIteration) -> bool:
        asked = progress is not None and bool(progress(iteration))
        return asked or (iteration.objective <= SCALE * goal and iteration.infeasibility < ROUNDING)

    program = task.problem.program
    rows, lower, upper = task.problem.constraints.in_coordinates(task.frame.transform)
    return solve_nlp(
        program.nlp,
        program.variables(start),
        parameters=program.values(objective, task.frame, rows),
        constraint_lower=lower,
        constraint_upper=upper,
        progress=is_done,
    )


def _result(
    task: Task,
    scaled: Array,
    status: ProjectionStatus,
    solver: Solver,
    certificate: Certificate | None,
    gap: float,
    iterations: int,
    began: float,
) -> ProjectionResult:
    scaled, single = scaled.copy(), list(task.problem.layout.non_negative)
    scaled[single] = np.where(scaled[single] > AS_GOOD_AS_ZERO, scaled[single], 0.0)
    parameters = task.frame.transform @ scaled
    bodies = parameters[: task.problem.layout.inertial].reshape(-1, 10)
    return ProjectionResult(
        parameters=parameters,
        status=status,
        solver=solver,
        misfit=task.misfit(parameters),
        gap=gap,
        prior_weight=math.nan
        if solver is Solver.NONE
        else USUAL_WEIGHT
        if certificate is None
        else certificate.objective.prior_weight,
        prior_cost=math.nan if certificate is None else certificate.prior_cost,
        smallest_eigenvalue=float(smallest_eigenvalue(bodies).min(initial=math.inf)),
        active=_active(task, scaled),
        iterations=iterations,
        seconds=time.perf_counter() - began,
    )


def _active(task: Task, scaled: Array) -> tuple[str, ...]:
    layout, constraints = task.problem.layout, task.problem.constraints
    bodies = scaled[: layout.inertial].reshape(-1, 10) - task.problem.floor * UNIT_BODY
    thin = smallest_eigenvalue(bodies, task.problem.consistency) < AT_BOUND
    rows, lower, upper = constraints.in_coordinates(task.frame.transform)
    at_bound = np.minimum(rows @ scaled - lower, upper - rows @ scaled) < AT_BOUND
    return (
        *(layout.links[link] for link in np.flatnonzero(thin & ~constraints.kept[: layout.inertial : 10])),
        *(layout.names[place] for place in layout.non_negative if scaled[place] < AT_BOUND),
        *(constraints.names[row] for row in np.flatnonzero(at_bound & (lower < upper))),
    )

"""The convex optimum as a yardstick, and how much weight the prior gets."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from casysid.arrays import Array, frozen
from casysid.errors import SolverError
from casysid.projection.convex import ConvexOptimum, solve_convex
from casysid.projection.objective import Objective, objective_of
from casysid.projection.task import Task

PRIOR_WEIGHTS = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1e0, 1e1)
"""Weights of the distance to the prior that are tried."""
USUAL_WEIGHT = 1e-5
"""Where the data see everything, or the convex solver cannot say what a weight costs."""
FAINTEST = 1e-9
"""At this weight the prior costs the data nothing: what the cost is measured from."""
LARGEST_TERM = 0.05
"""And a share of no more than this fraction of the residual energy."""
UNSOUND = 1e-4, 1e-7
"""A convex answer is dropped when, feasible to the last digit, it exceeds the dual bound by more than this fraction of
the objective and this fraction of the residual energy."""
REFINEMENTS = 3
"""Solutions at most: each gains as many digits as the one before."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """A convex optimum.

    Attributes:
        objective: What was minimised.
        scaled: ``φ``, feasible, shape (p,).
        value: The objective there, no more than rounding above its smallest.
        misfit: The data's part of it.
        prior_cost: How much of that is due to the prior's weight; nan where unknown.
    """

    objective: Objective
    scaled: Array
    value: float
    misfit: float
    prior_cost: float = float("nan")

    def __post_init__(self) -> None:
        object.__setattr__(self, "scaled", frozen(self.scaled))

    def within(self, share: float) -> float:
        """Objectives up to this are as good: above the optimum by a share of its smaller term, the prior's."""
        prior = max(self.value - self.misfit, self.objective.prior_weight, 1e-3 * self.value)
        return self.value + share * min(prior, LARGEST_TERM * (1.0 + self.misfit))


def certify(task: Task, weight: float) -> Certificate | None:
    """The convex optimum at a weight of the prior; None when the solver is not accurate enough.

    The solver's accuracy is relative to the misfit at its reference. Where the prior misses by far more than the
    optimum, its answer is not feasible to the last digit, and is refined: solved again with itself as the reference.
    """
    objective = objective_of(task.misfit, task.frame, weight)
    reference = task.frame.scaled_prior
    for _ in range(REFINEMENTS):
        optimum = _optimum(objective, task, reference)
        if optimum is None:
            return None
        scaled = task.polished(optimum.scaled)
        value = objective(scaled)
        if value - optimum.bound <= UNSOUND[0] * value + UNSOUND[1]:
            return Certificate(objective, scaled, value, task.data_misfit(scaled))
        reference = optimum.scaled
    return None


def _optimum(objective: Objective, task: Task, reference: Array) -> ConvexOptimum | None:
    """What the convex solver finds; None where it fails, also where it denies an answer that the prior is."""
    try:
        return solve_convex(objective, task.cone, reference)
    except SolverError:
        if task.cone.contains(task.frame.scaled_prior):
            return None
        raise


def rough_answer(task: Task) -> Array | None:
    """A feasible point next to where the convex solver ends, however far above its bound; None without one."""
    objective = objective_of(task.misfit, task.frame, USUAL_WEIGHT)
    optimum = _optimum(objective, task, task.frame.scaled_prior)
    return None if optimum is None else task.polished(optimum.scaled)


def weigh_prior(task: Task) -> Certificate | None:
    """The convex optimum at the heaviest weight of the prior that the data can afford; None without any.

    The cost grows with the weight, so a few bisections of the table find it; if none is affordable it is the faintest.
    """
    if task.misfit.unseen.shape[1] == 0:
        return certify(task, USUAL_WEIGHT)
    free = certify(task, FAINTEST)
    if free is None:
        return certify(task, USUAL_WEIGHT)
    budget = task.problem.prior_budget * (1.0 + free.misfit)
    best, affordable, dear = free, -1, len(PRIOR_WEIGHTS)
    while dear - affordable > 1:
        middle = (affordable + dear) // 2
        tried = certify(task, PRIOR_WEIGHTS[middle])
        if tried is not None and tried.misfit - free.misfit <= budget:
            best, affordable = tried, middle
        else:
            dear = middle
    return dataclasses.replace(best, prior_cost=best.misfit - free.misfit)

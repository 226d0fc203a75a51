"""The convex optimum as a yardstick, and how much weight the prior gets."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.projection.convex import Cone, cone_of, solve_convex
from casysid.projection.frame import UNIT_BODY, Frame, clipped, feasible, frame_of
from casysid.projection.layout import as_vector
from casysid.projection.misfit import DataMisfit
from casysid.projection.objective import Objective, objective_of
from casysid.projection.problem import ProjectionProblem

PRIOR_WEIGHTS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
"""Weights of the distance to the prior that are tried, heaviest first; the last is taken whatever it costs."""
USUAL_WEIGHT = 1e-5
"""Where the data see everything, or the convex solver cannot say what a weight costs."""
FAINTEST = 1e-9
"""At this weight the prior costs the data nothing: what the cost is measured from."""
START_WEIGHT = 1e-4
"""Draws the start to the prior in all directions, so that weakly seen ones do not begin far out."""
UNSOUND = 1e-4
"""A convex answer is dropped when making it feasible to the last digit costs more than this fraction of the objective."""


@dataclass(frozen=True, eq=False)
class Task:
    """One projection with its data and prior, ready for both solvers."""

    problem: ProjectionProblem
    misfit: DataMisfit
    frame: Frame
    cone: Cone

    def data_misfit(self, scaled: Array) -> float:
        """What ``φ`` costs the data."""
        return self.misfit(self.frame.transform @ scaled)

    def polished(self, scaled: Array) -> Array:
        """``φ`` that is feasible up to a solver's rounding, made consistent to the last digit."""
        problem = self.problem
        inside = feasible(problem.layout, scaled, problem.consistency, problem.floor)
        return np.where(problem.constraints.kept, self.frame.scaled_prior, inside)

    def start(self, objective: Objective, lift: float) -> Array:
        """The estimate drawn a little to the prior, clipped, and lifted off the boundary."""
        problem = self.problem
        inside = clipped(problem.layout, objective.minimum(self.frame, START_WEIGHT), problem.floor)
        return self.lifted(inside, lift)

    def lifted(self, scaled: Array, lift: float) -> Array:
        """``φ`` moved into the cone by a share of unit bodies and units."""
        result, layout = scaled.copy(), self.problem.layout
        result[: layout.inertial].reshape(-1, 10)[:] += lift * UNIT_BODY
        result[list(layout.non_negative)] += lift
        return result


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
        """Objectives up to this are as good: the share is of the prior's term, which is the smaller one as a rule."""
        prior = max(self.value - self.misfit, self.objective.prior_weight)
        return self.value + share * max(prior, 1e-3 * self.value)


def task_of(problem: ProjectionProblem, misfit: DataMisfit, prior: npt.ArrayLike | None) -> Task:
    """Scale a projection by its data and its prior, zeros when None."""
    size = len(problem.layout)
    start = np.zeros(size) if prior is None else as_vector("the prior", prior, size)
    frame = frame_of(problem.layout, problem.constraints, misfit, start, problem.consistency, problem.floor)
    cone = cone_of(problem.layout, problem.constraints, frame, problem.consistency, problem.floor)
    return Task(problem, misfit, frame, cone)


def certify(task: Task, weight: float) -> Certificate | None:
    """The convex optimum at a weight of the prior; None when the solver is not accurate enough."""
    objective = objective_of(task.misfit, task.frame, weight)
    optimum = solve_convex(objective, task.cone, task.frame.scaled_prior)
    if optimum is None:
        return None
    scaled = task.polished(optimum.scaled)
    value = objective(scaled)
    if value - optimum.bound > UNSOUND * (value + weight):
        return None
    return Certificate(objective, scaled, value, task.data_misfit(scaled))


def weigh_prior(task: Task) -> Certificate | None:
    """The convex optimum at the heaviest weight of the prior that the data can afford; None without any."""
    if task.misfit.unseen.shape[1] == 0:
        return certify(task, USUAL_WEIGHT)
    free, best = certify(task, FAINTEST), None
    if free is None:
        return certify(task, USUAL_WEIGHT)
    for weight in PRIOR_WEIGHTS:
        certificate = certify(task, weight)
        if certificate is not None:
            best = dataclasses.replace(certificate, prior_cost=certificate.misfit - free.misfit)
            if best.prior_cost <= task.problem.prior_budget * (1.0 + free.misfit):
                break
    return best

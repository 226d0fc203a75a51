"""One projection with its data and its prior: what both solvers start from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.projection.convex import Cone, cone_of
from casysid.projection.frame import UNIT_BODY, Frame, clipped, feasible, frame_of
from casysid.projection.layout import as_vector
from casysid.projection.misfit import DataMisfit
from casysid.projection.objective import Objective
from casysid.projection.problem import ProjectionProblem

START_WEIGHT = 1e-4
"""Draws the start to the prior in all directions, so that weakly seen ones do not begin far out."""


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


def task_of(problem: ProjectionProblem, misfit: DataMisfit, prior: npt.ArrayLike | None) -> Task:
    """Scale a projection by its data and its prior, zeros when None."""
    size = len(problem.layout)
    start = np.zeros(size) if prior is None else as_vector("the prior", prior, size)
    frame = frame_of(problem.layout, problem.constraints, misfit, start, problem.consistency, problem.floor)
    cone = cone_of(problem.layout, problem.constraints, frame, problem.consistency, problem.floor)
    return Task(problem, misfit, frame, cone)

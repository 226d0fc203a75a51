"""Which constraints an optimiser looks at, and when: all now and then, or often where a motion is near its limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.excitation.constraints.constraint import Constraint
from casysid.excitation.constraints.joint import JointConstraint
from casysid.excitation.constraints.torque import TorqueConstraint
from casysid.excitation.design.problem import BETWEEN, REFINEMENT, ExcitationProblem

BUSY = 0.4
"""Torque is looked at of joints where some motion takes more than this share of the limit."""
NEAR = 0.15
"""What comes nearer to its limit than this share of its scale is looked at often."""
OFTEN = 6
"""At every so many instants of the grid of the check, a fortieth of the highest harmonic's period; at all of them where
a limit is violated. Between two, a sinusoid of that frequency exceeds both by (2π/40)²/8, half of the tightening."""
SELDOM = 20
"""At every so many of its instants everything is looked at."""


class Watched(NamedTuple):
    """A constraint, and the instants of one period at which it is looked at, shape (N,), [s]."""

    constraint: Constraint
    time: Array


def on_grid(
    problem: ExcitationProblem, stride: int = 1, constraints: Sequence[Constraint] | None = None
) -> list[Watched]:
    """Constraints, None for all, at every so many instants of the design grid; dense ones twice as often as it."""
    time, dense = problem.series.grid(problem.samples)[::stride], problem.series.grid(2 * problem.samples)
    return [
        Watched(one, dense if one.dense else time)
        for one in (problem.constraints if constraints is None else constraints)
    ]


def busy_constraints(problem: ExcitationProblem, motions: Sequence[Array]) -> list[Constraint]:
    """All constraints but the torque of joints that stay far from their limits on some motions' variables."""
    constraints: list[Constraint | None] = []
    for constraint in problem.constraints:
        if isinstance(constraint, TorqueConstraint):
            grid = problem.series.grid(problem.samples)
            peak = [np.abs(constraint.measure(problem.trajectory(x).motion(grid))).max(axis=0) for x in motions]
            constraints.append(constraint.watching(np.max(peak, axis=0) > BUSY * constraint.limit))
        else:
            constraints.append(constraint)
    return [constraint for constraint in constraints if constraint is not None]


@dataclass(eq=False)
class NearLimits:
    """Instants at which motions came near to limits; grows with every motion it sees.

    Attributes:
        problem: Whose limits.
        constraints: The constraints to look at, those of joints one by one.
    """

    problem: ExcitationProblem
    constraints: Sequence[Constraint]
    _often: list[npt.NDArray[np.bool_]] = field(init=False)

    def __post_init__(self) -> None:
        self.constraints = [part for constraint in self.constraints for part in _parts(constraint)]
        self._often = [self._every(SELDOM)] * len(self.constraints)

    def see(self, x: Array) -> list[Watched]:
        """What to look at after a motion, of which the variables are given, and all before it."""
        time = self.problem.series.grid(REFINEMENT * self.problem.samples)
        motion, often = self.problem.trajectory(x).motion(time), self._every(OFTEN)
        for k, constraint in enumerate(self.constraints):
            room = (constraint.slack(motion) / constraint.scale).min(axis=1, initial=np.inf)
            self._often[k] = self._often[k] | (often & (room < NEAR)) | (room < BETWEEN)
        return [
            Watched(constraint, time[chosen]) for constraint, chosen in zip(self.constraints, self._often, strict=True)
        ]

    def _every(self, step: int) -> npt.NDArray[np.bool_]:
        return np.asarray(np.arange(REFINEMENT * self.problem.samples) % step == 0)


def _parts(constraint: Constraint) -> list[Constraint]:
    if isinstance(constraint, JointConstraint):
        return [constraint.of_joint(k) for k in range(len(constraint.joints))]
    return [constraint]

"""The distances that a posture has to keep."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.excitation import Capsule, capsules_of
from casysid.excitation.constraints.clearance import Clearance, build_clearance
from casysid.excitation.constraints.obstacles import Obstacle
from casysid.excitation.constraints.solids import read_geometry
from casysid.kinematics import random_configurations
from casysid.robot import Robot
from casysid.robot.coordinates import channels_from_configuration

_SAMPLES = 256  # configurations that tell which capsules overlap nearly everywhere


class Guard:
    """What is kept at a distance from what.

    Attributes:
        clearance: The distances; None where none are looked at.
        near: Those of them that a solver has to look at: no links that stay far apart in all configurations.
    """

    def __init__(
        self, robot: Robot, obstacles: Sequence[Obstacle], capsules: Sequence[Capsule] | None, margin: float
    ) -> None:
        """Capsules as for :meth:`InverseKinematics.reach_clear`.

        Raises:
            ParameterError: The margin is negative, or joints have several degrees of freedom.
        """
        if not 0.0 <= margin < np.inf:
            raise ParameterError(f"margin: wanted a distance to keep [m], zero or more; got {margin}")
        self._robot = robot
        self.clearance: Clearance | None = None
        self.near: Clearance | None = None
        if capsules is not None and not len(capsules):
            if obstacles:
                raise ParameterError("obstacles: there are no capsules to keep at a distance from them")
            return
        several = [joint.name for joint in robot.joints if joint.v.stop - joint.v.start > 1]
        if several:
            raise ParameterError(
                f"distances: joint '{several[0]}' has several degrees of freedom, for which no distances are kept; "
                "give no capsules (capsules=()) and no obstacles"
            )
        samples = self._positions(random_configurations(robot, np.random.default_rng(0), _SAMPLES))
        solids = read_geometry(robot).solids if capsules is None else ()
        around = capsules_of(robot, solids) if capsules is None else tuple(capsules)
        found = build_clearance(robot, around, obstacles, samples, margin, solids)
        if len(found):
            self.clearance, self.near = found, found.near(samples, margin)

    def least(self, q: Array) -> tuple[float, str]:
        """The least distance at a configuration (nq,), [m], and what it is between; inf where there is none."""
        if self.clearance is None:
            return np.inf, ""
        values = self.clearance.distances(self._positions(q[None]))[0]
        worst = int(np.argmin(values))
        return float(values[worst]), self.clearance.labels[worst]

    def _positions(self, q: Array) -> Array:
        return channels_from_configuration(self._robot, q)

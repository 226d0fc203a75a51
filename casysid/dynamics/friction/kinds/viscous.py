"""Viscous friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from casysid.dynamics.friction.direction import Direction, damping_unit
from casysid.dynamics.friction.kind import DriveState, FrictionColumn
from casysid.robot import Robot


@dataclass(frozen=True)
class Viscous(FrictionColumn):
    """Torque proportional to velocity."""

    kind: ClassVar[str] = "viscous"
    non_negative: ClassVar[bool] = True

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return damping_unit(direction)

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """``ds/dt``."""
        return state.velocity

    def prior(self, robot: Robot, dof: int) -> float:
        """The file's damping."""
        return float(robot.damping[dof])

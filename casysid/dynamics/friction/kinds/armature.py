"""The inertia of rotor and gear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from casysid.dynamics.friction.direction import Direction
from casysid.dynamics.friction.kind import DriveState, FrictionColumn
from casysid.robot import Robot


@dataclass(frozen=True)
class Armature(FrictionColumn):
    """Inertia of rotor and gear, seen at the joint."""

    kind: ClassVar[str] = "armature"
    is_friction: ClassVar[bool] = False
    non_negative: ClassVar[bool] = True

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return "kg" if direction.linear else "kg m^2"

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """``d²s/dt²``."""
        return state.acceleration

    def prior(self, robot: Robot, dof: int) -> float:
        """The file's armature."""
        return float(robot.armature[dof])

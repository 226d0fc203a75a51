"""Dry friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from casysid.dynamics.friction.direction import Direction, force_unit
from casysid.dynamics.friction.kind import DriveState, FrictionColumn
from casysid.dynamics.friction.smooth_sign import SmoothSign
from casysid.robot import Robot


@dataclass(frozen=True)
class Coulomb(SmoothSign, FrictionColumn):
    """Dry friction: a torque against motion that does not depend on speed."""

    kind: ClassVar[str] = "coulomb"
    non_negative: ClassVar[bool] = True

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return force_unit(direction)

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """``tanh(ds/dt / width)``."""
        return self.sign(state)

    def prior(self, robot: Robot, dof: int) -> float:
        """The file's dry friction."""
        return float(robot.dry_friction[dof])

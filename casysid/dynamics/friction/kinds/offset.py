"""A constant torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from casysid.dynamics.friction.direction import Direction, force_unit
from casysid.dynamics.friction.kind import DriveState, FrictionColumn


@dataclass(frozen=True)
class Offset(FrictionColumn):
    """Constant torque: a sensor's zero, a motor current's offset."""

    kind: ClassVar[str] = "offset"
    is_friction: ClassVar[bool] = False

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return force_unit(direction)

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """One."""
        return ca.SX(1)

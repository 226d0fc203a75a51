"""A spring."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from casysid.dynamics.friction.direction import Direction
from casysid.dynamics.friction.kind import DriveState, FrictionColumn, JointUse, acts_along


@dataclass(frozen=True)
class Spring(FrictionColumn):
    """Torque proportional to position: a gravity-compensating spring, a cable; the offset says where it is slack.

    Attributes:
        joints: Where it acts; None for everywhere.
    """

    joints: tuple[str, ...] | None = None

    kind: ClassVar[str] = "stiffness"
    is_friction: ClassVar[bool] = False

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return "N/m" if direction.linear else "N m/rad"

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """``s``."""
        return state.position if acts_along(self.joints, direction) else None

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[Spring]:
        """One, unless the joint turns without end."""
        if not use.direction.unlimited:
            yield cls((use.direction.name,))

    def describe(self, direction: Direction) -> str:
        """In words."""
        return "spring"

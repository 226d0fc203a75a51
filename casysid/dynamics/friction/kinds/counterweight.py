"""A counterweight or a spring balancer that goes with one joint's angle alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from casysid.dynamics.friction.direction import Direction, force_unit
from casysid.dynamics.friction.kind import DriveState, FrictionKind, JointUse, Term, acts_along


@dataclass(frozen=True)
class Counterweight(FrictionKind):
    """Gravity compensation about a joint's axis, ``cos s`` and ``sin s``: of a weight, or of a spring with zero length.

    Unlike the links' weight it goes with the joint's own angle, whatever the joints before it do. Where the axis stays
    level in space the two cannot be told apart.

    Attributes:
        joints: Where it acts; None for all angles.
    """

    joints: tuple[str, ...] | None = None

    kind: ClassVar[str] = "counterweight"
    is_friction: ClassVar[bool] = False

    def terms(self, direction: Direction, state: DriveState) -> tuple[Term, ...]:
        """Cosine and sine of an angle."""
        if direction.linear or not acts_along(self.joints, direction):
            return ()
        waves = ("cos", ca.cos(state.position)), ("sin", ca.sin(state.position))
        return tuple(Term(f"{self.kind}_{name}", force_unit(direction), wave) for name, wave in waves)

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[Counterweight]:
        """One for an angle."""
        if not use.direction.linear:
            yield cls((use.direction.name,))

    def describe(self, direction: Direction) -> str:
        """In words."""
        return "counterweight about its axis"

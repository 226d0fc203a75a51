"""Viscous friction that differs by the direction of motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from casysid.dynamics.friction.direction import Direction, damping_unit
from casysid.dynamics.friction.kind import DriveState, FrictionColumn, JointUse, Law, acts_along
from casysid.dynamics.friction.kinds.viscous import Viscous


@dataclass(frozen=True)
class AsymmetricViscous(FrictionColumn):
    """Half of what viscous friction is more in forward than in backward motion, ``|velocity|``.

    An offset does the same for Coulomb friction.

    Attributes:
        joints: Where it acts; None for everywhere.
    """

    joints: tuple[str, ...] | None = None

    kind: ClassVar[str] = "viscous_asymmetry"

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return damping_unit(direction)

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """``|ds/dt|``."""
        return ca.fabs(state.velocity) if acts_along(self.joints, direction) else None

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[AsymmetricViscous]:
        """The one that there is."""
        yield cls((use.direction.name,))

    def laws(self, own: Sequence[str], beside: Mapping[str, str]) -> tuple[Law, ...]:
        """No direction of motion is driven: it is never more than viscous friction itself."""
        viscous = beside.get(Viscous.kind)
        if viscous is None:
            return ()
        return tuple(Law({viscous: 1.0, own[0]: sign}, f"{viscous} in either direction") for sign in (1.0, -1.0))

    def describe(self, direction: Direction) -> str:
        """In words."""
        return "viscous by direction of motion"

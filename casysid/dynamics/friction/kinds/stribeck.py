"""Dry friction's excess at slow motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from casysid.dynamics.friction.direction import Direction, force_unit, speed_unit
from casysid.dynamics.friction.kind import DriveState, FrictionColumn, JointUse, require_positive, value_at
from casysid.dynamics.friction.smooth_sign import SmoothSign

VELOCITIES = (0.05, 0.15, 0.4, 1.0)
"""Candidates, in root mean square velocities of the joint."""


@dataclass(frozen=True)
class Stribeck(SmoothSign, FrictionColumn):
    """What dry friction is more at slow motion, ``sign(velocity) exp(-(velocity / v_s)²)``.

    Attributes:
        velocity: ``v_s`` [rad/s or m/s]. One for all, or by name of the directions where it acts.

    Source: Armstrong-Hélouvry, Dupont, Canudas de Wit (1994), Eq. (3), with exponent two.
    """

    velocity: float | Mapping[str, float] = 0.1

    kind: ClassVar[str] = "stribeck"
    by_design: ClassVar[bool] = True
    non_negative: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self.kind, "velocity", self.velocity)

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return force_unit(direction)

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """``tanh(ds/dt / width) exp(-(ds/dt / v_s)²)``."""
        slow = value_at(self.velocity, direction)
        return None if slow is None else self.sign(state) * ca.exp(-((state.velocity / slow) ** 2))

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[Stribeck]:
        """Some velocities between the smooth sign's width and the joint's usual speed."""
        for share in VELOCITIES:
            if share * use.speed > use.width:
                yield cls({use.direction.name: use.width}, {use.direction.name: share * use.speed})

    def describe(self, direction: Direction) -> str:
        """In words, with its velocity."""
        return f"Stribeck (v_s = {value_at(self.velocity, direction):.3g} {speed_unit(direction)})"

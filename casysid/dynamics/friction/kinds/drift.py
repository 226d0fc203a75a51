"""Friction that changes as a drive warms up."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from casysid.dynamics.friction.direction import Direction, damping_unit, force_unit
from casysid.dynamics.friction.history import Trend
from casysid.dynamics.friction.kind import DriveState, FrictionKind, JointUse, Term, acts_along
from casysid.dynamics.friction.smooth_sign import SmoothSign


@dataclass(frozen=True)
class Drift(SmoothSign):
    """What viscous and dry friction gain from the middle of a recording to its end, and have lost at its start.

    It describes one recording and predicts no other: it keeps a trend out of the other parameters.

    Attributes:
        joints: Where it acts; None for everywhere.
    """

    joints: tuple[str, ...] | None = None

    kind: ClassVar[str] = "drift"
    is_physical: ClassVar[bool] = False
    by_design: ClassVar[bool] = True

    def histories(self, direction: Direction) -> tuple[Trend, ...]:
        """Time."""
        return (Trend(),)

    def terms(self, direction: Direction, state: DriveState) -> tuple[Term, ...]:
        """Velocity and its sign, times time from -1 to 1."""
        if not acts_along(self.joints, direction):
            return ()
        (time,) = state.histories
        return (
            Term("viscous_drift", damping_unit(direction), time * state.velocity),
            Term("coulomb_drift", force_unit(direction), time * self.sign(state)),
        )

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[FrictionKind]:
        """The one that there is."""
        yield cls({use.direction.name: use.width}, (use.direction.name,))

    def describe(self, direction: Direction) -> str:
        """In words."""
        return "friction with a trend in time"

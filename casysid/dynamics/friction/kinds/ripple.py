"""Torque that repeats over position and stores energy: cogging, a gear's or a torque sensor's ripple."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from casysid.dynamics.friction.direction import Direction, force_unit
from casysid.dynamics.friction.harmonics import Harmonics
from casysid.dynamics.friction.kind import DriveState, FrictionKind, JointUse, Term


@dataclass(frozen=True)
class Ripple(Harmonics):
    """Torque ripple ``cos(k s)``, ``sin(k s)``: it has a potential, so that what it takes it gives back.

    A motor with magnets has a few harmonics of the rotor's turn, a strain wave gear twice that of its generator's.
    """

    kind: ClassVar[str] = "ripple"
    is_friction: ClassVar[bool] = False

    def terms(self, direction: Direction, state: DriveState) -> tuple[Term, ...]:
        """Cosine and sine of each wave number."""
        return tuple(
            Term(f"{self.kind}_{name}", force_unit(direction), wave) for name, wave in self.waves(direction, state)
        )

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[FrictionKind]:
        """The wave numbers that the residual shows."""
        if use.ripple:
            yield cls({use.direction.name: use.ripple})

    def describe(self, direction: Direction) -> str:
        """In words, with its wave numbers."""
        return f"torque ripple over position (wave numbers {self.in_words(direction)})"

"""Torque that repeats over position and stores energy: cogging, a gear's or a torque sensor's ripple."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from casysid.dynamics.friction.direction import Direction, force_unit
from casysid.dynamics.friction.harmonics import Harmonics
from casysid.dynamics.friction.kind import DriveState, FrictionKind, JointUse, Term

LONG = (0.5, 1.0, 1.5)
"""Periods over the joint's range, half of one apart, which is what the range tells apart: a periodogram of the residual
shows those of two and more, since the weight, an offset and friction take part of a longer one."""
USUAL_RANGE = 2.0 * np.sqrt(2.0)
"""Of a sinusoidal position, in its standard deviations."""


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
        """The wave numbers that the residual shows, and waves that are longer than it can show."""
        if use.ripple:
            yield cls({use.direction.name: use.ripple})
        if use.travel and not use.direction.unlimited:
            for periods in LONG:
                yield cls({use.direction.name: (2.0 * np.pi * periods / (USUAL_RANGE * use.travel),)})

    def describe(self, direction: Direction) -> str:
        """In words, with its wave numbers."""
        return f"torque ripple over position (wave numbers {self.in_words(direction)})"

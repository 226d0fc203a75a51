"""Dry friction that changes over position."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np

from casysid.dynamics.friction.direction import Direction, force_unit
from casysid.dynamics.friction.harmonics import Harmonics
from casysid.dynamics.friction.kind import DriveState, FrictionKind, JointUse, Law, Term
from casysid.dynamics.friction.kinds.coulomb import Coulomb
from casysid.dynamics.friction.smooth_sign import SmoothSign
from casysid.errors import ParameterError

MOST_LAWS = 64
"""Of one direction: with one wave number they give away ``1 - cos(π/64)`` of Coulomb's friction, 0.1 %."""
MOST_WAVES = 3
"""Wave numbers of one direction, whose laws are at most so many with no fewer than four for each."""


@dataclass(frozen=True)
class CoulombRipple(SmoothSign, Harmonics):
    """What dry friction is more or less at a position, ``sign(velocity) cos(k s)``, ``sign(velocity) sin(k s)``.

    Together with Coulomb's own, which turns within the same width, it never drives: the amplitudes of its waves add up
    to no more than that.

    Source: Popovic and Goldenberg, "Modeling of friction using spectral analysis" (1998), friction as a series over
    position.
    """

    kind: ClassVar[str] = "coulomb_ripple"

    def __post_init__(self) -> None:
        SmoothSign.__post_init__(self)
        Harmonics.__post_init__(self)
        if any(len(numbers) > MOST_WAVES for numbers in self.wave_numbers.values()):
            raise ParameterError(f"{self.kind}: at most {MOST_WAVES} wave_numbers a joint; got {self.wave_numbers}")

    def terms(self, direction: Direction, state: DriveState) -> tuple[Term, ...]:
        """Cosine and sine of each wave number, against the motion."""
        return tuple(
            Term(f"{self.kind}_{name}", force_unit(direction), wave * self.sign(state))
            for name, wave in self.waves(direction, state)
        )

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[FrictionKind]:
        """The wave numbers that the residual shows against the motion, the strongest ones."""
        if use.friction_ripple:
            name = use.direction.name
            yield cls({name: use.friction_ripple[:MOST_WAVES]}, {name: use.width})

    def laws(self, own: Sequence[str], beside: Mapping[str, str]) -> tuple[Law, ...]:
        """Coulomb's friction is no less than the amplitudes' sum, each amplitude that of a polygon around its circle.

        ``r ≤ max_i (a cos φ_i + b sin φ_i) / cos(π/n)`` for n directions ``φ_i``: with one wave number 0.1 % too much,
        with two 8 %, with three 41 %.
        """
        waves = len(own) // 2
        sides = int(MOST_LAWS ** (1.0 / waves) + 1e-9)
        angles = 2.0 * np.pi * np.arange(sides) / sides
        widest = np.cos(np.pi / sides)
        dry = {beside[Coulomb.kind]: 1.0} if Coulomb.kind in beside else {}
        return tuple(
            Law({**dry, **_against(own, turned, widest)}, f"{self.kind} of {', '.join(own)} within Coulomb's friction")
            for turned in product(angles, repeat=waves)
        )

    def describe(self, direction: Direction) -> str:
        """In words, with its wave numbers."""
        return f"Coulomb over position (wave numbers {self.in_words(direction)})"


def _against(own: Sequence[str], angles: Sequence[float], widest: float) -> dict[str, float]:
    """Coefficients of cosines and sines of the waves, in turn."""
    coefficients = [-wave(angle) / widest for angle in angles for wave in (np.cos, np.sin)]
    return dict(zip(own, map(float, coefficients), strict=True))

"""Friction before sliding: hysteresis over small displacements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

from casysid.dynamics.friction.direction import Direction, force_unit
from casysid.dynamics.friction.history import Play
from casysid.dynamics.friction.kind import DriveState, FrictionKind, JointUse, Term, require_positive
from casysid.errors import ParameterError

DISPLACEMENTS = (0.001, 0.003, 0.01, 0.03, 0.1)
"""Candidates in standard deviations of the position, half a decade apart. Beside Coulomb friction at all joints one
element of 0.001 took 7 % off the mean held-out error of thirteen recorded sets, one of 0.1 nothing, four from 0.01 to
0.3 together 4 %, but more on some (``scripts/compare_friction_kinds.py``)."""


@dataclass(frozen=True)
class MaxwellSlip(FrictionKind):
    """Springs with sliders in parallel, each with the torque at which it slides as its parameter.

    Where displacements are large it is Coulomb friction that needs its way after a reversal; the parameters are not
    negative, so that each element gives back no more than it has taken.

    Attributes:
        displacements: From slack to sliding of each element [rad or m], by name of the directions where it acts.

    Source: Rizos and Fassois (2004), Al-Bender, Lampaert and Swevers (2005): generalised Maxwell slip with constant
    sliding torques, which is linear in them.
    """

    displacements: Mapping[str, tuple[float, ...]]

    kind: ClassVar[str] = "maxwell_slip"
    by_design: ClassVar[bool] = True

    def __post_init__(self) -> None:
        given = {name: tuple(float(one) for one in several) for name, several in self.displacements.items()}
        object.__setattr__(self, "displacements", given)
        for name, several in given.items():
            for one in several:
                require_positive(self.kind, f"displacements at {name}", one)
            if len(set(several)) != len(several):
                raise ParameterError(f"{self.kind}: displacements at {name} must differ; got {several}")

    def histories(self, direction: Direction) -> tuple[Play, ...]:
        """The stretch of each element."""
        return tuple(Play(one) for one in self.displacements.get(direction.name, ()))

    def terms(self, direction: Direction, state: DriveState) -> tuple[Term, ...]:
        """The stretches."""
        return tuple(
            Term(f"{self.kind}_{number}", force_unit(direction), stretch, non_negative=True)
            for number, stretch in enumerate(state.histories, start=1)
        )

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[FrictionKind]:
        """One element, its displacement small against the joint's travel."""
        if use.travel:
            for share in DISPLACEMENTS:
                yield cls({use.direction.name: (share * use.travel,)})

    def describe(self, direction: Direction) -> str:
        """In words, with its displacements."""
        several = ", ".join(f"{one:.2g}" for one in self.displacements.get(direction.name, ()))
        return f"hysteresis (Maxwell slip over {several} {'m' if direction.linear else 'rad'})"

"""Friction that grows with a power of speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from casysid.dynamics.friction.direction import Direction, force_unit
from casysid.dynamics.friction.kind import DriveState, FrictionColumn, JointUse, require_positive, value_at
from casysid.dynamics.friction.smooth_sign import SmoothSign

EXPONENTS = (0.5, 2.0, 3.0)
"""Candidates of viscous friction's power, beside one."""


@dataclass(frozen=True)
class PowerViscous(SmoothSign, FrictionColumn):
    """Friction that grows with a power of speed beside the ordinary viscous friction, ``sign(velocity) |velocity|ᵉ``.

    Attributes:
        exponent: ``e``, positive; below one for oil films, above one for churning losses. One for all, or by name of
            the directions where it acts.
    """

    exponent: float | Mapping[str, float] = 0.5

    kind: ClassVar[str] = "power_viscous"
    by_design: ClassVar[bool] = True
    non_negative: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self.kind, "exponent", self.exponent)

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        speed = "s/m" if direction.linear else "s/rad"
        return f"{force_unit(direction)} ({speed})^{value_at(self.exponent, direction) or 0.0:g}"

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """``ds/dt |ds/dt|ᵉ⁻¹``, an exponent below one made smooth within the width."""
        exponent = value_at(self.exponent, direction)
        if exponent is None:
            return None
        floor = state.numbers[0] if exponent < 1.0 else 0.0
        return state.velocity * (state.velocity**2 + floor**2) ** (0.5 * (exponent - 1.0))

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[PowerViscous]:
        """A few exponents."""
        for exponent in EXPONENTS:
            yield cls({use.direction.name: use.width}, {use.direction.name: exponent})

    def describe(self, direction: Direction) -> str:
        """In words, with its exponent."""
        return f"viscous to the power {value_at(self.exponent, direction):g}"

"""What repeats over a joint's position: waves at wave numbers that are given by name of the joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from casysid.dynamics.friction.direction import Direction
from casysid.dynamics.friction.kind import DriveState, FrictionKind, require_positive
from casysid.errors import ParameterError


@dataclass(frozen=True)
class Harmonics(FrictionKind):
    """A kind whose terms go with ``cos(k s)`` and ``sin(k s)``.

    Attributes:
        wave_numbers: ``k`` [rad/rad or rad/m] by name of the directions where it acts: how many periods a turn has, for
            what the motor does times the gear's ratio. Whole numbers at joints that turn without end.
    """

    wave_numbers: Mapping[str, tuple[float, ...]]

    def __post_init__(self) -> None:
        given = {name: tuple(float(k) for k in numbers) for name, numbers in self.wave_numbers.items()}
        object.__setattr__(self, "wave_numbers", given)
        for name, numbers in given.items():
            for k in numbers:
                require_positive(self.kind, f"wave_numbers at {name}", k)
            if len(set(_labels(numbers))) != len(numbers):
                raise ParameterError(f"{self.kind}: wave_numbers at {name} must differ; got {numbers}")

    def waves(self, direction: Direction, state: DriveState) -> list[tuple[str, Any]]:
        """Cosine and sine of every wave number along a direction, with names such as ``cos_21``.

        Raises:
            ParameterError: A wave number is not whole at a joint that turns without end, whose angle jumps.
        """
        numbers = self.wave_numbers.get(direction.name, ())
        if direction.unlimited and any(k != round(k) for k in numbers):
            raise ParameterError(
                f"{self.kind}: '{direction.name}' turns without end, so wave_numbers must be whole; got {numbers}"
            )
        return [
            (f"{name}_{label}", wave(k * state.position))
            for k, label in zip(numbers, _labels(numbers), strict=True)
            for name, wave in (("cos", ca.cos), ("sin", ca.sin))
        ]

    def in_words(self, direction: Direction) -> str:
        """The wave numbers along a direction."""
        return ", ".join(_labels(self.wave_numbers.get(direction.name, ())))


def _labels(numbers: tuple[float, ...]) -> list[str]:
    return [f"{k:g}" for k in numbers]

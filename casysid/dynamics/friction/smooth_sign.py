"""What changes with the sign of velocity, made smooth."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from casysid.arrays import Array
from casysid.dynamics.friction.direction import Direction
from casysid.dynamics.friction.kind import DriveState, FrictionKind
from casysid.errors import ParameterError


@dataclass(frozen=True)
class SmoothSign(FrictionKind):
    """A kind that changes with the sign of velocity, made smooth: ``tanh(velocity / width)``.

    A kind of one's own takes its width from ``state.numbers``, which may be a symbol, never from ``width`` itself.

    Attributes:
        width: Velocity [rad/s or m/s] at which 76 % of the friction acts: one for all, one for each of the nv degrees
            of freedom, or by name of the direction.
    """

    width: float | Sequence[float] | Array | Mapping[str, float] = 0.01

    def __post_init__(self) -> None:
        if isinstance(self.width, Mapping):
            values = np.array(list(self.width.values()), dtype=np.float64)
        else:
            values = np.asarray(self.width, dtype=np.float64)
            object.__setattr__(self, "width", float(values) if values.ndim == 0 else tuple(values.ravel().tolist()))
        if not (np.isfinite(values).all() and (values > 0.0).all()):
            raise ParameterError(f"{self.kind} friction: width must be positive and finite; got {self.width}")

    def sign(self, state: DriveState) -> Any:
        """``tanh(ds/dt / width)``."""
        return ca.tanh(state.velocity / state.numbers[0])

    def numbers(self, direction: Direction) -> tuple[float, ...]:
        """The width at a direction; at a coupling the weighted sum of its joints' unless it is named itself.

        Raises:
            ParameterError: When there is no width for the direction.
        """
        if isinstance(self.width, Mapping):
            if direction.name not in self.width:
                raise ParameterError(
                    f"{self.kind} friction: width names {sorted(self.width)}, but '{direction.name}' is missing; "
                    "name it or give one number"
                )
            return (float(self.width[direction.name]),)
        widths, c = np.asarray(self.width, dtype=np.float64), np.abs(direction.weights)
        if widths.ndim == 0:
            return (float(widths),)
        if widths.shape != c.shape:
            raise ParameterError(
                f"{self.kind} friction: width must be one number or one for each of the {c.size} degrees of freedom; "
                f"got {widths.size}"
            )
        return (float(c @ widths),)

    def with_open_numbers(self) -> Self:
        """Of one width everywhere."""
        return self.with_width(1.0)

    def with_width(self, width: float | Sequence[float] | Mapping[str, float]) -> Self:
        """With another width."""
        return dataclasses.replace(self, width=width)


def with_width(friction: Sequence[FrictionKind], width: float | Sequence[float]) -> tuple[FrictionKind, ...]:
    """The kinds with another width of their smooth sign, where they have one."""
    return tuple(kind.with_width(width) for kind in friction)

"""Further kinds of friction, for the joints that need them; without names they act at every joint and coupling.

All are linear in their parameter. What enters nonlinearly (Stribeck's velocity, the exponent of viscous friction) is
given by name of the joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from casysid.arrays import Array
from casysid.dynamics.friction import Direction, FrictionColumn, SmoothSign, force_unit
from casysid.errors import ParameterError


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
        return "N s/m" if direction.linear else "N m s/rad"

    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """``|ds/dt|``."""
        return ca.fabs(velocity) if _acts(self.joints, direction) else None


@dataclass(frozen=True)
class Spring(FrictionColumn):
    """Torque proportional to position: a gravity-compensating spring, a cable; the offset says where it is slack.

    Attributes:
        joints: Where it acts; None for everywhere.
    """

    joints: tuple[str, ...] | None = None

    kind: ClassVar[str] = "stiffness"

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return "N/m" if direction.linear else "N m/rad"

    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """``s``."""
        return position if _acts(self.joints, direction) else None


@dataclass(frozen=True)
class PowerViscous(SmoothSign):
    """Friction that grows with a power of speed beside the ordinary viscous friction, ``sign(velocity) |velocity|ᵉ``.

    Attributes:
        exponent: ``e``, positive; below one for oil films, above one for churning losses. One for all, or by name of
            the directions where it acts.
    """

    exponent: float | Mapping[str, float] = 0.5

    kind: ClassVar[str] = "power_viscous"
    non_negative: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive(self.kind, "exponent", self.exponent)

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        speed = "s/m" if direction.linear else "s/rad"
        return f"{force_unit(direction)} ({speed})^{value_at(self.exponent, direction) or 0.0:g}"

    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """``ds/dt |ds/dt|ᵉ⁻¹``, an exponent below one made smooth within the width."""
        exponent = value_at(self.exponent, direction)
        if exponent is None:
            return None
        floor = self.width_along(direction) if exponent < 1.0 else 0.0
        return velocity * (velocity**2 + floor**2) ** (0.5 * (exponent - 1.0))


@dataclass(frozen=True)
class Stribeck(SmoothSign):
    """What dry friction is more at slow motion, ``sign(velocity) exp(-(velocity / v_s)²)``.

    Attributes:
        velocity: ``v_s`` [rad/s or m/s]. One for all, or by name of the directions where it acts.

    Source: Armstrong-Hélouvry, Dupont, Canudas de Wit (1994), Eq. (3), with exponent two.
    """

    velocity: float | Mapping[str, float] = 0.1

    kind: ClassVar[str] = "stribeck"
    non_negative: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive(self.kind, "velocity", self.velocity)

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return force_unit(direction)

    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """``tanh(ds/dt / width) exp(-(ds/dt / v_s)²)``."""
        slow = value_at(self.velocity, direction)
        return None if slow is None else self.sign(direction, velocity) * ca.exp(-((velocity / slow) ** 2))


@dataclass(frozen=True)
class LoadedCoulomb(SmoothSign):
    """Dry friction in proportion to the load of the gear, ``|gravity torque| sign(velocity)``.

    The load is that of the model as it was before the identification, so that the regressor stays linear.

    Attributes:
        joints: Where it acts; None for everywhere.
        inertial_parameters: Of the links that make the load, shape (10 links,); None takes the robot's.
    """

    joints: tuple[str, ...] | None = None
    inertial_parameters: tuple[float, ...] | None = None

    kind: ClassVar[str] = "loaded_coulomb"
    non_negative: ClassVar[bool] = True

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return "1"

    def model(self, inertial_parameters: Array) -> Array:
        """Whose weight makes the load, shape (10 links,), on a robot with the given parameters.

        Raises:
            ParameterError: The column's own parameters are those of another robot.
        """
        if self.inertial_parameters is None:
            return inertial_parameters
        own = np.array(self.inertial_parameters)
        if own.shape != inertial_parameters.shape:
            raise ParameterError(
                f"{self.kind} friction: inertial_parameters must be {inertial_parameters.size} numbers; got {own.size}"
            )
        return own

    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """``|load| tanh(ds/dt / width)``."""
        if not _acts(self.joints, direction) or direction.load is None:
            return None
        return ca.fabs(direction.load) * self.sign(direction, velocity)


def value_at(values: float | Mapping[str, float], direction: Direction) -> float | None:
    """The value for a direction: the one for all, or the one under its name; None where the name is missing."""
    return values.get(direction.name) if isinstance(values, Mapping) else values


def _acts(joints: tuple[str, ...] | None, direction: Direction) -> bool:
    return joints is None or direction.name in joints


def _require_positive(kind: str, word: str, values: float | Mapping[str, float]) -> None:
    numbers = np.array(list(values.values()) if isinstance(values, Mapping) else [values], dtype=np.float64)
    if not (np.isfinite(numbers).all() and (numbers > 0.0).all()):
        raise ParameterError(f"{kind} friction: {word} must be positive and finite; got {values}")

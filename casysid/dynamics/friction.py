"""What a drive adds to the rigid bodies: friction, offset, rotor inertia; each a column of the regressor.

A column acts along a transmission coordinate ``s = cᵀ q`` with torques ``c f(s, ds/dt, d²s/dt²)``. For an ordinary
joint ``c`` is a unit vector; a motor that turns two joints of a wrist has ``c = (1, 1)`` on these two
(:class:`Coupling`). A column of one's own is a subclass of :class:`FrictionColumn` with a kind, a unit and a torque.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.robot import JointKind, Robot


@dataclass(frozen=True, eq=False)
class Direction:
    """A transmission coordinate.

    Attributes:
        name: The degree of freedom, or those of a coupling joined by ``+``.
        weights: ``c``, shape (nv,).
        linear: Whether it is a length [m] rather than an angle [rad].
        load: What gravity asks along it by a model, symbolic, [N m] or [N]; None for columns that do not want it.
        width: Of a column's smooth sign along it, symbolic; None for the column's own number.
    """

    name: str
    weights: Array
    linear: bool
    load: Any = None
    width: Any = None


@dataclass(frozen=True)
class Coupling:
    """A motor or gear that acts on several joints: its coordinate is the weighted sum of theirs.

    The sum counts as a length when all its joints are linear, else as an angle (a ball screw's weight is in rad/m). Its
    name holds the signs of the weights, such as ``joint_5+joint_6``.

    Attributes:
        joints: Names of degrees of freedom.
        weights: One for each.
        kinds: Of friction that it has; None for all that joints have.
    """

    joints: tuple[str, ...]
    weights: tuple[float, ...]
    kinds: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if len(self.joints) < 2 or len(set(self.joints)) != len(self.joints) or len(self.joints) != len(self.weights):
            raise ParameterError(
                "coupling: needs two or more different joints and one weight for each; "
                f"got joints {self.joints} and weights {self.weights}"
            )

    @property
    def name(self) -> str:
        """The joints with the signs of their weights between them."""
        signs = ["" if k == 0 and w >= 0.0 else "+" if w >= 0.0 else "-" for k, w in enumerate(self.weights)]
        return "".join(sign + joint for sign, joint in zip(signs, self.joints, strict=True))


class FrictionColumn(ABC):
    """One column of the regressor for every direction.

    Attributes:
        kind: Its name in ``<joint>.<kind>``.
        non_negative: Whether its parameter cannot be negative.
    """

    kind: ClassVar[str]
    non_negative: ClassVar[bool] = False

    @abstractmethod
    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""

    @abstractmethod
    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """Torque along the direction for a parameter of one, a CasADi expression; None for no column there.

        Args:
            direction: Where it acts.
            position: Symbolic coordinate; not to be used where the direction has none (spherical and planar joints).
            velocity: Its rate.
            acceleration: Its second derivative.
        """

    def prior(self, robot: Robot, dof: int) -> float:
        """What the model file says of the parameter at a degree of freedom."""
        return 0.0


@dataclass(frozen=True)
class Viscous(FrictionColumn):
    """Torque proportional to velocity."""

    kind: ClassVar[str] = "viscous"
    non_negative: ClassVar[bool] = True

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return "N s/m" if direction.linear else "N m s/rad"

    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """``ds/dt``."""
        return velocity

    def prior(self, robot: Robot, dof: int) -> float:
        """The file's damping."""
        return float(robot.damping[dof])


@dataclass(frozen=True)
class SmoothSign(FrictionColumn):
    """A column that changes with the sign of velocity, made smooth: ``tanh(velocity / width)``.

    A column of one's own takes its width from :meth:`width_along`, which may be a symbol, never from ``width`` itself.

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

    def sign(self, direction: Direction, velocity: Any) -> Any:
        """``tanh(ds/dt / width)``."""
        return ca.tanh(velocity / self.width_along(direction))

    def width_along(self, direction: Direction) -> Any:
        """The width as it enters the torque: the direction's symbol, else :meth:`width_at`."""
        return self.width_at(direction) if direction.width is None else direction.width

    def width_at(self, direction: Direction) -> float:
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
            return float(self.width[direction.name])
        widths, c = np.asarray(self.width, dtype=np.float64), np.abs(direction.weights)
        if widths.ndim == 0:
            return float(widths)
        if widths.shape != c.shape:
            raise ParameterError(
                f"{self.kind} friction: width must be one number or one for each of the {c.size} degrees of freedom; "
                f"got {widths.size}"
            )
        return float(c @ widths)


@dataclass(frozen=True)
class Coulomb(SmoothSign):
    """Dry friction: a torque against motion that does not depend on speed."""

    kind: ClassVar[str] = "coulomb"
    non_negative: ClassVar[bool] = True

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return force_unit(direction)

    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """``tanh(ds/dt / width)``."""
        return self.sign(direction, velocity)

    def prior(self, robot: Robot, dof: int) -> float:
        """The file's dry friction."""
        return float(robot.dry_friction[dof])


@dataclass(frozen=True)
class Offset(FrictionColumn):
    """Constant torque: a sensor's zero, a motor current's offset."""

    kind: ClassVar[str] = "offset"

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return force_unit(direction)

    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """One."""
        return ca.SX(1)


@dataclass(frozen=True)
class Armature(FrictionColumn):
    """Inertia of rotor and gear, seen at the joint."""

    kind: ClassVar[str] = "armature"
    non_negative: ClassVar[bool] = True

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return "kg" if direction.linear else "kg m^2"

    def torque(self, direction: Direction, position: Any, velocity: Any, acceleration: Any) -> Any:
        """``d²s/dt²``."""
        return acceleration

    def prior(self, robot: Robot, dof: int) -> float:
        """The file's armature."""
        return float(robot.armature[dof])


def with_width(friction: Sequence[FrictionColumn], width: float | Sequence[float]) -> tuple[FrictionColumn, ...]:
    """The columns with another width of their smooth sign, where they have one."""
    return tuple(
        dataclasses.replace(column, width=width) if isinstance(column, SmoothSign) else column for column in friction
    )


DEFAULT_FRICTION: tuple[FrictionColumn, ...] = (Viscous(), Coulomb(), Offset(), Armature())


def joint_directions(robot: Robot) -> dict[int, Direction]:
    """The direction of every driven degree of freedom, by its index; a free-flyer has no drive and no friction."""
    identity, directions = np.eye(robot.nv), {}
    for joint in robot.joints:
        if joint.kind is JointKind.FREE_FLYER:
            continue
        for k, dof in enumerate(range(joint.v.start, joint.v.stop)):
            linear = joint.kind is JointKind.PRISMATIC or (joint.kind is JointKind.PLANAR and k < 2)
            directions[dof] = Direction(robot.dofs[dof], frozen(identity[dof]), linear)
    return directions


def coupling_direction(robot: Robot, coupling: Coupling) -> Direction:
    """The direction of a coupling.

    Raises:
        ParameterError: When a joint is unknown or is a free-flyer.
    """
    driven = {direction.name: direction for direction in joint_directions(robot).values()}
    unknown = [name for name in coupling.joints if name not in driven]
    if unknown:
        raise ParameterError(
            f"coupling: no degree of freedom named {', '.join(unknown)}; known are {', '.join(driven)}"
        )
    weights = sum(w * driven[name].weights for name, w in zip(coupling.joints, coupling.weights, strict=True))
    return Direction(coupling.name, frozen(weights), all(driven[name].linear for name in coupling.joints))


def force_unit(direction: Direction) -> str:
    """Unit of a torque along a direction."""
    return "N" if direction.linear else "N m"

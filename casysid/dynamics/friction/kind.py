"""What a kind of friction is: its columns in the regressor, and all that the rest of the product asks about it.

A kind of one's own is a subclass of :class:`FrictionColumn`, or of :class:`FrictionKind` when it has several
parameters a joint; a frozen dataclass gets merging and JSON without writing them.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from casysid.arrays import Array
from casysid.dynamics.friction.direction import Direction
from casysid.dynamics.friction.history import History
from casysid.errors import ParameterError
from casysid.robot import Robot


@dataclass(frozen=True, eq=False)
class DriveState:
    """A drive's motion along its transmission coordinate, CasADi expressions.

    Attributes:
        position: ``s``; not to be used where the direction has none (spherical and planar joints).
        velocity: ``ds/dt``.
        acceleration: ``d²s/dt²``.
        numbers: What stands for the kind's :meth:`FrictionKind.numbers` there.
        histories: What stands for its :meth:`FrictionKind.histories`.
        robot: Configuration (nq,), velocities (nv,) and accelerations (nv,) of the whole robot.
        static_torque: Gives what gravity asks along the coordinate of links with some parameters, (10 links,); None for
            the robot's own.
    """

    position: Any
    velocity: Any
    acceleration: Any
    numbers: tuple[Any, ...] = ()
    histories: tuple[Any, ...] = ()
    robot: tuple[Any, ...] = ()
    static_torque: Callable[[Array | None], Any] = lambda parameters: 0.0


@dataclass(frozen=True, eq=False)
class JointUse:
    """How a joint moved in the recordings, from which a kind takes the variants that are worth a try.

    Attributes:
        direction: Of the joint.
        speed: Its root mean square velocity [rad/s or m/s].
        width: Within which its smooth signs turn [rad/s or m/s].
        travel: Standard deviation of its position [rad or m]; None where it is not known.
        ripple: Wave numbers that its residual torque shows over its position [rad/rad or rad/m].
        friction_ripple: And that it shows when it is taken against the motion.
    """

    direction: Direction
    speed: float
    width: float
    travel: float | None = None
    ripple: tuple[float, ...] = ()
    friction_ripple: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Term:
    """One column of a kind along one direction.

    Attributes:
        name: Of its parameter, ``<direction>.<name>``; unlike that of every other term there.
        unit: Of its parameter.
        torque: Along the direction for a parameter of one, a CasADi expression or a number.
        non_negative: Whether its parameter cannot be negative.
    """

    name: str
    unit: str
    torque: Any
    non_negative: bool = False


@dataclass(frozen=True)
class Law:
    """``Σ coefficient · parameter ≥ 0``.

    Attributes:
        coefficients: By name of the parameter.
        name: By which people hear of it.
    """

    coefficients: Mapping[str, float]
    name: str


class FrictionKind(ABC):
    """Columns that a drive adds to the regressor, and what follows from their being of this kind.

    Attributes:
        kind: Its name, unlike that of every other kind.
        is_friction: Whether it takes energy out of the motion, so that a robot file's viscous and Coulomb friction has
            to stand for it; false of what stores energy, or shifts torque.
        is_physical: Whether its torque comes from a mechanism of its own, for other motions as for those fitted; false
            of columns that only describe.
        by_design: Whether it follows from how a drive is built, so that a robot's other drives probably have it too.
    """

    kind: ClassVar[str]
    is_friction: ClassVar[bool] = True
    is_physical: ClassVar[bool] = True
    by_design: ClassVar[bool] = False

    @abstractmethod
    def terms(self, direction: Direction, state: DriveState) -> Sequence[Term]:
        """Its columns along a direction; none where it does not act."""

    def prior(self, robot: Robot, dof: int) -> float:
        """What the model file says of its parameters at a degree of freedom."""
        return 0.0

    def numbers(self, direction: Direction) -> tuple[float, ...]:
        """What enters the torque along a direction nonlinearly and is left open in compiled code."""
        return ()

    def with_open_numbers(self) -> Self:
        """The same for all kinds that differ in :meth:`numbers` alone, which are then numbers for every direction."""
        return self

    def with_width(self, width: float | Sequence[float] | Mapping[str, float]) -> Self:
        """With another width of its smooth sign; itself when it has none."""
        return self

    def histories(self, direction: Direction) -> tuple[History, ...]:
        """What its torque along a direction needs of the motion before, in the order of ``state.histories``."""
        return ()

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[FrictionKind]:
        """Variants that are worth a try at a joint that moves, each for this joint alone."""
        return iter(())

    def laws(self, own: Sequence[str], beside: Mapping[str, str]) -> tuple[Law, ...]:
        """What its parameters along one direction obey beside the signs of :attr:`Term.non_negative`.

        Args:
            own: Names of its parameters, in the order of its terms.
            beside: Names of all parameters of ordinary terms along the direction, by name of the term.
        """
        return ()

    def describe(self, direction: Direction) -> str:
        """What a person calls it along a direction, with the numbers that enter nonlinearly."""
        return self.kind

    def merged_with(self, other: Self) -> Self:
        """One that acts wherever either does: names of joints and values by name are put together.

        Raises:
            ParameterError: They differ otherwise.
        """
        if type(self) is type(other):
            merged = {name: _merged(mine, getattr(other, name)) for name, mine in _fields(self).items()}
            if not any(value is _CLASH for value in merged.values()):
                return dataclasses.replace(self, **merged)  # type: ignore[type-var]
        raise ParameterError(f"friction: {self} and {other} cannot act as one '{self.kind}'")

    def to_json(self, robot: Robot) -> dict[str, Any]:
        """What it is made of, as plain numbers, lists and words."""
        return {name: _plain(value) for name, value in _fields(self).items()}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Self:
        """The kind of :meth:`to_json`."""
        return cls(**{name: _hashable(value) for name, value in content.items()})


class FrictionColumn(FrictionKind):
    """A kind with one parameter for every direction, by the name of the kind.

    Attributes:
        non_negative: Whether its parameter cannot be negative.
    """

    non_negative: ClassVar[bool] = False

    @abstractmethod
    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""

    @abstractmethod
    def torque(self, direction: Direction, state: DriveState) -> Any:
        """Torque along the direction for a parameter of one, a CasADi expression; None where it does not act."""

    def terms(self, direction: Direction, state: DriveState) -> tuple[Term, ...]:
        """The column, where it acts."""
        torque = self.torque(direction, state)
        return () if torque is None else (Term(self.kind, self.unit(direction), torque, self.non_negative),)


def value_at(values: float | Mapping[str, float], direction: Direction) -> float | None:
    """The value for a direction: the one for all, or the one under its name; None where the name is missing."""
    return values.get(direction.name) if isinstance(values, Mapping) else values


def acts_along(joints: Sequence[str] | None, direction: Direction) -> bool:
    """Whether a direction is one of those named; all are when none is."""
    return joints is None or direction.name in joints


def require_positive(kind: str, word: str, values: float | Mapping[str, float]) -> None:
    """Refuse values of a kind that are not positive and finite.

    Raises:
        ParameterError: One is not.
    """
    numbers = list(values.values()) if isinstance(values, Mapping) else [values]
    if not all(math.isfinite(number) and number > 0.0 for number in numbers):
        raise ParameterError(f"{kind} friction: {word} must be positive and finite; got {values}")


_CLASH = object()


def _fields(kind: object) -> dict[str, Any]:
    """Of a dataclass; none of anything else."""
    if not dataclasses.is_dataclass(kind):
        return {}
    return {field.name: getattr(kind, field.name) for field in dataclasses.fields(kind)}


def _merged(mine: Any, other: Any) -> Any:
    """Names and mappings put together; anything else as it is if both agree."""
    if mine == other:
        return mine
    if isinstance(mine, Mapping) and isinstance(other, Mapping):
        agree = all(mine[name] == other[name] for name in mine.keys() & other.keys())
        return {**mine, **other} if agree else _CLASH
    if isinstance(mine, tuple) and isinstance(other, tuple) and all(isinstance(one, str) for one in (*mine, *other)):
        return tuple(dict.fromkeys((*mine, *other)))
    return _CLASH


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(one) for name, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def _hashable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _hashable(one) for name, one in value.items()}
    return tuple(_hashable(one) for one in value) if isinstance(value, list) else value

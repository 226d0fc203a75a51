"""Joints of a URDF: kinematics must be right to the letter, limits may be missing."""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import CasysidWarning, RobotError
from casysid.robot.checks import negative_friction
from casysid.robot.limits import LARGEST
from casysid.robot.urdf_links import read_number, read_vector
from casysid.robot.xmltext import Element

_ONE_DOF = ("revolute", "continuous", "prismatic")
_SHORTEST_AXIS = 1e-9  # a unit vector's rounding is 1e-16
_KINDS = (*_ONE_DOF, "fixed", "floating", "planar")


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """One ``<joint>``, its numbers finite; limits are infinite where the file gives none.

    Attributes:
        name: Its name.
        element: Where it stands.
        kind: The ``type`` attribute.
        parent: Link before it.
        child: Link that it carries.
        xyz: Place in the parent link's frame, shape (3,), [m].
        rpy: Orientation, shape (3,), [rad].
        axis: Unit axis, shape (3,).
        lower: Lower position limit.
        upper: Upper position limit.
        velocity: Velocity limit.
        effort: Torque or force limit.
        damping: Viscous friction.
        friction: Coulomb friction.
        mimics: Joint that it follows, if any.
        doubts: What had to be guessed.
    """

    name: str
    element: Element
    kind: str
    parent: str
    child: str
    xyz: Array
    rpy: Array
    axis: Array
    lower: float
    upper: float
    velocity: float
    effort: float
    damping: float
    friction: float
    mimics: str | None
    doubts: tuple[str, ...]


def read_joints(root: Element, path: Path) -> dict[str, UrdfJoint]:
    """All joints by name.

    Raises:
        RobotError: A joint cannot be understood.
    """
    joints: dict[str, UrdfJoint] = {}
    for element in root.find_all("joint"):
        if not element.name:
            raise RobotError(f"{path}:{element.line}: <joint> without a name")
        if element.name in joints:
            first = joints[element.name].element.line
            raise RobotError(f"{path}:{element.line}: joint '{element.name}' is defined twice (first in line {first})")
        joints[element.name] = _JointReader(element, path).read()
    return joints


def warn_of_doubts(path: Path, joints: Collection[UrdfJoint], *, stacklevel: int) -> None:
    """One :class:`CasysidWarning` that lists what was guessed about joints; silent when nothing was."""
    listing = "; ".join(f"joint '{joint.name}': {', '.join(joint.doubts)}" for joint in joints if joint.doubts)
    if listing:
        warnings.warn(f"{path}: {listing}", CasysidWarning, stacklevel=stacklevel + 1)


class _JointReader:
    """Reads one joint's element; its messages name file, line and joint."""

    def __init__(self, element: Element, path: Path) -> None:
        self._element = element
        self._where = f"{path}:{element.line}: joint '{element.name}'"
        self._doubts: list[str] = []

    def read(self) -> UrdfJoint:
        """The joint."""
        kind = self._kind()
        lower, upper, velocity, effort = self._limits(kind)
        damping, friction = self._number("dynamics", "damping", 0.0), self._number("dynamics", "friction", 0.0)
        if doubt := negative_friction(damping, friction):
            self._doubts.append(doubt)
        mimic = self._element.find("mimic")
        return UrdfJoint(
            name=self._element.name,
            element=self._element,
            kind=kind,
            parent=self._link("parent"),
            child=self._link("child"),
            xyz=self._vector("origin", "xyz", "0 0 0"),
            rpy=self._vector("origin", "rpy", "0 0 0"),
            axis=self._axis(kind),
            lower=lower,
            upper=upper,
            velocity=velocity,
            effort=effort,
            damping=damping,
            friction=friction,
            mimics=None if mimic is None else mimic.attributes.get("joint", "?"),
            doubts=tuple(self._doubts),
        )

    def _fail(self, message: str) -> RobotError:
        return RobotError(f"{self._where}: {message}")

    def _attributes(self, tag: str) -> dict[str, str]:
        child = self._element.find(tag)
        return {} if child is None else child.attributes

    def _kind(self) -> str:
        kind = self._element.attributes.get("type", "")
        if kind not in _KINDS:
            hint = "; ball joints are possible in MJCF" if kind in ("spherical", "ball") else ""
            raise self._fail(f'type="{kind}" is not one of {", ".join(_KINDS)}{hint}')
        return kind

    def _link(self, tag: str) -> str:
        link = self._attributes(tag).get("link", "")
        if not link:
            raise self._fail(f'needs <{tag} link="..."/>')
        return link

    def _vector(self, tag: str, key: str, default: str) -> Array:
        text = self._attributes(tag).get(key, default)
        try:
            return read_vector(text, 3)
        except ValueError:
            raise self._fail(f'<{tag} {key}="{text}"> is not three finite numbers below {LARGEST:g}') from None

    def _number(self, tag: str, key: str, default: float, largest: float = LARGEST) -> float:
        text = self._attributes(tag).get(key)
        if text is None:
            return default
        try:
            return read_number(text, largest)
        except ValueError:
            bound = f"finite number below {largest:g}" if math.isfinite(largest) else "finite number"
            raise self._fail(f'<{tag} {key}="{text}"> is not a {bound}') from None

    def _axis(self, kind: str) -> Array:
        axis = self._vector("axis", "xyz", "1 0 0")
        if kind == "planar" and not np.array_equal(axis, [0.0, 0.0, 1.0]):
            raise self._fail('a planar joint moves in the x-y plane here: wanted <axis xyz="0 0 1"/>; turn its origin')
        length = float(np.linalg.norm(axis))
        if kind in _ONE_DOF and length < _SHORTEST_AXIS:
            raise self._fail(f'<axis xyz="{axis[0]:g} {axis[1]:g} {axis[2]:g}"> has no direction')
        return frozen(axis / length) if length and abs(length - 1.0) > 1e-15 else axis

    def _limits(self, kind: str) -> tuple[float, float, float, float]:
        """Lower, upper, velocity, effort; what is absent or plain zero is taken as no limit."""
        if kind not in _ONE_DOF:
            return -math.inf, math.inf, math.inf, math.inf
        lower, upper, velocity, effort = (
            self._number("limit", key, 0.0, math.inf) for key in ("lower", "upper", "velocity", "effort")
        )
        if lower > upper:
            raise self._fail(f"lower limit {lower:g} exceeds upper limit {upper:g}")
        if min(velocity, effort) < 0.0:
            raise self._fail(f"velocity limit {velocity:g} and effort limit {effort:g} must not be negative")
        if kind == "continuous":
            lower, upper = -math.inf, math.inf
        elif lower == upper:
            self._doubts.append("no position limits, taken as unlimited")
            lower, upper = -math.inf, math.inf
        return lower, upper, velocity or math.inf, effort or math.inf

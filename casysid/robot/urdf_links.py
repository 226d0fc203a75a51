"""Links of a URDF: their ``<inertial>``, read with suspicion.

Pinocchio takes unreadable numbers as zero without an exception, so the text is read here and handed on clean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.errors import RobotError
from casysid.inertia import inertial_parameters
from casysid.robot.checks import FaultKind, InertiaFault, check_inertia
from casysid.robot.limits import LARGEST
from casysid.robot.xmltext import Element

_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True, eq=False)
class UrdfLink:
    """One ``<link>``.

    Attributes:
        name: Its name.
        element: Where it stands.
        has_inertial: Whether the file gives it an inertia that is not plain zero.
        mass: [kg], 0 where unreadable.
        com: Centre of mass in the link frame, shape (3,), [m].
        rpy: Orientation of the inertia's axes, shape (3,), [rad].
        inertia: About the centre of mass in those axes: ixx, ixy, ixz, iyy, iyz, izz [kg m²].
        faults: What is wrong with the numbers themselves.
    """

    name: str
    element: Element
    has_inertial: bool
    mass: float
    com: Array
    rpy: Array
    inertia: Array
    faults: tuple[InertiaFault, ...]

    def parameters(self) -> Array:
        """The ten inertial parameters at the link frame, as far as they could be read."""
        R = pin.rpy.rpyToMatrix(*map(float, self.rpy))
        return inertial_parameters(self.mass, self.com, R @ full_inertia(self.inertia) @ R.T)


def read_number(text: str, largest: float = LARGEST) -> float:
    """A finite number, no larger than ``largest`` either way.

    Raises:
        ValueError: The text is no such thing.
    """
    number = float(text)
    if not abs(number) <= largest or math.isinf(number) or "_" in text:
        raise ValueError(text)
    return number


def read_vector(text: str, count: int) -> Array:
    """Finite numbers parted by blanks.

    Raises:
        ValueError: There are not ``count`` of them.
    """
    numbers = [read_number(part) for part in text.split()]
    if len(numbers) != count:
        raise ValueError(text)
    return frozen(numbers)


def read_links(root: Element, path: Path) -> dict[str, UrdfLink]:
    """All links by name.

    Raises:
        RobotError: A link has no name, or the same as another.
    """
    links: dict[str, UrdfLink] = {}
    for element in root.find_all("link"):
        if not element.name:
            raise RobotError(f"{path}:{element.line}: <link> without a name")
        if element.name in links:
            first = links[element.name].element.line
            raise RobotError(f"{path}:{element.line}: link '{element.name}' is defined twice (first in line {first})")
        links[element.name] = _read_link(element)
    return links


def _read_link(element: Element) -> UrdfLink:
    inertial = element.find("inertial")
    mass, com, rpy, inertia = 0.0, np.zeros(3), np.zeros(3), np.zeros(6)
    unreadable: list[str] = []
    if inertial is not None:
        mass = _read_mass(inertial, unreadable)
        com, rpy = _read_origin(inertial, unreadable)
        inertia = _read_inertia(inertial, unreadable)
    faults = [InertiaFault(element.name, FaultKind.UNREADABLE, message) for message in unreadable]
    if not faults:
        faults = check_inertia(element.name, mass, full_inertia(inertia), strict=False)
    has_inertial = bool(faults or mass != 0.0 or inertia.any())
    if unreadable:  # an inertia means something only with all of its frame
        inertia = np.zeros(6)
    return UrdfLink(element.name, element, has_inertial, mass, frozen(com), frozen(rpy), frozen(inertia), tuple(faults))


def full_inertia(entries: Array) -> Array:
    """The matrix (3, 3) of ixx, ixy, ixz, iyy, iyz, izz."""
    ixx, ixy, ixz, iyy, iyz, izz = entries
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def _read_mass(inertial: Element, unreadable: list[str]) -> float:
    mass = inertial.find("mass")
    text = "" if mass is None else mass.attributes.get("value", "")
    try:
        return read_number(text)
    except ValueError:
        unreadable.append(
            f'mass value="{text}" is not a finite number below {LARGEST:g}' if text else "<inertial> has no mass value"
        )
        return 0.0


def _read_origin(inertial: Element, unreadable: list[str]) -> tuple[Array, Array]:
    origin = inertial.find("origin")
    attributes = {} if origin is None else origin.attributes
    vectors = {}
    for key in ("xyz", "rpy"):
        try:
            vectors[key] = read_vector(attributes.get(key, "0 0 0"), 3)
        except ValueError:
            unreadable.append(
                f'inertial origin {key}="{attributes[key]}" is not three finite numbers below {LARGEST:g}'
            )
            vectors[key] = frozen(np.zeros(3))
    return vectors["xyz"], vectors["rpy"]


def _read_inertia(inertial: Element, unreadable: list[str]) -> Array:
    inertia = inertial.find("inertia")
    attributes = {} if inertia is None else inertia.attributes
    entries = np.zeros(6)
    for k, key in enumerate(_ENTRIES):
        text = attributes.get(key, "")
        try:
            entries[k] = read_number(text)
        except ValueError:
            unreadable.append(
                f'{key}="{text}" is not a finite number below {LARGEST:g}' if text else f"{key} is missing"
            )
    return entries

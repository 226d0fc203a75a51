"""What takes the place of inertial parameters that no body has: the same in other units, or a body of usual shape.

A usual body is what the parts of published robots are on the median, and how far they scatter about it says how a
number that was written in other units than SI is told: by the reading that makes the body most usual, where every unit
that has to be changed needs a reason. What was copied from link to link, and what becomes usual in no units, gives way
to a usual body: of the link's own mass and centre of mass where these can be, and else as dense as the robot's other
links, halfway to the next joints.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.inertia import inertial_parameters, mass_properties
from casysid.inertia.reference import NOTHING_KNOWN
from casysid.robot.model import Robot
from casysid.robot.plausibility import ALIKE, Implausibility, InertiaDoubt, bodies_of, doubtful_inertias

USUAL_FILLING, FILLING_SPREAD = 83.0, 0.57
"""Mass over the cube of a link's length [kg/m³], and the standard deviation of its decimal logarithm: 834 links of 64
published models (the ``example-robot-data`` of 2026 and ten arms with logs), placeholders left out."""
USUAL_GYRATION, GYRATION_SPREAD = 0.31, 0.25
"""Radius of gyration over a link's length, likewise."""
USUAL_DENSITY, DENSITY_SPREAD = 310.0, 0.9
"""Of a ball of the same radius of gyration [kg/m³], which follows from both: for links whose length is not known."""
CHANGE = 3.0
"""What another unit costs in squares of standard deviations: one number in twenty or so is written in it."""
MOST_UNUSUAL = 18.0
"""Squares of standard deviations, both together: three each. A reading beyond is none."""
MASS_UNITS = {"kg": 1.0, "g": 1e-3}
LENGTH_UNITS = {"m": 1.0, "mm": 1e-3}
INERTIA_UNITS = {"kg m²": 1.0, "g m²": 1e-3, "kg cm²": 1e-4, "kg mm²": 1e-6, "g cm²": 1e-7, "g mm²": 1e-9}
"""Units in which vendors' and CAD programs' files have been met."""
WORTH_TELLING = 6
"""Links in one sentence; more are counted."""
HALF_AS_THICK = 0.5
"""Of a usual body's width to its length."""


@dataclass(frozen=True)
class Replacement:
    """What takes the place of one link's parameters.

    Attributes:
        doubt: Why.
        words: What does, as a sentence part.
    """

    doubt: InertiaDoubt
    words: str


@dataclass(frozen=True, eq=False)
class Witness:
    """A robot's file as evidence: without what no body can be.

    Attributes:
        robot: With replaced parameters; the same robot where nothing was replaced.
        replacements: By link, in the robot's order.
    """

    robot: Robot
    replacements: tuple[Replacement, ...]

    @property
    def sentence(self) -> str:
        """All in one sentence, empty when nothing was replaced."""
        if not self.replacements:
            return ""
        count = len(self.replacements)
        shown = [
            f"link '{one.doubt.link}': {one.doubt.message}, {one.words}" for one in self.replacements[:WORTH_TELLING]
        ]
        more = f"; and {count - len(shown)} more, see casysid info" if count > len(shown) else ""
        return (
            f"{self.robot.source}: the inertial parameters of {count} link{'s' * (count > 1)} are those of no body of "
            f"that size, and are not leaned on ({'; '.join(shown)}{more})"
        )


@dataclass(frozen=True)
class _Units:
    """In which one link's numbers are read."""

    mass: str
    center: str
    inertia: str

    @property
    def changes(self) -> int:
        return (self.mass != "kg") + (self.center != "m") + (self.inertia != "kg m²")

    def read(self, body: Array) -> Array:
        """Ten parameters in SI units."""
        numbers = mass_properties(body)
        return inertial_parameters(
            numbers.mass * MASS_UNITS[self.mass],
            numbers.center_of_mass * LENGTH_UNITS[self.center],
            numbers.inertia * INERTIA_UNITS[self.inertia],
        )

    def words(self) -> str:
        """Naming what is not as usual."""
        named = {"mass": self.mass, "centre of mass": self.center, "inertia": self.inertia}
        changed = [f"{what} in {unit}" for what, unit in named.items() if unit not in ("kg", "m", "kg m²")]
        return f"taken for {', '.join(changed)}"


def believed(robot: Robot, kept: Collection[str] = ()) -> Witness:
    """The robot without the inertial parameters that no body has.

    Args:
        robot: As its file has it.
        kept: Links that stay as they are, whatever they look like.
    """
    doubts = {doubt.link: doubt for doubt in doubtful_inertias(robot) if doubt.link not in kept}
    if not doubts:
        return Witness(robot, ())
    bodies, lengths = robot.inertial_parameters.reshape(-1, 10).copy(), bodies_of(robot).length
    units = _units_of_all(robot, bodies, lengths, doubts)
    words = {}
    for k, unit in units.items():
        bodies[k], words[robot.links[k]] = unit.read(bodies[k]), unit.words()
    open_still = [k for k, link in enumerate(robot.links) if link in doubts and k not in units]
    filling = _filling(bodies, lengths, open_still)
    usual = {k: _usual_body(robot, k, lengths[k], filling, doubts.values()) for k in open_still}
    for k, (body, what) in usual.items():
        bodies[k], words[robot.links[k]] = body, what
    like_most = {link: InertiaDoubt(link, (), "like most links") for link in words}
    replacements = tuple(Replacement((like_most | doubts)[link], words[link]) for link in robot.links if link in words)
    return Witness(robot.with_parameters(inertial_parameters=bodies.ravel()), replacements)


def _units_of_all(robot: Robot, bodies: Array, lengths: Array, doubts: Mapping[str, InertiaDoubt]) -> dict[int, _Units]:
    """Other units by link: the same for all links where most are in doubt, and links' own otherwise."""
    odd = [
        k for k, link in enumerate(robot.links) if link in doubts and Implausibility.COPIED not in doubts[link].kinds
    ]
    if 2 * len(odd) > len(bodies) > 1:
        cost = {unit: [_unusual(unit, bodies[k], lengths[k]) for k in range(len(bodies))] for unit in _all_units()}
        best = min(cost, key=lambda unit: sum(cost[unit]) + CHANGE * unit.changes)
        if max(cost[best]) < MOST_UNUSUAL:
            return {k: best for k in range(len(bodies))} if best.changes else {}
    found = {}
    for k in odd:
        best = min(_all_units(), key=lambda unit: _unusual(unit, bodies[k], lengths[k]) + CHANGE * unit.changes)
        if best.changes and _unusual(best, bodies[k], lengths[k]) < MOST_UNUSUAL:
            found[k] = best
    return found


def _all_units() -> Iterator[_Units]:
    return itertools.starmap(_Units, itertools.product(MASS_UNITS, LENGTH_UNITS, INERTIA_UNITS))


def _unusual(units: _Units, body: Array, length: float) -> float:
    """How unusual a reading is, in squares of standard deviations; inf where it is no body."""
    numbers = mass_properties(units.read(body))
    mass, square = float(numbers.mass), 0.5 * float(np.trace(numbers.inertia))
    if not (mass > 0.0 and square > 0.0):
        return math.inf
    radius = math.sqrt(square / mass)
    if length == 0.0:
        ball = 4.0 / 3.0 * math.pi * (5.0 / 3.0) ** 1.5 * radius**3
        return (math.log10(mass / ball / USUAL_DENSITY) / DENSITY_SPREAD) ** 2
    filling = math.log10(mass / length**3 / USUAL_FILLING) / FILLING_SPREAD
    gyration = math.log10(radius / length / USUAL_GYRATION) / GYRATION_SPREAD
    away = math.log10(max(float(np.linalg.norm(numbers.center_of_mass)) / length, 1.0)) / GYRATION_SPREAD
    return filling**2 + gyration**2 + away**2


def _filling(bodies: Array, lengths: Array, left_out: Collection[int]) -> float:
    """Mass over the cube of the length, of the median link that is not left out [kg/m³]."""
    ratios = [
        body[0] / length**3
        for k, (body, length) in enumerate(zip(bodies, lengths, strict=True))
        if k not in left_out and body[0] > 0.0 and length > 0.0
    ]
    return float(np.median(ratios)) if ratios else USUAL_FILLING


def _usual_body(
    robot: Robot, k: int, length: float, filling: float, doubts: Collection[InertiaDoubt]
) -> tuple[Array, str]:
    """Ten parameters of a usual body of the link's length, and what was kept and what was not in words."""
    numbers = mass_properties(robot.inertial_parameters.reshape(-1, 10)[k])
    mass, center, onward = float(numbers.mass), numbers.center_of_mass, _onward(robot, k)
    own = mass > 0.0 and not _is_copied(robot, k, doubts)
    if own and length > 0.0:
        own = (math.log10(mass / length**3 / USUAL_FILLING) / FILLING_SPREAD) ** 2 < MOST_UNUSUAL / 2.0
    if not own:
        mass = filling * length**3 if length > 0.0 else NOTHING_KNOWN[0]
    size = length if length > 0.0 else (mass / USUAL_FILLING) ** (1.0 / 3.0)
    centred = own and bool(0.0 < np.linalg.norm(center) <= 2.0 * size)
    along = np.linalg.norm(onward)
    share = np.eye(3) / 3.0 if along == 0.0 else _shares(onward / along)
    second = mass * (USUAL_GYRATION * size) ** 2 * share
    body = inertial_parameters(mass, center if centred else 0.5 * onward, np.trace(second) * np.eye(3) - second)
    kept = "with its mass" * own + " and centre of mass" * centred
    return body, f"replaced by a usual body {size:.2g} m long {kept or f'of {mass:.2g} kg'}"


def _shares(along: Array) -> Array:
    """Of the second moment in each direction, a matrix of trace one: a bar's along a unit vector."""
    across = HALF_AS_THICK**2
    return np.asarray((across * np.eye(3) + (1.0 - across) * np.outer(along, along)) / (1.0 + 2.0 * across))


def _is_copied(robot: Robot, k: int, doubts: Collection[InertiaDoubt]) -> bool:
    """Whether another link whose inertia was copied has this one's mass as well."""
    others = {doubt.link for doubt in doubts if Implausibility.COPIED in doubt.kinds}
    masses = robot.inertial_parameters[::10]
    return robot.links[k] in others and any(
        i != k and link in others and abs(masses[i] - masses[k]) <= ALIKE * abs(masses[k])
        for i, link in enumerate(robot.links)
    )


def _onward(robot: Robot, k: int) -> Array:
    """Mean place of the next joints in the link's frame, shape (3,); zeros where there are none."""
    own = [i for i, joint in enumerate(robot.joints) if joint.link is not None][k]
    places = [joint.placement.translation for joint in robot.joints if joint.parent == own]
    return np.mean(places, axis=0) if places else np.zeros(3)

"""Which links' inertial parameters in a model file are those of no body of that size: placeholders and wrong units.

A file may be wrong as files are, by a half or a factor of two; nothing is said of that. Named is what no part of the
robot can be: wider than its link, lighter than a gas or denser than any metal, its centre of mass far off, and numbers
that were copied from link to link. How long a link is follows from the places of the joints alone.

A body of mass m and second moments ``Σ`` about its centre of mass is, at given volume, most compact as the uniform
ellipsoid of these moments, and at given ``tr Σ`` as the uniform ball. So ``m`` over the ball's volume is at most the
body's greatest density, and over the ellipsoid's the density of whatever fills it.
"""

from __future__ import annotations

import enum
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.inertia import mass_properties
from casysid.inertia.reference import NEGLIGIBLE
from casysid.robot.model import Robot

HYDROGEN, OSMIUM = 0.09, 22_590.0
"""Density of the lightest gas and of the densest metal under usual conditions [kg/m³]."""
POOR = 10.0
"""Inertias too small by this factor are a poor file's and no more; density goes with its power of 3/2."""
IRON, HEAVY_ROBOT = 7_870.0, 500.0
"""Density [kg/m³] and mass [kg]: robots of more than half a ton are large, and their links, as balls, mostly hollow.
Where most are denser than iron, all that are above a thirtieth of it are in doubt."""
WIDEST = 2.0
"""Radius of gyration over the link's length: a rod of it would be seven links long."""
FARTHEST = 5.0
"""Distance of the centre of mass from the joint over the link's length, or its radius of gyration if that is more."""
HEAVIEST, SOLID = 10.0, 20_000.0
"""Mass over that of all other links together, of what besides is so dense [kg/m³] even as a ball: no mobile base is."""
GRAMS = 1e3
"""In a kilogram: equal parts of which one's mass is in grams are equal parts."""
ALIKE, APART = 1e-6, 1.5
"""Relative difference of numbers that were copied, and ratio of lengths of links that are not the same part."""

Mask = npt.NDArray[np.bool_]


class Implausibility(enum.Enum):
    """What is wrong; the value is the phrase a user reads."""

    WIDE = "wider than the link can be"
    LIGHT = "lighter than any gas"
    DENSE = "denser than any metal"
    HEAVY = "heavier than the rest of the robot allows"
    FAR = "centre of mass far from the link"
    COPIED = "the same inertia as other links of another mass or length"


@dataclass(frozen=True)
class InertiaDoubt:
    """A link whose inertial parameters are those of no body of its size.

    Attributes:
        link: Its name.
        kinds: What is wrong.
        message: The same with its numbers, as a sentence part.
    """

    link: str
    kinds: tuple[Implausibility, ...]
    message: str


@dataclass(frozen=True, eq=False)
class Bodies:
    """What is looked at, by link.

    Attributes:
        mass: Shape (n,), [kg].
        center: Centre of mass in the joint's frame, shape (n, 3), [m].
        spread: Eigenvalues of ``Σ / m`` about it, shape (n, 3), ascending, [m²]; zeros where the mass is none.
        moments: Principal moments of inertia about it, shape (n, 3), ascending, [kg m²].
        length: Of the link, shape (n,), [m]; zeros where no joint's place tells one.
        onward: Distance to its farthest next joint, shape (n,), [m].
    """

    mass: Array
    center: Array
    spread: Array
    moments: Array
    length: Array
    onward: Array

    @property
    def gyration(self) -> Array:
        """Radius of gyration, ``√(tr Σ / m)``, shape (n,), [m]."""
        return np.asarray(np.sqrt(self.spread.sum(axis=1)))

    @property
    def density(self) -> Array:
        """As if each were a ball of its radius of gyration, shape (n,), [kg/m³]; inf where that is none."""
        return _over(self.mass, 4.0 / 3.0 * np.pi * (5.0 / 3.0 * self.spread.sum(axis=1)) ** 1.5)

    @property
    def lightness(self) -> Array:
        """Density as the ellipsoid of its second moments, shape (n,), [kg/m³]; inf where it is flat."""
        return _over(self.mass, 4.0 / 3.0 * np.pi * 5.0**1.5 * np.sqrt(np.prod(self.spread, axis=1)))


def _over(mass: Array, volume: Array) -> Array:
    return np.asarray(np.divide(mass, volume, out=np.full_like(volume, np.inf), where=volume > 0.0))


def bodies_of(robot: Robot, parameters: Array | None = None) -> Bodies:
    """What is to be looked at.

    Args:
        robot: Its joints give the lengths.
        parameters: Shape (10 links,); the robot's when None.
    """
    own = (robot.inertial_parameters if parameters is None else parameters).reshape(-1, 10)
    body = mass_properties(own)
    inertia = 0.5 * (body.inertia + body.inertia.transpose(0, 2, 1))
    moments = frozen(np.linalg.eigvalsh(inertia))
    heavy = body.mass > NEGLIGIBLE[0]
    spread = np.where(heavy[:, None], 0.5 * moments.sum(axis=1)[:, None] - moments[:, ::-1], 0.0)
    spread = np.maximum(spread / np.where(heavy, body.mass, 1.0)[:, None], 0.0)
    before, onward = _distances(robot)
    usual = np.median(before[before > NEGLIGIBLE[1]]) if (before > NEGLIGIBLE[1]).any() else 0.0
    length = np.maximum(np.maximum(before, onward), usual)
    return Bodies(body.mass, body.center_of_mass, frozen(spread), moments, frozen(length), frozen(onward))


def _distances(robot: Robot) -> tuple[Array, Array]:
    """From each link's joint back to the one before, and on to the farthest next one, shape (links,) each, [m].

    Joints on the base are measured from their midst: where a robot stands says nothing of its size.
    """
    place = {k: i for i, k in enumerate(k for k, joint in enumerate(robot.joints) if joint.link is not None)}
    roots = [joint.placement.translation for joint in robot.joints if joint.parent < 0]
    before, onward = np.zeros(len(place)), np.zeros(len(place))
    for k, i in place.items():
        parent = k
        while parent >= 0 and (parent == k or parent not in place):
            joint = robot.joints[parent]
            shift = joint.placement.translation - (np.mean(roots, axis=0) if joint.parent < 0 else 0.0)
            before[i] += float(np.linalg.norm(shift))
            parent = joint.parent
        if parent >= 0:
            onward[place[parent]] = max(onward[place[parent]], before[i])
    return before, onward


def doubtful_inertias(robot: Robot) -> tuple[InertiaDoubt, ...]:
    """The links whose inertial parameters are those of no body of that size, in the robot's order."""
    bodies = bodies_of(robot)
    masks = {**misfits(bodies), Implausibility.COPIED: copied(bodies)}
    doubts = []
    for k, link in enumerate(robot.links):
        kinds = tuple(kind for kind, mask in masks.items() if mask[k])
        if kinds:
            doubts.append(InertiaDoubt(link, kinds, "; ".join(_words(kind, bodies, k) for kind in kinds)))
    return tuple(doubts)


def misfits(bodies: Bodies) -> dict[Implausibility, Mask]:
    """What no body can be, by itself and beside the other links: masks of shape (n,)."""
    there = (bodies.mass > NEGLIGIBLE[0]) & (bodies.gyration > NEGLIGIBLE[1])
    known, reach = bodies.length > 0.0, np.maximum(bodies.length, bodies.gyration)
    away = np.linalg.norm(bodies.center, axis=1)
    others = np.maximum(bodies.mass, 0.0).sum() - bodies.mass
    dense = there & (bodies.density > POOR**1.5 * OSMIUM)
    if bodies.mass[there].sum() > HEAVY_ROBOT and 2 * (bodies.density[there] > IRON).sum() > there.sum():
        dense = there & (bodies.density > IRON / 30.0)
    return {
        Implausibility.WIDE: there & known & (bodies.gyration > WIDEST * bodies.length),
        Implausibility.LIGHT: there & (bodies.lightness < HYDROGEN),
        Implausibility.DENSE: dense,
        Implausibility.HEAVY: there & (others > 0.0) & (bodies.mass > HEAVIEST * others) & (bodies.density > SOLID),
        Implausibility.FAR: there & known & (away > FARTHEST * reach),
    }


def copied(bodies: Bodies) -> Mask:
    """Links that have the principal moments of others, though they are not the same part, shape (n,)."""
    groups: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for k, moments in enumerate(bodies.moments):
        if bodies.mass[k] > NEGLIGIBLE[0] and bodies.gyration[k] > NEGLIGIBLE[1]:
            groups[tuple(f"{moment:.5e}" for moment in moments)].append(k)
    found = np.zeros(len(bodies.mass), dtype=bool)
    for group in groups.values():
        if len(group) > 1 and _differ(bodies, np.array(group)):
            found[group] = True
    return found


def _differ(bodies: Bodies, group: npt.NDArray[np.intp]) -> bool:
    """Whether links of one inertia cannot be one part: by mass, by length, or as balls that turn about their centre."""
    ratio, onward = bodies.mass[group] / bodies.mass[group].min(), bodies.onward[group]
    in_grams = np.abs(ratio / GRAMS - 1.0) < ALIKE
    if (np.abs(ratio - 1.0)[~in_grams] > ALIKE).any():
        return True
    round_ones = bool((np.ptp(bodies.moments[group], axis=1) <= ALIKE * bodies.moments[group, 2]).all())
    if not (round_ones or len(group) == len(bodies.mass)):
        return False
    known = onward[onward > NEGLIGIBLE[1]]
    centred = bool((np.linalg.norm(bodies.center[group], axis=1) < NEGLIGIBLE[1]).all())
    return bool(len(known) and ((round_ones and centred) or known.max() > APART * known.min()))


def _words(kind: Implausibility, bodies: Bodies, k: int) -> str:
    radius, length, mass = f"{bodies.gyration[k]:.3g} m", f"{bodies.length[k]:.3g} m", f"{bodies.mass[k]:.4g} kg"
    match kind:
        case Implausibility.WIDE:
            return f"radius of gyration {radius} where the link is {length} long"
        case Implausibility.LIGHT:
            return f"{mass} spread over a radius of gyration of {radius}, lighter than any gas"
        case Implausibility.DENSE:
            return f"{mass} within a radius of gyration of {radius}, denser than any metal"
        case Implausibility.HEAVY:
            return f"{mass}, more than {HEAVIEST:g} times all other links together"
        case Implausibility.FAR:
            away = float(np.linalg.norm(bodies.center[k]))
            return f"centre of mass {away:.3g} m from the joint where the link is {length} long"
        case Implausibility.COPIED:
            moments = ", ".join(f"{moment:.4g}" for moment in bodies.moments[k])
            return f"principal moments of inertia {moments} kg m², exactly those of other links"

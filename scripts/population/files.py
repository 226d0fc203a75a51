"""Model files that are wrong.

Six in ten have every link's mass and inertia off by up to 10-50 % (one level an experiment, uniform) and the centre of
mass by as large a share of the body's size; two in ten are placeholders (mass 1 kg and inertia 1 kg m² about the origin
for all links, or 0.01 of both); two in ten are off by up to 10 % and have one link in wrong units (grams, or
millimetres). Half of the files know of friction and rotors, off by the same share, the others have none; placeholders
never do.
"""

from __future__ import annotations

import numpy as np

from casysid.inertia import inertial_parameters, mass_properties
from casysid.robot import Robot
from population.drawing import chance, pick
from population.drives import Truth

KINDS = {"perturbed": 0.6, "placeholder": 0.2, "units": 0.2}
GRAMS, MILLIMETRES = 1e3, 1e3
LEVEL_BESIDE_UNITS = 0.1


def draw_file(rng: np.random.Generator, robot: Robot, kind: str | None = None) -> tuple[Robot, str]:
    """The robot with wrong inertial parameters and rotors, without friction; and the kind of error."""
    kind = kind or pick(rng, KINDS)
    if kind == "placeholder":
        size = 1.0 if chance(rng, 0.5) else 0.01
        body = inertial_parameters(size, np.zeros(3), size * np.eye(3))
        return robot.with_parameters(
            inertial_parameters=np.tile(body, len(robot.links)), armature=np.zeros(robot.nv)
        ), kind
    level = rng.uniform(0.1, 0.5) if kind == "perturbed" else LEVEL_BESIDE_UNITS
    bodies = perturbed(rng, robot.inertial_parameters.reshape(-1, 10), level)
    if kind == "units":
        link = int(rng.integers(len(bodies)))
        bodies[link] = in_grams(bodies[link]) if chance(rng, 0.5) else in_millimetres(bodies[link])
    knows = chance(rng, 0.5)
    rotors = robot.armature * rng.uniform(1.0 - level, 1.0 + level, robot.nv) if knows else np.zeros(robot.nv)
    return robot.with_parameters(inertial_parameters=bodies.ravel(), armature=rotors), kind


def with_friction(rng: np.random.Generator, file: Robot, truth: Truth) -> Robot:
    """The file with the viscous and Coulomb friction that its maker measured, off by up to a half."""
    damping, dry = np.zeros(file.nv), np.zeros(file.nv)
    for term in truth.terms:
        if len(term.joints) == 1:
            damping[term.joints[0]] += term.coefficient * (term.kind == "viscous")
            dry[term.joints[0]] += term.coefficient * (term.kind in ("coulomb", "hysteresis"))
    factors = rng.uniform(0.5, 1.5, (2, file.nv))
    return file.with_parameters(damping=damping * factors[0], dry_friction=dry * factors[1])


def perturbed(rng: np.random.Generator, bodies: np.ndarray, level: float) -> np.ndarray:
    """Possible bodies, shape (links, 10), that are off by up to a share."""
    body, count = mass_properties(bodies), len(bodies)
    size = np.sqrt(np.trace(body.inertia, axis1=1, axis2=2) / (2.0 * body.mass))
    center = body.center_of_mass + level * size[:, None] * rng.uniform(-1.0, 1.0, (count, 3))
    mass, inertia = (rng.uniform(1.0 - level, 1.0 + level, count) for _ in range(2))
    return np.array(inertial_parameters(body.mass * mass, center, body.inertia * inertia[:, None, None]))


def in_grams(body: np.ndarray) -> np.ndarray:
    """A body whose masses were written in grams."""
    return GRAMS * body


def in_millimetres(body: np.ndarray) -> np.ndarray:
    """A body whose lengths were written in millimetres."""
    return body * np.repeat([1.0, MILLIMETRES, MILLIMETRES**2], [1, 3, 6])

"""Random mechanisms: serial arms of usual sizes, and trees of any shape.

Joints: 1-8, mostly 2-4 (:data:`JOINTS`; many joints are slow to identify). Three of five are serial arms: axes turn by
right angles from joint to joint, links are log-uniform 0.08-0.5 m long, the first body weighs log-uniform 1-40 kg and
each further one 0.4-0.95 times the one before; one joint in twelve slides. Others are trees: a joint hangs on any one
before it, or with one chance in six on the world, in any orientation; one in four slides. Bodies are twenty-four points
with random weights in a random box beside their joint, so that every inertia is that of a possible body. Gravity points
down for half of them, anywhere for the others. Seven of ten have rotors, each log-uniform 0.03-2 times what its joint
moves at zero position.

Limits of motion: half ranges of 0.3-2.5 rad or 0.05-0.4 m, speeds log-uniform 0.5-3 rad/s or 0.1-1 m/s, accelerations
log-uniform 2-15 rad/s² or 1-8 m/s².
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from casysid.inertia import inertial_parameters
from casysid.robot import JointKind, Robot
from population.drawing import chance, log_uniform, pick

JOINTS = {1: 0.08, 2: 0.25, 3: 0.25, 4: 0.18, 5: 0.07, 6: 0.09, 7: 0.05, 8: 0.03}
POINTS = 24
GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class Limits:
    """How far and how fast joints move, shape (nv,) each, [rad, m and their rates]."""

    half_range: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A robot with its true parameters.

    Attributes:
        robot: Its inertial parameters and armature are the truth.
        limits: Of its motions.
        shape: ``arm`` or ``tree``.
    """

    robot: Robot
    limits: Limits
    shape: str

    @property
    def sliding(self) -> np.ndarray:
        """Which joints are prismatic, shape (nv,)."""
        return np.array([joint.kind is JointKind.PRISMATIC for joint in self.robot.joints])


def draw_mechanism(rng: np.random.Generator) -> Mechanism:
    """See the module's text."""
    count, shape = pick(rng, JOINTS), pick(rng, {"arm": 0.6, "tree": 0.4})
    slides = rng.random(count) < (1 / 12 if shape == "arm" else 1 / 4)
    limits = draw_limits(rng, slides)
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY]) if chance(rng, 0.5) else GRAVITY * direction(rng)
    mass = float(log_uniform(rng, 1.0, 40.0))
    for k in range(count):
        length = float(log_uniform(rng, 0.08, 0.5))
        if shape == "arm":
            parent, place = k, pin.SE3(right_angle(rng), length * direction(rng) if k else np.zeros(3))
        else:
            parent = 0 if k == 0 or chance(rng, 1 / 6) else int(rng.integers(1, k + 1))
            place = pin.SE3(pin.Quaternion(*unit(rng, 4)).toRotationMatrix(), length * direction(rng))
        bounds = [limits.speed[k], -limits.half_range[k], limits.half_range[k]]
        kind = pin.JointModelPZ() if slides[k] else pin.JointModelRZ()
        joint = model.addJoint(parent, kind, place, f"j{k + 1}", np.array([1e4]), *(np.array([b]) for b in bounds))
        model.appendBodyToJoint(
            joint, pin.Inertia.FromDynamicParameters(draw_body(rng, mass, length)), pin.SE3.Identity()
        )
        mass *= rng.uniform(0.4, 0.95)
    bare = Robot.from_pin(model, name=shape)
    inertia = np.diag(pin.crba(model, model.createData(), pin.neutral(model)))
    rotors = inertia * log_uniform(rng, 0.03, 2.0, count) if chance(rng, 0.7) else np.zeros(count)
    return Mechanism(bare.with_parameters(armature=rotors), limits, shape)


def draw_limits(rng: np.random.Generator, slides: np.ndarray) -> Limits:
    """Of joints that slide or turn."""
    count = len(slides)
    return Limits(
        np.where(slides, rng.uniform(0.05, 0.4, count), rng.uniform(0.3, 2.5, count)),
        np.where(slides, log_uniform(rng, 0.1, 1.0, count), log_uniform(rng, 0.5, 3.0, count)),
        np.where(slides, log_uniform(rng, 1.0, 8.0, count), log_uniform(rng, 2.0, 15.0, count)),
    )


def draw_body(rng: np.random.Generator, mass: float, length: float) -> np.ndarray:
    """Ten parameters of a cloud of points in a box as long as the link and a tenth to a half as thick."""
    box = length * np.concatenate([[1.0], rng.uniform(0.1, 0.5, 2)])
    points = (rng.permutation(box) * rng.uniform(-0.5, 0.5, (POINTS, 3))) + 0.5 * length * direction(rng)
    weights = mass * rng.dirichlet(np.ones(POINTS))
    center = weights @ points / mass
    apart = points - center
    second = (weights[:, None] * apart).T @ apart
    return inertial_parameters(mass, center, np.trace(second) * np.eye(3) - second)


def unit(rng: np.random.Generator, size: int) -> np.ndarray:
    """A random direction in so many dimensions."""
    drawn = rng.standard_normal(size)
    return drawn / np.linalg.norm(drawn)


def direction(rng: np.random.Generator) -> np.ndarray:
    """A random direction in space."""
    return unit(rng, 3)


def right_angle(rng: np.random.Generator) -> np.ndarray:
    """A turn about z, then for four in five a quarter turn about x, so that the next joint's axis is across."""
    about_z = pin.utils.rotate("z", rng.uniform(-np.pi, np.pi))
    return about_z if chance(rng, 0.2) else about_z @ pin.utils.rotate("x", np.pi / 2)

"""Hypothesis strategies shared by all tests, valid by construction: random robots and how they move.

Structure (kinds of joints, the shape of the tree) is drawn by Hypothesis and shrinks; the numbers in it come from one
drawn seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from hypothesis import strategies as st

from casysid.arrays import Array
from casysid.robot import Joint, JointKind, Robot

ALL_KINDS = tuple(JointKind)
SINGLE_KINDS = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


class Motion(NamedTuple):
    """Samples of a motion: q (N, nq), v (N, nv), a (N, nv)."""

    q: Array
    v: Array
    a: Array


def generators() -> st.SearchStrategy[np.random.Generator]:
    """Random generators, by seed."""
    return st.integers(0, 2**32 - 1).map(np.random.default_rng)


@st.composite
def consistent_inertias(draw: st.DrawFn) -> Array:
    """Ten parameters of a physically consistent body, Pinocchio's order."""
    return random_inertia(draw(generators())).toDynamicParameters()


@st.composite
def robots(draw: st.DrawFn, max_joints: int = 4, kinds: Sequence[JointKind] = ALL_KINDS, min_joints: int = 1) -> Robot:
    """Random trees with random placements, axes, inertias, damping, dry friction, armature and gravity.

    Free-flyers are drawn at the base only.
    """
    rng = draw(generators())
    count = draw(st.integers(min_joints, max_joints))
    inner = tuple(kind for kind in kinds if kind is not JointKind.FREE_FLYER)
    chosen = [draw(st.sampled_from(kinds if k == 0 or not inner else inner)) for k in range(count)]
    branches = [draw(st.integers(0, 2)) for _ in chosen]
    return random_robot(rng, chosen, branches)


@st.composite
def configurations(draw: st.DrawFn, robot: Robot) -> Array:
    """One configuration, shape (nq,)."""
    return random_motion(robot, draw(generators()), 1).q[0]


@st.composite
def motions(draw: st.DrawFn, robot: Robot, samples: int = 3) -> Motion:
    """Unordered samples of states and accelerations."""
    return random_motion(robot, draw(generators()), samples)


def random_robot(rng: np.random.Generator, kinds: Sequence[JointKind], branches: Sequence[int] | None = None) -> Robot:
    """A tree of joints of the given kinds, each so many joints back from the tip as ``branches`` says (default: none).

    Free-flyers have no drive: no armature and no friction.
    """
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81]) + rng.normal(size=3)
    tip: list[int] = []  # joints from the base to the last one: Pinocchio wants depth first
    for k, kind in enumerate(kinds):
        del tip[len(tip) - min(branches[k] if branches else 0, len(tip)) :]
        place = pin.SE3.Identity() if kind is JointKind.FREE_FLYER else random_placement(rng)
        tip.append(model.addJoint(tip[-1] if tip else 0, _joint_model(kind, rng), place, f"joint_{k + 1}"))
        model.appendBodyToJoint(tip[-1], random_inertia(rng), pin.SE3.Identity())
    driven = np.repeat(
        [kind is not JointKind.FREE_FLYER for kind in kinds], [joint.nv for joint in list(model.joints)[1:]]
    )
    for name in ("armature", "damping", "upperDryFrictionLimit"):
        setattr(model, name, driven * rng.uniform(0.01, 1.0, model.nv))
    model.lowerDryFrictionLimit = -model.upperDryFrictionLimit
    return Robot.from_pin(model)


def random_motion(robot: Robot, rng: np.random.Generator, samples: int) -> Motion:
    """Samples with angles in (-π, π), lengths, velocities and accelerations of the order of one."""
    q = np.empty((samples, robot.nq))
    for joint in robot.joints:
        q[:, joint.q] = _positions(joint, rng, samples)
    return Motion(q, rng.normal(size=(samples, robot.nv)), rng.normal(size=(samples, robot.nv)))


def random_inertia(rng: np.random.Generator) -> pin.Inertia:
    """A consistent body: its pseudo-inertia is ``U Uᵀ`` with U upper triangular and a positive diagonal."""
    U = np.triu(rng.normal(scale=0.3, size=(4, 4)), 1) + np.diag(rng.uniform(0.2, 1.5, 4))
    return pin.PseudoInertia.FromMatrix(U @ U.T).toInertia()


def random_placement(rng: np.random.Generator) -> pin.SE3:
    """Now and then turned by a multiple of a right angle, as real arms are."""
    turns = rng.integers(4) * np.pi / 2 * np.eye(3)[rng.integers(3)]
    turn = turns if rng.random() < 0.5 else rng.uniform(-1.5, 1.5, 3)
    return pin.SE3(pin.exp3(turn), rng.normal(scale=0.5, size=3))


def _positions(joint: Joint, rng: np.random.Generator, samples: int) -> Array:
    match joint.kind:
        case JointKind.SPHERICAL:
            return _unit(rng.normal(size=(samples, 4)))
        case JointKind.FREE_FLYER:
            return np.hstack([rng.normal(size=(samples, 3)), _unit(rng.normal(size=(samples, 4)))])
        case JointKind.CONTINUOUS:
            return _unit(rng.normal(size=(samples, 2)))
        case JointKind.PLANAR:
            return np.hstack([rng.normal(size=(samples, 2)), _unit(rng.normal(size=(samples, 2)))])
        case _:
            return rng.uniform(-np.pi, np.pi, (samples, 1))


def _joint_model(kind: JointKind, rng: np.random.Generator) -> object:
    """A joint about a coordinate axis or, as often, about any axis."""
    aligned, axis = rng.integers(3), _unit(rng.normal(size=3))
    match kind:
        case JointKind.REVOLUTE:
            choices = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ
            return choices[aligned]() if rng.random() < 0.5 else pin.JointModelRevoluteUnaligned(axis)
        case JointKind.PRISMATIC:
            choices = pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ
            return choices[aligned]() if rng.random() < 0.5 else pin.JointModelPrismaticUnaligned(axis)
        case JointKind.CONTINUOUS:
            choices = pin.JointModelRUBX, pin.JointModelRUBY, pin.JointModelRUBZ
            return choices[aligned]() if rng.random() < 0.5 else _continuous_about(axis)
        case JointKind.SPHERICAL:
            return pin.JointModelSpherical()
        case JointKind.PLANAR:
            return pin.JointModelPlanar()
        case JointKind.FREE_FLYER:
            return pin.JointModelFreeFlyer()


def _continuous_about(axis: Array) -> object:
    """Pinocchio's Python makes this joint only when it reads a file."""
    x, y, z = axis
    return pin.buildModelFromXML(
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/>'
        f'<child link="b"/><axis xyz="{x} {y} {z}"/></joint></robot>'
    ).joints[1]


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

"""From a compiled ``mujoco.MjModel`` to a ``pin.Model`` with the same coordinates.

Pinocchio's own MJCF parser knows no includes, frames, or unnamed bodies, and drops gravity; MuJoCo's compiler does.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from casysid.arrays import Array
from casysid.errors import RobotError
from casysid.robot.assembly import ROOT_JOINT
from casysid.robot.mjcf_actuators import actuator_reflection, effort_limit

_JOINT = mujoco.mjtJoint


def joint_names(compiled: Any) -> list[str]:
    """Names of all joints in MuJoCo's order; an unnamed one is ``root_joint`` if free, else ``joint<index>``."""
    given = [compiled.joint(j).name for j in range(compiled.njnt)]
    names: list[str] = []
    for j, name in enumerate(given):
        free = compiled.jnt_type[j] == _JOINT.mjJNT_FREE and ROOT_JOINT not in (*given, *names)
        names.append(name or (ROOT_JOINT if free else f"joint{j}"))
    return names


def body_names(compiled: Any) -> list[str]:
    """Names of all bodies in MuJoCo's order, the world first; an unnamed one is ``body<index>``."""
    return [compiled.body(b).name or f"body{b}" for b in range(compiled.nbody)]


def build_pin_model(compiled: Any, *, free_root: int | None = None, left_out: Collection[int] = ()) -> Any:
    """The ``pin.Model`` of a compiled MJCF: joints in MuJoCo's order, bodies as BODY frames, limits, damping, armature.

    A body with several joints becomes a chain whose last joint carries it. Configurations are MuJoCo's, with ``ref``,
    except that quaternions are (x, y, z, w) and the velocity of free joints is in the body frame.

    Args:
        compiled: ``mujoco.MjModel``.
        free_root: Body under which a free joint is put, if any.
        left_out: Bodies that are no part of it, whole trees.
    """
    model = pin.Model()
    joints, bodies = joint_names(compiled), body_names(compiled)
    carriers = {0: (0, pin.SE3.Identity())}  # body -> its Pinocchio joint, and the body frame in that joint's frame
    for b in range(1, compiled.nbody):
        if b in left_out:
            continue
        carrier, pose = carriers[compiled.body_parentid[b]]
        pose = pose * _pose(compiled.body_pos[b], compiled.body_quat[b])
        if b == free_root:
            carrier, pose = (
                model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), ROOT_JOINT),
                pin.SE3.Identity(),
            )
            model.addJointFrame(carrier)
        first = compiled.body_jntadr[b]
        for j in range(first, first + compiled.body_jntnum[b]):
            joint, before, after = _joint_motion(compiled, j)
            placement = pin.SE3.Identity() if compiled.jnt_type[j] == _JOINT.mjJNT_FREE else pose * before
            carrier, pose = model.addJoint(carrier, joint, placement, joints[j]), after
            model.addJointFrame(carrier)
            _copy_dof_values(compiled, j, model, carrier)
        principal = pin.Inertia(float(compiled.body_mass[b]), np.zeros(3), np.diag(compiled.body_inertia[b]))
        model.appendBodyToJoint(carrier, principal, pose * _pose(compiled.body_ipos[b], compiled.body_iquat[b]))
        model.addFrame(pin.Frame(bodies[b], carrier, 0, pose, pin.FrameType.BODY))
        carriers[b] = carrier, pose
    _add_fixed_frames(model, compiled, carriers)
    return model


def _add_fixed_frames(model: Any, compiled: Any, carriers: dict[int, tuple[int, Any]]) -> None:
    """Sites and cameras that have a name, as OP_FRAME and SENSOR frames of the joints that move them."""
    for kind, count, word in (("OP_FRAME", compiled.nsite, "site"), ("SENSOR", compiled.ncam, "cam")):
        bodies, positions, turns = (getattr(compiled, f"{word}_{part}") for part in ("bodyid", "pos", "quat"))
        for k in range(count):
            name = (compiled.site if word == "site" else compiled.camera)(k).name
            carrier, pose = carriers[bodies[k]]
            if name:
                placement = pose * _pose(positions[k], turns[k])
                model.addFrame(pin.Frame(name, carrier, 0, placement, getattr(pin.FrameType, kind)))


def _pose(position: Array, quaternion: Array) -> Any:
    """A ``pin.SE3``; MuJoCo's quaternions are (w, x, y, z)."""
    return pin.SE3(pin.Quaternion(*map(float, quaternion)).toRotationMatrix(), np.array(position, dtype=np.float64))


def _joint_motion(compiled: Any, j: int) -> tuple[Any, Any, Any]:
    """Pinocchio's joint, its frame in the body frame before it moves, and the body frame in it afterwards."""
    kind, axis, ref = compiled.jnt_type[j], np.array(compiled.jnt_axis[j]), compiled.qpos0[compiled.jnt_qposadr[j]]
    anchor = pin.SE3(np.eye(3), np.array(compiled.jnt_pos[j]))
    aligned = {(1, 0, 0): 0, (0, 1, 0): 1, (0, 0, 1): 2}.get(tuple(np.round(axis, 14)))
    if kind == _JOINT.mjJNT_HINGE:
        hinges = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)
        joint = pin.JointModelRevoluteUnaligned(axis) if aligned is None else hinges[aligned]()
        return joint, anchor * pin.SE3(pin.exp3(-axis * ref), np.zeros(3)), anchor.inverse()
    if kind == _JOINT.mjJNT_SLIDE:
        slides = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ)
        joint = pin.JointModelPrismaticUnaligned(axis) if aligned is None else slides[aligned]()
        return joint, pin.SE3(np.eye(3), -axis * ref), pin.SE3.Identity()
    if kind == _JOINT.mjJNT_BALL:
        return pin.JointModelSpherical(), anchor, anchor.inverse()
    return pin.JointModelFreeFlyer(), pin.SE3.Identity(), pin.SE3.Identity()


def _copy_dof_values(compiled: Any, j: int, model: Any, k: int) -> None:
    """Damping, dry friction, armature and limits of MuJoCo's joint j as those of Pinocchio's joint k."""
    joint = model.joints[k]
    reflected_armature, reflected_damping = actuator_reflection(compiled)
    source = slice(compiled.jnt_dofadr[j], compiled.jnt_dofadr[j] + joint.nv)
    values = {
        "armature": compiled.dof_armature + reflected_armature,
        "damping": compiled.dof_damping + reflected_damping,
        "upperDryFrictionLimit": compiled.dof_frictionloss,
        "lowerDryFrictionLimit": -compiled.dof_frictionloss,
    }
    for name, value in values.items():
        _set(model, name, slice(joint.idx_v, joint.idx_v + joint.nv), value[source])
    if joint.nv == 1:
        limited = bool(compiled.jnt_limited[j])
        lower, upper = compiled.jnt_range[j] if limited else (-np.inf, np.inf)
        _set(model, "lowerPositionLimit", joint.idx_q, lower)
        _set(model, "upperPositionLimit", joint.idx_q, upper)
        _set(model, "upperEffortLimit", joint.idx_v, effort_limit(compiled, j))


def _set(model: Any, name: str, where: slice | int, value: Any) -> None:
    values = getattr(model, name).copy()
    values[where] = value
    setattr(model, name, values)


def find_free_root(compiled: Any, source: Path, left_out: Collection[int] = ()) -> int | None:
    """The body to put a free joint under for a floating base; None if it floats already.

    Raises:
        RobotError: Several bodies stand in the world, so the base is not known.
    """
    top = [b for b in range(1, compiled.nbody) if compiled.body_parentid[b] == 0 and b not in left_out]
    moving = {int(compiled.body_rootid[b]) for b in range(1, compiled.nbody) if compiled.body_jntnum[b]}
    roots = [b for b in top if b in moving] or top
    if len(roots) != 1:
        names = ", ".join(f"'{body_names(compiled)[b]}'" for b in roots)
        raise RobotError(f"{source}: floating_base: which of the bodies {names} is the base? Give it a <freejoint/>")
    base = roots[0]
    if compiled.body_jntnum[base] and compiled.jnt_type[compiled.body_jntadr[base]] == _JOINT.mjJNT_FREE:
        return None
    if ROOT_JOINT in joint_names(compiled):
        raise RobotError(
            f"{source}: floating_base: a joint is named '{ROOT_JOINT}' already, which the free joint would be"
        )
    return base

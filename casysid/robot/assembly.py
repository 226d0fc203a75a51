"""From a ``pin.Model`` to a :class:`~casysid.robot.model.Robot`."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError, RobotError
from casysid.robot.checks import InertiaFault, check_gravity
from casysid.robot.model import Joint, JointKind, Robot, SourceFormat

ROOT_JOINT = "root_joint"  # Pinocchio's name for the free joint under a floating base
_KINDS = {
    **{f"JointModelR{axis}": JointKind.REVOLUTE for axis in ("X", "Y", "Z", "evoluteUnaligned")},
    **{f"JointModelRUB{axis}": JointKind.CONTINUOUS for axis in "XYZ"},
    **{f"JointModelP{axis}": JointKind.PRISMATIC for axis in ("X", "Y", "Z", "rismaticUnaligned")},
    "JointModelRevoluteUnboundedUnaligned": JointKind.CONTINUOUS,
    "JointModelSpherical": JointKind.SPHERICAL,
    "JointModelPlanar": JointKind.PLANAR,
    "JointModelFreeFlyer": JointKind.FREE_FLYER,
}
_CHANNELS = {
    JointKind.SPHERICAL: ("qx", "qy", "qz", "qw"),
    JointKind.PLANAR: ("x", "y", "theta"),
    JointKind.FREE_FLYER: ("x", "y", "z", "qx", "qy", "qz", "qw"),
}
_DOFS = {
    JointKind.SPHERICAL: ("wx", "wy", "wz"),
    JointKind.PLANAR: ("vx", "vy", "wz"),
    JointKind.FREE_FLYER: ("vx", "vy", "vz", "wx", "wy", "wz"),
}
_BEYOND_ANY_LIMIT = 1e300


def assemble_robot(
    model: Any,
    links: Sequence[str | None],
    *,
    name: str,
    source: Path,
    source_format: SourceFormat,
    faults: Sequence[InertiaFault] = (),
    floating_base: bool = False,
    locked: Sequence[tuple[str, float]] = (),
    file_order: Sequence[str] = (),
) -> Robot:
    """The robot of a model that is its own from here on.

    Args:
        model: ``pin.Model``, not to be changed by the caller any more.
        links: The link that each joint carries, universe left out.
        name: Name of the robot.
        source: File it came from.
        source_format: Format of that file.
        faults: Complaints about the file's inertial parameters.
        floating_base: Whether a free joint was added.
        locked: Joints that were held.
        file_order: Names of joints in the file, in its order; those that do not move are left out.

    Raises:
        RobotError: There is no joint, or one of an unknown kind.
    """
    joints = _list_joints(model, links, source)
    lower, upper = _position_limits(model, joints)
    inertias = [model.inertias[k + 1] for k, joint in enumerate(joints) if joint.link is not None]
    return Robot(
        name=name,
        source=source,
        source_format=source_format,
        model=model,
        joints=joints,
        links=tuple(joint.link for joint in joints if joint.link is not None),
        dofs=_suffixed(joints, _DOFS),
        channels=_suffixed(joints, _CHANNELS),
        inertial_parameters=frozen(np.concatenate([inertia.toDynamicParameters() for inertia in inertias])),
        damping=frozen(model.damping),
        dry_friction=frozen(model.upperDryFrictionLimit),
        armature=frozen(model.armature),
        position_lower=lower,
        position_upper=upper,
        velocity_limit=_unbounded(model.upperVelocityLimit),
        effort_limit=_unbounded(model.upperEffortLimit),
        gravity=frozen(model.gravity.linear),
        faults=tuple(faults),
        floating_base=floating_base,
        locked=tuple(locked),
        file_order=_order_of(file_order, [joint.name for joint in joints]),
    )


def _order_of(file_order: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """The file's order of the joints that move, those that it does not have first; empty where it is theirs."""
    moving = set(names)
    order = (*(name for name in names if name not in set(file_order)), *(x for x in file_order if x in moving))
    return () if order == tuple(names) else order


def replace_gravity(robot: Robot, gravity: npt.ArrayLike) -> Robot:
    """See :meth:`Robot.with_gravity`."""
    model = robot.model.copy()
    model.gravity.linear = check_gravity(gravity)
    return dataclasses.replace(robot, model=model, gravity=frozen(model.gravity.linear))


def replace_parameters(
    robot: Robot,
    inertial_parameters: npt.ArrayLike | None,
    damping: npt.ArrayLike | None,
    dry_friction: npt.ArrayLike | None,
    armature: npt.ArrayLike | None,
) -> Robot:
    """See :meth:`Robot.with_parameters`."""
    inertial = _chosen("inertial_parameters", inertial_parameters, robot.inertial_parameters)
    viscous = _chosen("damping", damping, robot.damping)
    coulomb = _chosen("dry_friction", dry_friction, robot.dry_friction)
    rotor = _chosen("armature", armature, robot.armature)
    model = robot.model.copy()
    carrying = [k for k, joint in enumerate(robot.joints) if joint.link is not None]
    for k, link, theta in zip(carrying, robot.links, inertial.reshape(-1, 10), strict=True):
        model.inertias[k + 1] = inertia_from_parameters(theta, link)
    model.damping, model.armature = viscous.copy(), rotor.copy()
    model.upperDryFrictionLimit, model.lowerDryFrictionLimit = coulomb.copy(), -coulomb
    return dataclasses.replace(
        robot,
        model=model,
        inertial_parameters=inertial,
        damping=viscous,
        dry_friction=coulomb,
        armature=rotor,
        faults=robot.faults if inertial_parameters is None else (),
    )


def inertia_from_parameters(theta: Array, link: str) -> Any:
    """The ``pin.Inertia`` of ten parameters at the joint frame.

    Raises:
        ParameterError: The mass is zero, but the first moment is not: no inertia has such parameters.
    """
    if theta[0] != 0.0:
        return pin.Inertia.FromDynamicParameters(theta)
    if theta[1:4].any():
        raise ParameterError(f"link '{link}': mass 0 with first moment {theta[1:4]} kg m is no body; project it first")
    ixx, ixy, iyy, ixz, iyz, izz = theta[4:]
    return pin.Inertia(0.0, np.zeros(3), np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]))


def _chosen(name: str, values: npt.ArrayLike | None, default: Array) -> Array:
    if values is None:
        return default
    chosen = frozen(values)
    if chosen.shape != default.shape:
        raise ParameterError(f"{name}: wanted shape {default.shape}; got {chosen.shape}")
    if not np.isfinite(chosen).all():
        raise ParameterError(f"{name}: must be finite; number {int(np.argmin(np.isfinite(chosen)))} is not")
    return chosen


def _list_joints(model: Any, links: Sequence[str | None], source: Path) -> tuple[Joint, ...]:
    if model.njoints == 1:
        raise RobotError(f"{source}: no joint moves; a robot needs at least one joint that is not fixed or locked")
    joints: list[Joint] = []
    first_channel, data = 0, model.createData()
    for k in range(1, model.njoints):
        pin_joint, joint_name = model.joints[k], str(model.names[k])
        kind = _kind_of(pin_joint, joint_name, source)
        count = len(_CHANNELS.get(kind, (joint_name,)))
        joints.append(
            Joint(
                name=joint_name,
                kind=kind,
                parent=int(model.parents[k]) - 1,
                placement=model.jointPlacements[k].copy(),
                axis=_axis(data.joints[k].S),
                q=slice(pin_joint.idx_q, pin_joint.idx_q + pin_joint.nq),
                v=slice(pin_joint.idx_v, pin_joint.idx_v + pin_joint.nv),
                channels=slice(first_channel, first_channel + count),
                link=links[k - 1],
            )
        )
        first_channel += count
    return tuple(joints)


def _kind_of(pin_joint: Any, name: str, source: Path) -> JointKind:
    kind = _KINDS.get(str(pin_joint.shortname()))
    if kind is None:
        raise RobotError(
            f"{source}: joint '{name}' is a Pinocchio {pin_joint.shortname()}, which is not supported; "
            f"supported are {', '.join(kind.value for kind in JointKind)} joints"
        )
    return kind


def _axis(subspace: Array) -> Array:
    """The axis in a joint's motion subspace (6, n), linear before angular; zeros unless n is 1."""
    return frozen(subspace[3:] if subspace[3:].any() else subspace[:3]) if subspace.ndim == 1 else frozen(np.zeros(3))


def _suffixed(joints: Sequence[Joint], suffixes: dict[JointKind, tuple[str, ...]]) -> tuple[str, ...]:
    return tuple(
        name
        for joint in joints
        for name in (
            [f"{joint.name}_{suffix}" for suffix in suffixes[joint.kind]] if joint.kind in suffixes else [joint.name]
        )
    )


def _position_limits(model: Any, joints: Sequence[Joint]) -> tuple[Array, Array]:
    lower = np.full(joints[-1].channels.stop, -np.inf)
    upper = np.full(joints[-1].channels.stop, np.inf)
    for joint in joints:
        if joint.kind in (JointKind.REVOLUTE, JointKind.PRISMATIC):
            lower[joint.channels] = _unbounded(model.lowerPositionLimit[joint.q])
            upper[joint.channels] = _unbounded(model.upperPositionLimit[joint.q])
    return frozen(lower), frozen(upper)


def _unbounded(limits: Array) -> Array:
    values = np.array(limits, dtype=np.float64)
    return frozen(np.where(np.abs(values) >= _BEYOND_ANY_LIMIT, np.copysign(np.inf, values), values))

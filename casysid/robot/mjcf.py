"""Reads MJCF: MuJoCo compiles it, and what the compiled model says becomes a Pinocchio model."""

from __future__ import annotations

import os
import warnings
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import CasysidWarning, RobotError
from casysid.robot.assembly import ROOT_JOINT, assemble_robot
from casysid.robot.checks import InertiaFault, check_gravity, check_inertia, negative_friction, warn_of_faults
from casysid.robot.limits import check_expansion, check_numbers, check_parts
from casysid.robot.locking import lock_joints, lockable_values
from casysid.robot.mjcf_actuators import scalar_joint_of_actuator
from casysid.robot.mjcf_loops import check_loops, loose_bodies
from casysid.robot.mjcf_tree import body_names, build_pin_model, find_free_root, joint_names
from casysid.robot.model import Robot
from casysid.robot.mujoco_warnings import collected_warnings
from casysid.robot.xmltext import Element, parse_xml, read_bytes


def read_mjcf(
    path: Path,
    *,
    gravity: npt.ArrayLike | None = None,
    floating_base: bool = False,
    locked: Mapping[str, float] | None = None,
    stacklevel: int = 3,
) -> Robot:
    """The robot in an MJCF file; see :meth:`Robot.from_file`.

    Raises:
        RobotError: The file cannot be used.
    """
    root = parse_xml(read_bytes(path), path)
    if root.tag != "mujoco":
        hint = "; this looks like URDF, use Robot.from_urdf" if root.tag == "robot" else ""
        raise RobotError(f"{path}: the root element is <{root.tag}>, an MJCF has <mujoco>{hint}")
    _check_text(root, path)
    spec, compiled, messages = compile_mjcf(path)
    _check_compiled(compiled, path)
    loose = loose_bodies(compiled)
    free_root = find_free_root(compiled, path, loose) if floating_base else None
    asked = lockable_values(locked, joint_names(compiled), path)
    loose_joints = {joint_names(compiled)[compiled.body_jntadr[b]] for b in loose if compiled.body_jntnum[b]}
    held = tuple((name, value) for name, value in asked if name not in loose_joints)
    locked_names = {name for name, _ in held}
    left_out = check_loops(compiled, locked_names, loose, path)
    if loose:
        named = ", ".join(f"'{body_names(compiled)[b]}'" for b in sorted(loose))
        left_out.append(f"bodies of the scene that float beside the robot: {named}")
    try:
        full = build_pin_model(compiled, free_root=free_root, left_out=loose)
    except (ValueError, RuntimeError) as error:
        raise RobotError(f"{path}: Pinocchio cannot build the model: {error}") from error
    full.gravity.linear = check_gravity(_gravity(compiled) if gravity is None else gravity)
    model = lock_joints(full, held, path)
    carried = _carried_bodies(compiled, free_root, locked_names)
    links = [carried.get(str(name)) for name in list(model.names)[1:]]
    faults = _find_faults(model, links)
    robot = assemble_robot(
        model,
        links,
        name=path.stem if spec.modelname in ("", "MuJoCo Model") else spec.modelname,
        source=path,
        source_format="mjcf",
        faults=faults,
        floating_base=free_root is not None,
        locked=held,
    )
    for message in messages:
        warnings.warn(f"{path}: MuJoCo: {message}", CasysidWarning, stacklevel=stacklevel)
    if left_out:
        warnings.warn(f"{path}: left out: {'; '.join(left_out)}", CasysidWarning, stacklevel=stacklevel)
    _warn_of_extras(compiled, path, stacklevel=stacklevel)
    _warn_of_negatives(robot, path, stacklevel=stacklevel)
    warn_of_faults(path, faults, stacklevel=stacklevel)
    return robot


def _check_text(root: Element, path: Path) -> None:
    """Nothing, if MuJoCo can be asked to compile the text.

    Raises:
        RobotError: Its parts are too many, or it is not UTF-8, as which MuJoCo reads it whatever it says.
    """
    check_expansion(root, path)
    try:
        read_bytes(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise RobotError(f"{path}: is not UTF-8 ({error}); save it as UTF-8") from error


def _check_compiled(compiled: Any, path: Path) -> None:
    """Nothing, if the model is of a size that is handled, in parts and in numbers.

    Raises:
        RobotError: Naming the body or joint.
    """
    check_parts(compiled.njnt, compiled.nbody - 1, path)
    for b, name in enumerate(body_names(compiled)):
        for word in ("mass", "inertia", "pos", "ipos"):
            check_numbers(f"body '{name}': {word}", getattr(compiled, f"body_{word}")[b], path)
    joints = joint_names(compiled)
    for j, name in enumerate(joints):
        check_numbers(f"joint '{name}': pos", compiled.jnt_pos[j], path)
    for word in ("armature", "damping", "frictionloss"):
        for i, value in enumerate(getattr(compiled, f"dof_{word}")):
            check_numbers(f"joint '{joints[compiled.dof_jntid[i]]}': {word}", value, path)
    check_numbers("the reference position of a joint", compiled.qpos0, path)


def _warn_of_negatives(robot: Robot, path: Path, *, stacklevel: int) -> None:
    """One :class:`CasysidWarning` that lists joints with negative friction or armature; silent when there are none."""
    columns = (robot.damping, robot.dry_friction, robot.armature)
    doubts = [
        (joint.name, doubt)
        for joint in robot.joints
        if (doubt := negative_friction(*(float(column[joint.v].min()) for column in columns)))
    ]
    if doubts:
        listing = "; ".join(f"joint '{name}': {doubt}" for name, doubt in doubts)
        warnings.warn(f"{path}: {listing}", CasysidWarning, stacklevel=stacklevel + 1)


def _gravity(compiled: Any) -> Array:
    return (
        np.zeros(3) if compiled.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY else compiled.opt.gravity.copy()
    )


def _find_faults(model: Any, links: Sequence[str | None]) -> list[InertiaFault]:
    faults: list[InertiaFault] = []
    for link, inertia in zip(links, list(model.inertias)[1:], strict=True):
        if link is not None:
            faults += check_inertia(link, float(inertia.mass), np.array(inertia.inertia))
    return faults


def compile_mjcf(path: Path) -> tuple[Any, Any, list[str]]:
    """The ``MjSpec`` of a file, its ``MjModel`` with static bodies kept apart, and what MuJoCo warned of.

    Missing mesh and texture files are forgiven where no inertia depends on them.

    Raises:
        RobotError: MuJoCo refuses the file.
    """
    with warnings.catch_warnings(record=True) as caught, collected_warnings() as told:
        warnings.simplefilter("always")
        try:
            spec = _parse(path)
            compiled = spec.compile()
        except (ValueError, RuntimeError, MemoryError) as error:
            if "opening file" not in str(error):
                raise _refusal(path, error) from error
            spec, compiled = _compile_without_files(path, error)
    return spec, compiled, [*(str(message.message) for message in caught), *told]


def _parse(path: Path) -> Any:
    """The ``MjSpec``; MuJoCo itself opens no file by another suffix than ``.xml``."""
    text = read_bytes(path)
    if path.suffix == ".xml" and text == path.read_bytes():
        spec = mujoco.MjSpec.from_file(str(path))
    else:
        spec = mujoco.MjSpec.from_string(text.decode("utf-8"))
        spec.modelfiledir = f"{path.parent}{os.sep}"
    spec.compiler.fusestatic = False
    return spec


def _refusal(path: Path, error: Exception, hint: str = "") -> RobotError:
    reason = " ".join(str(error).split())
    if reason.startswith("XML Error") and "opening file" in reason and path.suffix != ".xml":
        hint += "; includes are found only from a file named .xml"
    return RobotError(f"{path}: MuJoCo does not accept the file: {reason}{hint}")


def _compile_without_files(path: Path, error: Exception) -> tuple[Any, Any]:
    """Spec and model without geometry from files: bodies that state their inertia do not need it.

    Raises:
        RobotError: The file cannot even be parsed, or a body has its inertia from a missing file.
    """
    try:
        spec = _parse(path)
    except (ValueError, RuntimeError, MemoryError):
        raise _refusal(path, error) from error
    ignored = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    needed = []
    for geom in list(spec.geoms):
        if geom.meshname or geom.hfieldname:
            if geom.parent.name != "world" and (ignored or not geom.parent.explicitinertial):
                needed.append(geom.parent.name)
            spec.delete(geom)
    if needed:
        hint = f"; it is needed for the inertia of body '{needed[0]}', which states none (<inertial>)"
        raise _refusal(path, error, hint) from error
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for asset in [*spec.skins, *spec.meshes, *spec.hfields, *spec.textures]:
        spec.delete(asset)
    try:
        return spec, spec.compile()
    except (ValueError, RuntimeError, MemoryError):
        raise _refusal(path, error) from error


def _carried_bodies(compiled: Any, free_root: int | None, locked: Collection[str]) -> dict[str, str]:
    """The body that each joint carries, by joint name: the last joint of a body that moves carries it."""
    joints, bodies = joint_names(compiled), body_names(compiled)
    carried: dict[str, str] = {}
    for b in range(1, compiled.nbody):
        first = compiled.body_jntadr[b]
        own = [joints[j] for j in range(first, first + compiled.body_jntnum[b]) if joints[j] not in locked]
        if own:
            carried[own[-1]] = bodies[b]
        elif b == free_root:
            carried[ROOT_JOINT] = bodies[b]
    return carried


def _warn_of_extras(compiled: Any, path: Path, *, stacklevel: int) -> None:
    """One :class:`CasysidWarning` that names forces of the file that the dynamic model does not have."""
    joints, bodies = joint_names(compiled), body_names(compiled)
    extras = []
    springs = [
        joints[j] for j in range(compiled.njnt) if compiled.jnt_stiffness[j] or compiled.jnt_stiffnesspoly[j].any()
    ]
    if springs:
        extras.append(f"stiffness of joints {', '.join(springs)}")
    curved = [joints[compiled.dof_jntid[i]] for i in range(compiled.nv) if compiled.dof_dampingpoly[i].any()]
    if curved:
        extras.append(f"nonlinear damping of joints {', '.join(dict.fromkeys(curved))}")
    floating = [bodies[b] for b in range(1, compiled.nbody) if compiled.body_gravcomp[b]]
    if floating:
        extras.append(f"gravcomp of bodies {', '.join(floating)}")
    if compiled.ntendon:
        extras.append(f"tendons ({compiled.ntendon})")
    if compiled.nflex:
        extras.append(f"deformable bodies ({compiled.nflex})")
    if compiled.opt.density or compiled.opt.viscosity:
        extras.append("the fluid around the robot")
    for k in range(compiled.nu):
        if scalar_joint_of_actuator(compiled, k) is None and (
            compiled.actuator_armature[k] or compiled.actuator_damping[k]
        ):
            extras.append(f"armature and damping of actuator '{compiled.actuator(k).name or k}'")
    if extras:
        warnings.warn(
            f"{path}: not part of the dynamic model: {'; '.join(extras)}. Their torques go into what is identified",
            CasysidWarning,
            stacklevel=stacklevel + 1,
        )

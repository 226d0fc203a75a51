"""Reads URDF: our own eyes for the text, Pinocchio for the tree."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from casysid.arrays import Array
from casysid.errors import ParameterError, RobotError
from casysid.robot.assembly import ROOT_JOINT, assemble_robot, inertia_from_parameters
from casysid.robot.checks import FaultKind, InertiaFault, check_gravity, check_inertia, warn_of_faults
from casysid.robot.limits import check_chain, check_parts
from casysid.robot.locking import lock_joints, lock_words, lockable_values
from casysid.robot.lumping import joint_parts, sum_of
from casysid.robot.model import Robot
from casysid.robot.urdf_joints import UrdfJoint, read_joints, warn_of_doubts
from casysid.robot.urdf_links import UrdfLink, read_links
from casysid.robot.xmltext import Element, parse_xml, read_bytes

_UNLIMITED = 1e300  # urdfdom reads no infinities
_EARTH = (0.0, 0.0, -9.81)


def read_urdf(
    path: Path,
    *,
    gravity: npt.ArrayLike | None = None,
    floating_base: bool = False,
    locked: Mapping[str, float] | None = None,
    stacklevel: int = 3,
) -> Robot:
    """The robot in a URDF file; see :meth:`Robot.from_file`.

    Raises:
        RobotError: The file cannot be used.
    """
    root = parse_xml(read_bytes(path), path)
    check_urdf_root(root, path)
    links, joints = read_links(root, path), read_joints(root, path)
    base = _find_base(links, joints, path)
    held = lockable_values(locked, [joint.name for joint in joints.values() if joint.kind != "fixed"], path)
    _refuse_mimics(joints.values(), held, path)
    adds_joint = floating_base and not _floats_already(base, joints)
    if adds_joint and ROOT_JOINT in joints:
        raise RobotError(
            f"{path}: floating_base: a joint is named '{ROOT_JOINT}' already, which the free joint would be"
        )
    full = _build_model(root.name or path.stem, links, joints, path, floating_base=adds_joint)
    full.gravity.linear = check_gravity(_EARTH if gravity is None else gravity)
    model = lock_joints(full, held, path)
    carried = {joint.name: joint.child for joint in joints.values()}
    faults = _find_faults(model, links, path)
    robot = assemble_robot(
        model,
        [carried.get(name, base) for name in list(model.names)[1:]],
        name=root.name or path.stem,
        source=path,
        source_format="urdf",
        faults=faults,
        floating_base=adds_joint,
        locked=held,
        file_order=tuple(joints),
    )
    moving = {joint.name for joint in robot.joints}
    warn_of_doubts(path, [joint for joint in joints.values() if joint.name in moving], stacklevel=stacklevel)
    warn_of_faults(path, faults, stacklevel=stacklevel)
    return robot


def check_urdf_root(root: Element, path: Path) -> None:
    """Nothing, if this is the root of an expanded URDF.

    Raises:
        RobotError: It is another format, or a xacro file.
    """
    for element in root.walk():
        values = element.attributes.values()
        if element.tag.startswith("xacro:") or any("${" in text or "$(" in text for text in values):
            raise RobotError(
                f"{path}:{element.line}: is a xacro file, not yet expanded; run "
                f"`xacro {shlex.quote(path.name)} > {shlex.quote(_free_name(path))}` first, and give that file"
            )
    if root.tag != "robot":
        hint = "; this looks like MJCF, use Robot.from_mjcf" if root.tag == "mujoco" else ""
        raise RobotError(f"{path}: the root element is <{root.tag}>, a URDF has <robot>{hint}")


def _free_name(path: Path) -> str:
    """Name for the expanded file beside a xacro file that no file has yet: the shell empties it before xacro reads."""
    stem = path.name.removesuffix(".xacro").removesuffix(".urdf")
    names = (f"{stem}{mark}.urdf" for mark in ("", "_expanded", *(f"_expanded{k}" for k in range(2, 1000))))
    return next(name for name in names if not path.with_name(name).exists())


def _find_base(links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint], path: Path) -> str:
    """The one link that no joint carries."""
    check_parts(sum(joint.kind != "fixed" for joint in joints.values()), len(links), path)
    if not links:
        raise RobotError(f"{path}: has no <link>")
    carrier: dict[str, UrdfJoint] = {}
    for joint in joints.values():
        where = f"{path}:{joint.element.line}: joint '{joint.name}'"
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise RobotError(f"{where}: {role} link '{link}' does not exist; links are {', '.join(sorted(links))}")
        if joint.child in carrier:
            raise RobotError(
                f"{where}: link '{joint.child}' has two parents, joints '{carrier[joint.child].name}' and "
                f"'{joint.name}'; closed loops are not supported, a URDF must be a tree"
            )
        carrier[joint.child] = joint
    bases = [name for name in links if name not in carrier]
    if len(bases) > 1:
        raise RobotError(
            f"{path}: links {', '.join(bases)} have no parent; exactly one link may be the base of the tree"
        )
    carried: dict[str, list[str]] = {}
    for joint in joints.values():
        carried.setdefault(joint.parent, []).append(joint.child)
    reached, waiting = set(bases), [(link, 0) for link in bases]
    while waiting:
        link, depth = waiting.pop()
        check_chain(depth, link, path)
        waiting += [(child, depth + 1) for child in carried.get(link, ())]
        reached.add(link)
    if reached != set(links):
        loop = ", ".join(sorted(set(links) - reached))
        raise RobotError(f"{path}: links {loop} form a loop that no base carries; a URDF must be a tree")
    return bases[0]


def _refuse_mimics(joints: Iterable[UrdfJoint], held: Iterable[tuple[str, float]], path: Path) -> None:
    locked = {name for name, _ in held}
    coupled = [
        joint for joint in joints if joint.mimics is not None and joint.kind != "fixed" and joint.name not in locked
    ]
    if coupled:
        listing = ", ".join(f"joint '{joint.name}' (line {joint.element.line}) '{joint.mimics}'" for joint in coupled)
        rest = {joint.name: float(np.clip(0.0, joint.lower, joint.upper)) for joint in coupled}
        raise RobotError(
            f"{path}: joints that mimic others are not supported: {listing}; lock them ({lock_words(rest)}; or "
            "--lock auto), or remove <mimic> from those that move by themselves"
        )


def _floats_already(base: str, joints: Mapping[str, UrdfJoint]) -> bool:
    on_base = [joint for joint in joints.values() if joint.parent == base]
    return len(on_base) == 1 and on_base[0].kind == "floating"


def _build_model(
    name: str, links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint], path: Path, *, floating_base: bool
) -> Any:
    """Pinocchio's model of the tree, from a text that holds only what was read and understood."""
    text = "".join(
        [
            f"<robot name={quoteattr(name)}>",
            *map(_link_text, links.values()),
            *map(_joint_text, joints.values()),
            "</robot>",
        ]
    )
    try:
        model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer()) if floating_base else pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        raise RobotError(f"{path}: Pinocchio cannot build the model: {error}") from error
    return model


def _numbers(values: Iterable[float]) -> str:
    return '"' + " ".join(repr(float(np.clip(value, -_UNLIMITED, _UNLIMITED))) for value in values) + '"'


def _link_text(link: UrdfLink) -> str:
    if not link.has_inertial:
        return f"<link name={quoteattr(link.name)}/>"
    entries = " ".join(
        f"{key}={_numbers([value])}"
        for key, value in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), link.inertia, strict=True)
    )
    return (
        f"<link name={quoteattr(link.name)}><inertial><origin xyz={_numbers(link.com)} rpy={_numbers(link.rpy)}/>"
        f"<mass value={_numbers([link.mass])}/><inertia {entries}/></inertial></link>"
    )


def _joint_text(joint: UrdfJoint) -> str:
    limit = (
        f"<limit lower={_numbers([joint.lower])} upper={_numbers([joint.upper])} "
        f"velocity={_numbers([joint.velocity])} effort={_numbers([joint.effort])}/>"
    )
    return (
        f"<joint name={quoteattr(joint.name)} type={quoteattr(joint.kind)}><parent link={quoteattr(joint.parent)}/>"
        f"<child link={quoteattr(joint.child)}/><origin xyz={_numbers(joint.xyz)} rpy={_numbers(joint.rpy)}/>"
        f"<axis xyz={_numbers(joint.axis)}/>{limit}"
        f"<dynamics damping={_numbers([joint.damping])} friction={_numbers([max(joint.friction, 0.0)])}/></joint>"
    )


def _find_faults(model: Any, links: Mapping[str, UrdfLink], path: Path) -> list[InertiaFault]:
    """Complaints about moving links: each one's own numbers, and each lumped body as a whole.

    The bodies are summed here and put into the model, as Pinocchio's own sum is wrong where a mass is negative.
    """
    faults: list[InertiaFault] = []
    known = {link.name: (link.parameters(), link.has_inertial) for link in links.values()}
    for k, parts in enumerate(joint_parts(model, known), 1):
        try:
            model.inertias[k] = inertia_from_parameters(sum_of(parts), parts[0].name)
        except ParameterError as error:
            raise RobotError(f"{path}: {error}") from error
        inertia = model.inertias[k]
        faults += _body_faults([links[part.name] for part in parts], float(inertia.mass), np.array(inertia.inertia))
    return faults


def _body_faults(parts: list[UrdfLink], mass: float, inertia: Array) -> list[InertiaFault]:
    main, *fixed = parts
    if not any(part.has_inertial for part in parts):
        names = ", ".join(f"'{part.name}'" for part in fixed)
        message = "has no <inertial>, nor do the links fixed to it: " + names if fixed else "has no <inertial>"
        return [InertiaFault(main.name, FaultKind.MISSING, message)]
    faults = [fault for part in parts for fault in part.faults]
    return faults or check_inertia(main.name, mass, inertia)

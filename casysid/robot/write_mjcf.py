"""Writes MJCF: the text that came in, with other numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from casysid.arrays import Array
from casysid.errors import RobotError
from casysid.inertia import MassProperties, inertial_parameters
from casysid.robot.lumping import joint_parts, share_out
from casysid.robot.mjcf import compile_mjcf
from casysid.robot.mjcf_actuators import actuator_reflection
from casysid.robot.mjcf_files import name_attached_files, redirect_files
from casysid.robot.mjcf_text import joint_elements, locate_bodies, own_elements
from casysid.robot.mjcf_tree import body_names, joint_names
from casysid.robot.model import Joint, Robot
from casysid.robot.xmlpatch import XmlPatch, comment, element_text, number_text
from casysid.robot.xmltext import Element, read_bytes

_NEUTRAL = {  # compiler settings that would change a stated inertia, and what they are set to
    "inertiafromgeom": "auto",
    "balanceinertia": "false",
    "boundmass": "0",
    "boundinertia": "0",
    "settotalmass": None,
}
_ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler", "diaginertia")
_MASSLESS = {"pos": "0 0 0", "mass": "0", "diaginertia": "0 0 0"}


def mjcf_text(robot: Robot, folder: Path) -> tuple[bytes, list[str]]:
    """The robot's file with the robot's parameters, to stand in ``folder``, and notes on what it says in another way.

    Raises:
        RobotError: The file cannot say it.
    """
    spec, compiled, _ = compile_mjcf(robot.source)
    _refuse_aligned_bodies(spec, robot.source)
    moved = robot.source.parent.resolve() != folder.resolve()
    text, root, elements = locate_bodies(robot.source, spec, compiled, alone=moved or _adjusts_inertia(spec))
    patch, notes = XmlPatch(text), []
    if text != read_bytes(robot.source):
        notes.append("written as one file: what was included, attached or replicated stands in it")
        name_attached_files(patch, root, compiled, robot.source.parent)
    notes += _patch_inertials(patch, robot, compiled, elements, everywhere=_adjusts_inertia(spec))
    notes += _patch_joints(patch, robot, spec, compiled, elements)
    _neutralise_compiler(patch, root)
    if moved:
        redirect_files(patch, root, robot.source.parent, folder)
    for note in notes:
        patch.prepend(root, comment(note))
    return patch.result(), notes


def _adjusts_inertia(spec: Any) -> bool:
    c = spec.compiler
    from_geoms = c.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return bool(from_geoms or c.balanceinertia or c.boundmass > 0 or c.boundinertia > 0 or c.settotalmass > 0)


def _refuse_aligned_bodies(spec: Any, source: Path) -> None:
    for joint in spec.joints:
        alone = joint.type == mujoco.mjtJoint.mjJNT_FREE and not list(joint.parent.bodies)
        if alone and (joint.align == 1 or (joint.align == 2 and spec.compiler.alignfree)):
            raise RobotError(
                f"{source}: the frame of body '{joint.parent.name}' follows its inertia (alignfree), so the log "
                "would mean another motion with the new one; set alignfree to false"
            )


def _patch_inertials(
    patch: XmlPatch, robot: Robot, compiled: Any, elements: list[Element], *, everywhere: bool
) -> list[str]:
    """Writes what was identified; with ``everywhere`` also what other bodies have by rules that end."""
    names, notes = body_names(compiled), []
    own = {names[b]: _compiled_parameters(compiled, b) for b in range(1, compiled.nbody)}
    known = {name: (theta, bool(theta.any())) for name, theta in own.items()}
    jointed = {names[b] for b in range(1, compiled.nbody) if compiled.body_jntnum[b]}
    shares: dict[str, MassProperties | None] = {}
    carrying = [(j, parts) for j, parts in zip(robot.joints, joint_parts(robot.model, known), strict=True) if j.link]
    for (joint, parts), theta in zip(carrying, robot.inertial_parameters.reshape(-1, 10), strict=True):
        new = share_out(theta, parts, jointed)
        notes += [
            f"body '{n}': its inertia is part of body '{joint.link}'" for n, share in new.items() if share is None
        ]
        shares |= new
    for b, element in enumerate(elements, 1):
        if names[b] in shares:
            _patch_inertial(patch, element, shares[names[b]])
        elif everywhere and compiled.body_weldid[b]:
            _patch_inertial(patch, element, _compiled_properties(compiled, b) if own[names[b]].any() else None)
    return notes


def _compiled_properties(compiled: Any, b: int) -> MassProperties:
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, compiled.body_iquat[b])
    R = rotation.reshape(3, 3)
    return MassProperties(compiled.body_mass[b], compiled.body_ipos[b], R @ np.diag(compiled.body_inertia[b]) @ R.T)


def _compiled_parameters(compiled: Any, b: int) -> Array:
    properties = _compiled_properties(compiled, b)
    return inertial_parameters(properties.mass, properties.center_of_mass, properties.inertia)


def _patch_inertial(patch: XmlPatch, body: Element, share: MassProperties | None) -> None:
    attributes: dict[str, str | None] = dict(_MASSLESS)
    if share is not None:
        entries = share.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        attributes = {
            "pos": number_text(share.center_of_mass),
            "mass": number_text([float(share.mass)]),
            "fullinertia": number_text(entries),
        }
    present = own_elements(body, "inertial")
    for inertial in present:
        if inertial.parent is body:
            unset = {name: None for name in (*_ORIENTATIONS, "fullinertia") if name in inertial.attributes}
            patch.set(inertial, **(unset | attributes))
            return
        patch.replace(inertial, "")
    patch.prepend(body, element_text("inertial", {name: value for name, value in attributes.items() if value}))


def _patch_joints(patch: XmlPatch, robot: Robot, spec: Any, compiled: Any, elements: list[Element]) -> list[str]:
    """Armature, damping and dry friction where they differ from the file's."""
    names, notes = joint_names(compiled), []
    armature, damping = actuator_reflection(compiled)
    places, authored = {joint.name: joint for joint in robot.joints}, {joint.id: joint for joint in spec.joints}
    of_body = {b: joint_elements(element) for b, element in enumerate(elements, 1)}
    for j, name in enumerate(names):
        if name not in places:
            continue
        joint, b, first = places[name], int(compiled.jnt_bodyid[j]), int(compiled.jnt_dofadr[j])
        element = of_body[b][j - int(compiled.body_jntadr[b])]
        dofs = slice(first, first + joint.v.stop - joint.v.start)
        wanted = {
            "armature": (robot.armature[joint.v] - armature[dofs], compiled.dof_armature[dofs]),
            "damping": (robot.damping[joint.v] - damping[dofs], compiled.dof_damping[dofs]),
            "frictionloss": (robot.dry_friction[joint.v], compiled.dof_frictionloss[dofs]),
        }
        sprung = bool((authored[j].springdamper > 0).all())
        for attribute, (values, present) in wanted.items():
            if not np.allclose(values, present, rtol=1e-12, atol=0.0) or (sprung and attribute == "damping"):
                higher = compiled.dof_dampingpoly[first] if attribute == "damping" else np.zeros(2)
                notes += _patch_joint(patch, element, joint, attribute, values, higher)
        if sprung:  # it would overrule the damping
            patch.set(element, springdamper="0 0", stiffness=number_text([compiled.jnt_stiffness[j]]))
    return notes


def _patch_joint(
    patch: XmlPatch, element: Element, joint: Joint, attribute: str, values: Array, higher: Array
) -> list[str]:
    """Sets a joint's value, with the higher orders it has."""
    if element.tag == "freejoint":
        return [f"joint '{joint.name}': <freejoint> has no place for {attribute} {number_text(values)}"]
    patch.set(element, **{attribute: number_text([values.mean(), *(higher if higher.any() else ())])})
    if np.ptp(values):
        return [f"joint '{joint.name}': MJCF has one {attribute} for all directions, the mean of {number_text(values)}"]
    if values[0] < 0.0:
        return [f"joint '{joint.name}': its own {attribute} is negative ({values[0]:g}), its actuators may add to it"]
    return []


def _neutralise_compiler(patch: XmlPatch, root: Element) -> None:
    for compiler in root.find_all("compiler"):
        harmful = {name: value for name, value in _NEUTRAL.items() if name in compiler.attributes}
        if compiler.attributes.get("inertiafromgeom") != "true":
            harmful.pop("inertiafromgeom", None)
        if harmful:
            patch.set(compiler, **harmful)

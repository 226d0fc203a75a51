"""Writes URDF: the text that came in, with other numbers."""

from __future__ import annotations

from pathlib import Path

from casysid.inertia import MassProperties
from casysid.robot.lumping import joint_parts, share_out
from casysid.robot.model import Joint, JointKind, Robot
from casysid.robot.urdf_joints import UrdfJoint, read_joints
from casysid.robot.urdf_links import read_links
from casysid.robot.xmlpatch import XmlPatch, comment, element_text, number_text, path_from
from casysid.robot.xmltext import Element, parse_xml, read_bytes

_WITH_DYNAMICS = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


def urdf_text(robot: Robot, folder: Path) -> tuple[bytes, list[str]]:
    """The robot's file with the robot's parameters, to stand in ``folder``, and notes on what it cannot say."""
    text = read_bytes(robot.source)
    root = parse_xml(text, robot.source)
    links, joints = read_links(root, robot.source), read_joints(root, robot.source)
    patch, notes = XmlPatch(text), []
    known = {link.name: (None if link.faults else link.parameters(), link.has_inertial) for link in links.values()}
    jointed = {joint.child for joint in joints.values() if joint.kind != "fixed"}
    parts = joint_parts(robot.model, known)
    for joint, own_parts, theta in zip(robot.joints, parts, robot.inertial_parameters.reshape(-1, 10), strict=True):
        for name, share in share_out(theta, own_parts, jointed).items():
            if share is None:
                notes.append(f"link '{name}': its inertia is part of link '{joint.link}'")
                _drop_inertial(patch, links[name].element, str(joint.link))
            else:
                _patch_inertial(patch, links[name].element, share)
        notes += _patch_friction(patch, robot, joint, joints.get(joint.name))
    notes += _armature_notes(robot)
    for note in notes:
        patch.prepend(root, comment(note))
    _redirect_files(patch, root, robot.source.parent, folder)
    return patch.result(), notes


def _drop_inertial(patch: XmlPatch, link: Element, carrier: str) -> None:
    inertial = link.find("inertial")
    if inertial is not None:
        patch.replace(inertial, comment(f"the inertia of this link is part of link '{carrier}'"))


def _patch_inertial(patch: XmlPatch, link: Element, share: MassProperties) -> None:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = share.inertia
    entries = dict(zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), (xx, xy, xz, yy, yz, zz), strict=True))
    wanted = {
        "origin": {"xyz": number_text(share.center_of_mass), "rpy": "0 0 0"},
        "mass": {"value": number_text([float(share.mass)])},
        "inertia": {key: number_text([value]) for key, value in entries.items()},
    }
    inertial = link.find("inertial")
    if inertial is None:
        inner = "".join(element_text(tag, attributes) for tag, attributes in wanted.items())
        patch.append(link, f"<inertial>{inner}</inertial>")
        return
    for tag, attributes in wanted.items():
        element = inertial.find(tag)
        if element is None:
            patch.append(inertial, element_text(tag, attributes))
        else:
            patch.set(element, **attributes)


def _patch_friction(patch: XmlPatch, robot: Robot, joint: Joint, source: UrdfJoint | None) -> list[str]:
    """Damping and dry friction where they differ from the file's; a note where the format has no place for them."""
    damping, friction = robot.damping[joint.v], robot.dry_friction[joint.v]
    if source is None or joint.kind not in _WITH_DYNAMICS:
        if not (damping.any() or friction.any()):
            return []
        values = f"damping {number_text(damping)}, dry friction {number_text(friction)}"
        return [f"joint '{joint.name}': URDF has no place for the friction of a {joint.kind.value} joint: {values}"]
    if (damping[0], friction[0]) != (source.damping, source.friction):
        attributes = {"damping": number_text(damping), "friction": number_text(friction)}
        dynamics = source.element.find("dynamics")
        if dynamics is None:
            patch.append(source.element, element_text("dynamics", attributes))
        else:
            patch.set(dynamics, **attributes)
    return []


def _armature_notes(robot: Robot) -> list[str]:
    values = ", ".join(
        f"{joint.name} " + " ".join(f"{value:.6g}" for value in robot.armature[joint.v])
        for joint in robot.joints
        if robot.armature[joint.v].any()
    )
    return [f"URDF has no place for armature [kg m², kg]: {values}"] if values else []


def _redirect_files(patch: XmlPatch, root: Element, origin: Path, folder: Path) -> None:
    """Lets relative mesh and texture paths point from the new folder to where they pointed."""
    if origin.resolve() == folder.resolve():
        return
    for element in root.walk():
        file = element.attributes.get("filename", "")
        if element.tag in ("mesh", "texture") and file and "://" not in file and not Path(file).is_absolute():
            patch.set(element, filename=path_from(folder, file, origin))

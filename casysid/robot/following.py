"""Joints of a URDF that follow others (``<mimic>``): where they stand while those do not move."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from casysid.errors import RobotError
from casysid.robot.urdf_joints import UrdfJoint, read_joints
from casysid.robot.xmltext import Element, parse_xml, read_bytes


def following_joints(path: Path, held: Mapping[str, float]) -> dict[str, float]:
    """Positions of the joints that follow others, within their limits [rad or m]; none of files that are no URDF.

    Args:
        path: Of the model.
        held: Joints that are locked, with their positions; leaders that are not stand at zero.

    Raises:
        RobotError: The file cannot be read, a multiplier or offset is no number, or joints follow each other in a ring.
    """
    root = parse_xml(read_bytes(path), path)
    if root.tag != "robot":
        return {}
    joints = read_joints(root, path)
    return {
        name: _position(joint, joints, held, path, ())
        for name, joint in joints.items()
        if joint.mimics is not None and joint.kind != "fixed" and name not in held
    }


def _position(
    joint: UrdfJoint, joints: Mapping[str, UrdfJoint], held: Mapping[str, float], path: Path, behind: tuple[str, ...]
) -> float:
    """Of a joint, by its leader's."""
    if joint.name in behind:
        raise RobotError(f"{path}: joints mimic each other in a ring: {', '.join(behind)}")
    if joint.name in held:
        return held[joint.name]
    mimic = joint.element.find("mimic")
    if joint.mimics is None or mimic is None:
        return 0.0
    leader = joints.get(joint.mimics)
    at = 0.0 if leader is None else _position(leader, joints, held, path, (*behind, joint.name))
    multiplier, offset = (_number(mimic, name, usual, path) for name, usual in (("multiplier", 1.0), ("offset", 0.0)))
    return float(np.clip(multiplier * at + offset, joint.lower, joint.upper))


def _number(mimic: Element, name: str, usual: float, path: Path) -> float:
    text = mimic.attributes.get(name)
    try:
        return usual if text is None else float(text)
    except ValueError as error:
        raise RobotError(f"{path}: line {mimic.line}: {name} of <mimic>: wanted a number; got {text!r}") from error

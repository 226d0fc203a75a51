"""A robot's tree and its file's parameters as JSON and back, every number as it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from casysid.arrays import Array
from casysid.json_reading import LARGEST, number, texts
from casysid.robot import Joint, JointKind, Robot
from casysid.robot.assembly import assemble_robot

_VECTORS = ("inertial_parameters", "damping", "dry_friction", "armature")
_LIMITS = ("position_lower", "position_upper", "velocity_limit", "effort_limit")
_ONE_AXIS = {
    JointKind.REVOLUTE: ("R", "RevoluteUnaligned"),
    JointKind.CONTINUOUS: ("RUB", ""),
    JointKind.PRISMATIC: ("P", "PrismaticUnaligned"),
}
_SEVERAL_AXES = {JointKind.SPHERICAL: "Spherical", JointKind.PLANAR: "Planar", JointKind.FREE_FLYER: "FreeFlyer"}
_ORTHOGONAL = 1e-9
"""By which a rotation matrix may miss being one: placements of hand-written files do by 1e-16 of rounding."""


def robot_to_json(robot: Robot) -> dict[str, object]:
    """The tree, limits, gravity, and the parameters of the robot's file; infinite limits as null."""
    return {
        "name": robot.name,
        "source": str(robot.source),
        "source_format": robot.source_format,
        "floating_base": robot.floating_base,
        "locked": [list(one) for one in robot.locked],
        "gravity": robot.gravity.tolist(),
        "joints": [_joint_to_json(joint) for joint in robot.joints],
        "dofs": list(robot.dofs),
        **{name: getattr(robot, name).tolist() for name in _VECTORS},
        **{name: [x if np.isfinite(x) else None for x in getattr(robot, name).tolist()] for name in _LIMITS},
    }


def robot_from_json(content: Mapping[str, Any]) -> Robot:
    """The robot of :func:`robot_to_json`.

    Raises:
        ValueError: The content is something else.
        KeyError: Something is missing.
    """
    model = pin.Model()
    limits = {name: _limits(content, name) for name in _LIMITS}
    links = [_add_joint(model, one, k, limits) for k, one in enumerate(content["joints"])]
    model.gravity = pin.Motion(np.array(numbers(content["gravity"], "gravity", 3)), np.zeros(3))
    robot = assemble_robot(
        model,
        links,
        name=str(content["name"]),
        source=Path(str(content["source"])),
        source_format="urdf" if content["source_format"] == "urdf" else "mjcf",
        floating_base=bool(content["floating_base"]),
        locked=[(str(name), number(value, "locked")) for name, value in content["locked"]],
    )
    if list(robot.dofs) != list(texts(content["dofs"], "dofs")):
        raise ValueError(f"the joints have the degrees of freedom {list(robot.dofs)}, not {content['dofs']}")
    given = {name: numbers(content[name], name, getattr(robot, name).size) for name in _VECTORS}
    return robot.with_parameters(**given)


def numbers(values: object, name: str, count: int) -> list[float]:
    """So many numbers.

    Raises:
        ValueError: It is something else.
    """
    if not isinstance(values, list) or len(values) != count:
        raise ValueError(f"'{name}' is not a list of {count} numbers")
    return [number(value, f"{name}[{k}]") for k, value in enumerate(values)]


def _joint_to_json(joint: Joint) -> dict[str, object]:
    return {
        "name": joint.name,
        "kind": joint.kind.value,
        "parent": joint.parent,
        "link": joint.link,
        "rotation": joint.placement.rotation.tolist(),
        "translation": joint.placement.translation.tolist(),
        "axis": joint.axis.tolist(),
    }


def _limits(content: Mapping[str, Any], name: str) -> list[float]:
    unbounded = -np.inf if name == "position_lower" else np.inf
    return [unbounded if x is None else number(x, name) for x in content[name]]


def _add_joint(model: Any, content: Mapping[str, Any], k: int, limits: Mapping[str, Sequence[float]]) -> str | None:
    """Add a joint to a ``pin.Model``; the link it carries."""
    kind, parent = JointKind(content["kind"]), content["parent"]
    if isinstance(parent, bool) or not isinstance(parent, int) or not -1 <= parent < k:
        raise ValueError(f"joint {k} has the parent {parent!r}, wanted -1 to {k - 1}")
    rotation = np.array([numbers(row, "rotation", 3) for row in content["rotation"]])
    if rotation.shape != (3, 3) or np.abs(rotation @ rotation.T - np.eye(3)).max() > _ORTHOGONAL:
        raise ValueError(f"joint {k}: its rotation is none")
    placement = pin.SE3(rotation, np.array(numbers(content["translation"], "translation", 3)))
    joint = _joint_model(kind, np.array(numbers(content["axis"], "axis", 3)))
    v = slice(model.nv, model.nv + joint.nv)
    bounds = [np.array(limits[name][v]) for name in ("effort_limit", "velocity_limit")]
    lower, upper = np.full(joint.nq, -np.inf), np.full(joint.nq, np.inf)
    if kind in (JointKind.REVOLUTE, JointKind.PRISMATIC):
        channel = sum(_channels(model, j) for j in range(1, model.njoints))
        lower[:], upper[:] = limits["position_lower"][channel], limits["position_upper"][channel]
    if any(len(one) != joint.nv for one in bounds):
        raise ValueError(f"joint {k}: there are too few limits")
    name = str(content["name"])
    model.addJoint(parent + 1, joint, placement, name, *bounds, lower, upper)
    return None if content["link"] is None else str(content["link"])


def _channels(model: Any, k: int) -> int:
    """How many logged positions a joint has: Pinocchio's, but one for an angle that is (cos, sin) there."""
    joint = model.joints[k]
    return int(
        joint.nq - ("RUB" in joint.shortname() or "Unbounded" in joint.shortname() or "Planar" in joint.shortname())
    )


def _joint_model(kind: JointKind, axis: Array) -> Any:
    if kind in _SEVERAL_AXES:
        return getattr(pin, f"JointModel{_SEVERAL_AXES[kind]}")()
    if abs(np.linalg.norm(axis) - 1.0) > _ORTHOGONAL or not np.abs(axis).max() < LARGEST:
        raise ValueError(f"the axis {axis.tolist()} is not of length 1")
    aligned, free = _ONE_AXIS[kind]
    for letter, unit in zip("XYZ", np.eye(3), strict=True):
        if np.array_equal(axis, unit):
            return getattr(pin, f"JointModel{aligned}{letter}")()
    return _turning_about(axis) if kind is JointKind.CONTINUOUS else getattr(pin, f"JointModel{free}")(axis)


def _turning_about(axis: Array) -> Any:
    """A joint that turns without end about any axis: in Python only Pinocchio's reader of URDF can make one."""
    x, y, z = (repr(float(value)) for value in axis)
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/>'
        f'<child link="b"/><axis xyz="{x} {y} {z}"/></joint></robot>'
    )
    return pin.buildModelFromXML(text).joints[1]

"""Capsules around the links: from the model file's geometry, or from where the joints are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation.kinematics import WORLD
from casysid.robot import Robot
from casysid.robot.mjcf import compile_mjcf
from casysid.robot.mjcf_tree import body_names
from casysid.robot.urdf_links import read_vector
from casysid.robot.xmltext import Element, parse_xml, read_bytes

SLENDERNESS = 0.15
"""Radius of a capsule made up between two joints, as a share of their distance."""
_SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, _MESH = 2, 3, 4, 5, 6, 7  # mjtGeom


@dataclass(frozen=True, eq=False)
class Capsule:
    """All points within ``radius`` of a segment.

    Attributes:
        link: What it belongs to, for messages.
        joint: Index of the joint whose child frame it is fixed to, -1 for the world.
        start: End of the segment in that frame, shape (3,), [m].
        end: The other end.
        radius: [m].
    """

    link: str
    joint: int
    start: Array
    end: Array
    radius: float

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if self.start.shape != (3,) or self.end.shape != (3,) or not 0.0 < self.radius < np.inf:
            raise ParameterError(
                f"capsule of '{self.link}': wanted two ends of three numbers and a positive radius; "
                f"got {self.start}, {self.end}, {self.radius}"
            )


def capsules_of(robot: Robot) -> tuple[Capsule, ...]:
    """Capsules around the robot's collision geometry; made up between joints for links that have none.

    Boxes, cylinders, spheres, and in MJCF meshes by their bounding box, are covered whole. Meshes of a URDF are not
    read.
    """
    if not robot.source.is_file():
        found: list[Capsule] = []
    elif robot.source_format == "urdf":
        found = list(_urdf_capsules(robot))
    else:
        found = list(_mjcf_capsules(robot))
    covered = {capsule.joint for capsule in found}
    return (*found, *(capsule for capsule in _joint_capsules(robot) if capsule.joint not in covered))


def cover(link: str, joint: int, pose: Any, axis: int, half_length: float, radius: float) -> Capsule:
    """The smallest capsule along an axis of ``pose`` that holds a prism of that half length and outer radius."""
    inset = np.linspace(0.0, half_length, 33)  # how far the segment's end lies inside the prism's
    radii = np.hypot(inset, radius)
    volume = np.pi * radii**2 * (2.0 * (half_length - inset) + 4.0 / 3.0 * radii)
    best = int(np.argmin(volume))
    reach = (half_length - inset[best]) * pose.rotation[:, axis]
    return Capsule(link, joint, pose.translation - reach, pose.translation + reach, float(radii[best]))


def _cover_box(link: str, joint: int, pose: Any, half: Array) -> Capsule:
    axis = int(np.argmax(half))
    return cover(link, joint, pose, axis, float(half[axis]), float(np.linalg.norm(np.delete(half, axis))))


def _carriers(robot: Robot) -> dict[str, tuple[int, Any]]:
    """For each link or body of the file: the joint that moves it, and its frame in that joint's frame."""
    return {
        str(frame.name): (int(frame.parentJoint) - 1, frame.placement)
        for frame in robot.model.frames
        if frame.type == pin.FrameType.BODY
    }


def _urdf_capsules(robot: Robot) -> Iterator[Capsule]:
    carriers = _carriers(robot)
    for link in parse_xml(read_bytes(robot.source), robot.source).find_all("link"):
        for collision in link.find_all("collision"):
            geometry = collision.find("geometry")
            if link.name in carriers and geometry is not None and geometry.children:
                joint, placement = carriers[link.name]
                pose = placement * _origin(collision, robot.source)
                yield from _urdf_shape(link.name, joint, pose, geometry.children[0], robot.source)


def _urdf_shape(link: str, joint: int, pose: Any, shape: Element, path: Path) -> Iterator[Capsule]:
    if shape.tag == "box":
        yield _cover_box(link, joint, pose, _numbers(shape, "size", 3, path) / 2.0)
    elif shape.tag in ("cylinder", "capsule"):
        half, radius = _numbers(shape, "length", 1, path)[0] / 2.0, _numbers(shape, "radius", 1, path)[0]
        if shape.tag == "cylinder":
            yield cover(link, joint, pose, 2, half, radius)
        else:
            reach = half * pose.rotation[:, 2]
            yield Capsule(link, joint, pose.translation - reach, pose.translation + reach, radius)
    elif shape.tag == "sphere":
        radius = _numbers(shape, "radius", 1, path)[0]
        yield Capsule(link, joint, pose.translation, pose.translation, radius)


def _origin(element: Element, path: Path) -> Any:
    origin = element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = (_numbers(origin, key, 3, path, "0 0 0") for key in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(*map(float, rpy)), np.array(xyz))


def _numbers(element: Element, key: str, count: int, path: Path, default: str = "") -> Array:
    text = element.attributes.get(key, default)
    try:
        return read_vector(text, count)
    except ValueError as error:
        raise ParameterError(
            f'{path}:{element.line}: collision geometry <{element.tag}>: {key}="{text}" is not {count} finite number(s)'
        ) from error


def _mjcf_capsules(robot: Robot) -> Iterator[Capsule]:
    _, compiled, _ = compile_mjcf(robot.source)
    carriers, bodies = _carriers(robot), body_names(compiled)
    for g in range(compiled.ngeom):
        name = bodies[compiled.geom_bodyid[g]]
        solid = compiled.geom_contype[g] or compiled.geom_conaffinity[g]
        if not solid or (name not in carriers and compiled.geom_bodyid[g] != 0):
            continue
        joint, placement = carriers.get(name, (WORLD, pin.SE3.Identity()))
        w, x, y, z = map(float, compiled.geom_quat[g])
        pose = placement * pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), compiled.geom_pos[g].copy())
        yield from _mjcf_shape(
            name, joint, pose, int(compiled.geom_type[g]), compiled.geom_size[g], compiled.geom_aabb[g]
        )


def _mjcf_shape(link: str, joint: int, pose: Any, kind: int, size: Array, bounds: Array) -> Iterator[Capsule]:
    if kind == _SPHERE:
        yield Capsule(link, joint, pose.translation, pose.translation, float(size[0]))
    elif kind == _CAPSULE:
        reach = size[1] * pose.rotation[:, 2]
        yield Capsule(link, joint, pose.translation - reach, pose.translation + reach, float(size[0]))
    elif kind == _CYLINDER:
        yield cover(link, joint, pose, 2, float(size[1]), float(size[0]))
    elif kind in (_BOX, _ELLIPSOID):
        yield _cover_box(link, joint, pose, size)
    elif kind == _MESH:
        yield _cover_box(link, joint, pose * pin.SE3(np.eye(3), bounds[:3].copy()), bounds[3:])


def _joint_capsules(robot: Robot) -> Iterator[Capsule]:
    """A capsule from each joint frame to every joint that follows it, as far as these are apart."""
    for i, joint in enumerate(robot.joints):
        for child in robot.joints:
            end: npt.NDArray[np.float64] = np.array(child.placement.translation)
            length = float(np.linalg.norm(end))
            if child.parent == i and length > 1e-3:
                yield Capsule(joint.link or joint.name, i, np.zeros(3), end, SLENDERNESS * length)

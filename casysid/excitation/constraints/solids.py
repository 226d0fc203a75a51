"""The collision geometry of the model file, as shapes that coal knows; a mesh is taken as its convex hull."""

from __future__ import annotations

import enum
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.kinematics.frames import WORLD
from casysid.robot import Robot
from casysid.robot.mjcf import compile_mjcf
from casysid.robot.mjcf_tree import body_names
from casysid.robot.urdf_links import read_vector
from casysid.robot.xmltext import Element, parse_xml, read_bytes


class _Geom(enum.IntEnum):
    """MuJoCo's mjtGeom."""

    PLANE = 0
    SPHERE = 2
    CAPSULE = 3
    ELLIPSOID = 4
    CYLINDER = 5
    BOX = 6
    MESH = 7


@dataclass(frozen=True, eq=False)
class Solid:
    """One shape of a link.

    Attributes:
        link: What it belongs to, for messages.
        joint: Index of the joint whose child frame it is fixed to, -1 for the world.
        pose: In that frame, a ``pinocchio.SE3``.
        shape: A ``coal.CollisionGeometry``; convex.
    """

    link: str
    joint: int
    pose: Any
    shape: Any


@dataclass(frozen=True, eq=False)
class FileGeometry:
    """What a model file says of the robot's shape.

    Attributes:
        solids: Its shapes.
        floors: Horizontal or inclined planes that are fixed to the world: normal (3,) and offset [m].
        missing: Meshes that could not be read, in words.
    """

    solids: tuple[Solid, ...] = ()
    floors: tuple[tuple[Array, float], ...] = ()
    missing: tuple[str, ...] = ()


def read_geometry(robot: Robot) -> FileGeometry:
    """Collision geometry of the robot's file; nothing where there is no file."""
    if not robot.source.is_file():
        return FileGeometry()
    return _read_urdf(robot) if robot.source_format == "urdf" else _read_mjcf(robot)


def convex_hull(points: Array) -> Any:
    """Of points (N, 3), which must not lie in one plane.

    Raises:
        RuntimeError: They do.
    """
    model = coal.BVHModelOBBRSS()
    model.beginModel(0, len(points))
    model.addVertices(np.ascontiguousarray(points, dtype=np.float64))
    model.endModel()
    model.buildConvexHull(False, "Qt")
    return model.convex


def carriers(robot: Robot) -> dict[str, tuple[int, Any]]:
    """For each link or body of the file: the joint that moves it, and its frame in that joint's frame."""
    return {
        str(frame.name): (int(frame.parentJoint) - 1, frame.placement)
        for frame in robot.model.frames
        if frame.type == pin.FrameType.BODY
    }


def _read_urdf(robot: Robot) -> FileGeometry:
    found: list[Solid] = []
    missing: list[str] = []
    carried = carriers(robot)
    for link in parse_xml(read_bytes(robot.source), robot.source).find_all("link"):
        for collision in link.find_all("collision"):
            geometry = collision.find("geometry")
            if link.name in carried and geometry is not None and geometry.children:
                joint, placement = carried[link.name]
                try:
                    shape = _urdf_shape(geometry.children[0], robot.source)
                except (OSError, RuntimeError, ValueError):
                    name = geometry.children[0].attributes.get("filename", "")
                    missing.append(f"mesh '{name}' of link '{link.name}' cannot be read and is not looked at")
                    continue
                if shape is not None:
                    found.append(Solid(link.name, joint, placement * _origin(collision, robot.source), shape))
    return FileGeometry(solids=tuple(found), missing=tuple(dict.fromkeys(missing)))


def _urdf_shape(shape: Element, path: Path) -> Any:
    match shape.tag:
        case "box":
            return coal.Box(*map(float, _numbers(shape, "size", 3, path)))
        case "cylinder" | "capsule":
            length, radius = (float(_numbers(shape, key, 1, path)[0]) for key in ("length", "radius"))
            return (coal.Cylinder if shape.tag == "cylinder" else coal.Capsule)(radius, length)
        case "sphere":
            return coal.Sphere(float(_numbers(shape, "radius", 1, path)[0]))
        case "mesh":
            scale = _numbers(shape, "scale", 3, path, "1 1 1")
            found = find_mesh(shape.attributes.get("filename", ""), path)
            model = coal.MeshLoader().load(str(found), np.array(scale))
            model.buildConvexHull(False, "Qt")
            return model.convex
    return None


def find_mesh(name: str, urdf: Path) -> Path:
    """The file that a URDF means: beside it, in a folder above it, or in a package that ROS knows.

    Raises:
        FileNotFoundError: There is none.
    """
    scheme, _, rest = name.rpartition("://")
    places = [folder / rest for folder in urdf.resolve().parents]
    if scheme in ("package", "model"):
        within = rest.partition("/")[2]
        places += [folder / within for folder in urdf.resolve().parents if folder.name == rest.partition("/")[0]]
        for variable, below in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
            places += [Path(one) / below / rest for one in os.environ.get(variable, "").split(os.pathsep) if one]
    elif scheme == "file":
        places = [Path(rest)]
    for place in places:
        if place.is_file():
            return place
    raise FileNotFoundError(name)


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


def _read_mjcf(robot: Robot) -> FileGeometry:
    _, compiled, _ = compile_mjcf(robot.source)
    carried, bodies = carriers(robot), body_names(compiled)
    found: list[Solid] = []
    floors: list[tuple[Array, float]] = []
    for g in range(compiled.ngeom):
        name = bodies[compiled.geom_bodyid[g]]
        solid = compiled.geom_contype[g] or compiled.geom_conaffinity[g]
        if not solid or (name not in carried and compiled.geom_bodyid[g] != 0):
            continue
        joint, placement = carried.get(name, (WORLD, pin.SE3.Identity()))
        w, x, y, z = map(float, compiled.geom_quat[g])
        pose = placement * pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), compiled.geom_pos[g].copy())
        if compiled.geom_type[g] == _Geom.PLANE:
            if joint == WORLD:
                normal = pose.rotation[:, 2]
                floors.append((normal, float(normal @ pose.translation)))
            continue
        shape = _mjcf_shape(compiled, g)
        if shape is not None:
            found.append(Solid(name, joint, pose, shape))
    return FileGeometry(solids=tuple(found), floors=tuple(floors))


def _mjcf_shape(compiled: Any, g: int) -> Any:
    size = compiled.geom_size[g].copy()
    match int(compiled.geom_type[g]):
        case _Geom.SPHERE:
            return coal.Sphere(float(size[0]))
        case _Geom.CAPSULE:
            return coal.Capsule(float(size[0]), 2.0 * float(size[1]))
        case _Geom.ELLIPSOID:
            return coal.Ellipsoid(*map(float, size))
        case _Geom.CYLINDER:
            return coal.Cylinder(float(size[0]), 2.0 * float(size[1]))
        case _Geom.BOX:
            return coal.Box(*map(float, 2.0 * size))
        case _Geom.MESH:
            mesh = int(compiled.geom_dataid[g])
            first = int(compiled.mesh_vertadr[mesh])
            return convex_hull(compiled.mesh_vert[first : first + int(compiled.mesh_vertnum[mesh])])
    return None


def corners(solids: tuple[Solid, ...], joint: int) -> Iterator[Array]:
    """Of the boxes around each shape that is fixed to a joint, in that joint's frame, each (8, 3)."""
    signs = np.array(list(np.ndindex(2, 2, 2)))
    for solid in solids:
        if solid.joint == joint:
            low, high = bounds(solid.shape)
            yield np.array([solid.pose.act(corner) for corner in np.where(signs, high, low)])


def bounds(shape: Any) -> tuple[Array, Array]:
    """Least and greatest corner of a shape in its own frame, each (3,)."""
    shape.computeLocalAABB()
    return np.array(shape.aabb_local.min_), np.array(shape.aabb_local.max_)

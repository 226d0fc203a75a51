"""Capsules around the links: from the model file's geometry, or from where the joints are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation.constraints.solids import Solid, bounds, read_geometry
from casysid.robot import Robot

SLENDERNESS = 0.15
"""Radius of a capsule made up between two joints, as a share of their distance."""

_SHORT = 1e-3  # [m] frames nearer to each other than this are one place


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


def capsules_of(robot: Robot, solids: Sequence[Solid] | None = None) -> tuple[Capsule, ...]:
    """Capsules that cover the robot's collision geometry; made up between joints for links that have none.

    Args:
        robot: Whose links they are.
        solids: Its shapes, whose capsules come first, one each; None reads them from the robot's file.
    """
    found = [_cover(solid) for solid in (read_geometry(robot).solids if solids is None else solids)]
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


def _cover(solid: Solid) -> Capsule:
    shape, pose = solid.shape, solid.pose
    if isinstance(shape, coal.Capsule | coal.Sphere):
        reach = getattr(shape, "halfLength", 0.0) * pose.rotation[:, 2]
        return Capsule(solid.link, solid.joint, pose.translation - reach, pose.translation + reach, shape.radius)
    if isinstance(shape, coal.Cylinder):
        return cover(solid.link, solid.joint, pose, 2, shape.halfLength, shape.radius)
    low, high = bounds(shape)
    half, middle = (high - low) / 2.0, pose * pin.SE3(np.eye(3), (high + low) / 2.0)
    axis = int(np.argmax(half))
    return cover(solid.link, solid.joint, middle, axis, float(half[axis]), float(np.linalg.norm(np.delete(half, axis))))


def _joint_capsules(robot: Robot) -> Iterator[Capsule]:
    """A capsule from each joint frame to every joint that follows it; from a last one to what it carries farthest out.

    That is a frame of the file, such as a flange, or the link's centre of mass.
    """
    for i, joint in enumerate(robot.joints):
        ends = [child.placement.translation for child in robot.joints if child.parent == i]
        if not ends:
            masses = robot.model.inertias[i + 1]
            carried = [frame.placement.translation for frame in robot.model.frames if frame.parentJoint == i + 1]
            ends = [max([*carried, masses.lever], key=np.linalg.norm)]
        for place in ends:
            end: npt.NDArray[np.float64] = np.array(place)
            length = float(np.linalg.norm(end))
            if length > _SHORT:
                yield Capsule(joint.link or joint.name, i, np.zeros(3), end, SLENDERNESS * length)

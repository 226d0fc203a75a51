"""Where points on the links are, for many configurations at once, and how they move with the joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.robot import JointKind, Robot

WORLD = -1
"""Instead of a joint's index: what does not move."""


class Frames(NamedTuple):
    """Pose of every joint's child frame in the world at N configurations."""

    rotation: Array  # (N, n, 3, 3)
    origin: Array  # (N, n, 3)
    axis: Array  # (N, n, 3), of the joint, in the world


@dataclass(frozen=True, eq=False)
class Kinematics:
    """The tree of single joints.

    Attributes:
        robot: Whose joints all have one degree of freedom.
    """

    robot: Robot

    @cached_property
    def moved_by(self) -> npt.NDArray[np.bool_]:
        """Whether child frame i moves with joint k, shape (n + 1, n); the last row is the world's."""
        n = len(self.robot.joints)
        table = np.zeros((n + 1, n), dtype=np.bool_)
        for i, joint in enumerate(self.robot.joints):
            table[i] = table[joint.parent] if joint.parent >= 0 else False
            table[i, i] = True
        return table

    def frames(self, position: Array) -> Frames:
        """Poses at joint positions (N, n)."""
        joints, samples = self.robot.joints, len(position)
        R, p = np.empty((samples, len(joints), 3, 3)), np.empty((samples, len(joints), 3))
        z = np.empty_like(p)
        for i, joint in enumerate(joints):
            outer = R[:, joint.parent] if joint.parent >= 0 else np.broadcast_to(np.eye(3), (samples, 3, 3))
            origin = p[:, joint.parent] if joint.parent >= 0 else np.zeros((samples, 3))
            before = outer @ joint.placement.rotation
            x = position[:, joint.v.start]
            z[:, i] = before @ joint.axis
            p[:, i] = origin + outer @ joint.placement.translation
            if joint.kind is JointKind.PRISMATIC:
                R[:, i] = before
                p[:, i] += z[:, i] * x[:, None]
            else:
                R[:, i] = before @ _turns(joint.axis, x)
        return Frames(R, p, z)

    def points(self, frames: Frames, joint: npt.NDArray[np.intp], local: Array) -> Array:
        """World positions (N, m, 3) of points ``local`` (m, 3), each fixed to a joint's child frame or the world."""
        moving = np.einsum("nmij,mj->nmi", frames.rotation[:, joint], local) + frames.origin[:, joint]
        return np.where((joint == WORLD)[:, None], local, moving)

    def slopes(self, frames: Frames, joint: npt.NDArray[np.intp], point: Array, direction: Array) -> Array:
        """How fast points (N, m, 3) go in directions (N, m, 3) with each joint, shape (N, m, n)."""
        prismatic = np.array([one.kind is JointKind.PRISMATIC for one in self.robot.joints])
        along = direction @ frames.axis.transpose(0, 2, 1)  # (N, m, n)
        # d · (z × (x - o)) = z · (x × d) - d · (z × o)
        moment = np.cross(point, direction) @ frames.axis.transpose(0, 2, 1)
        lever = direction @ np.cross(frames.axis, frames.origin).transpose(0, 2, 1)  # d · (z × o)
        turning = moment - lever
        return np.where(prismatic, along, turning) * self.moved_by[joint]


def _turns(axis: Array, angle: Array) -> Array:
    """Rotations (N, 3, 3) about a unit axis (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle)[:, None, None] * K + (1.0 - np.cos(angle))[:, None, None] * (K @ K))

"""Where points on the links are, for many configurations at once, and how the joints move them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from casysid import kinematics
from casysid.arrays import Array
from casysid.kinematics.frames import WORLD
from casysid.robot import JointKind, Robot
from casysid.robot.coordinates import configuration_from_channels

Indices = npt.NDArray[np.intp]


class Frames(NamedTuple):
    """Pose of every joint's child frame in the world at N configurations, and last the world's own."""

    rotation: Array  # (3, 3, N, n + 1)
    origin: Array  # (3, N, n + 1)


@dataclass(frozen=True, eq=False)
class Points:
    """The tree of single joints, and what is fixed to it.

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
            table[i] = table[joint.parent] if joint.parent != WORLD else False
            table[i, i] = True
        return table

    @cached_property
    def _kinematics(self) -> kinematics.Kinematics:
        return kinematics.Kinematics(self.robot)

    def frames(self, position: Array) -> Frames:
        """Poses at joint positions (N, n)."""
        poses = self._kinematics.link_poses(configuration_from_channels(self.robot, position))
        world = np.broadcast_to(np.eye(3)[:, :, None, None], (3, 3, len(position), 1))
        rotation = np.concatenate([poses.rotation.transpose(2, 3, 0, 1), world], axis=3)
        origin = np.concatenate([poses.translation.transpose(2, 0, 1), np.zeros((3, len(position), 1))], axis=2)
        return Frames(rotation, origin)

    def places(self, frames: Frames, joint: Indices, local: Array) -> Array:
        """World positions (3, N, m) of points ``local`` (m, 3), each fixed to a joint's child frame or the world."""
        turned = sum(frames.rotation[:, j][:, :, joint] * local[:, j] for j in range(3))
        return np.asarray(turned + frames.origin[:, :, joint])

    def pull_back(self, frames: Frames, joint: Indices, place: Array, force: Array) -> Array:
        """``Jᵀ f`` of forces at points, each (3, N, m), on what a joint moves: how much each joint feels, (N, n)."""
        felt = self.moved_by[joint].astype(np.float64)  # (m, n)
        push, moment = force @ felt, np.cross(place, force, axis=0) @ felt
        axis = np.einsum("ij...n,jn->i...n", frames.rotation[..., :-1], self._axes)
        along = (axis * push).sum(axis=0)
        turning = (axis * moment).sum(axis=0) - (push * np.cross(axis, frames.origin[:, :, :-1], axis=0)).sum(axis=0)
        return np.asarray(np.where(self._prismatic, along, turning))

    @cached_property
    def _axes(self) -> Array:
        """Of the joints, in their child frames, shape (3, n)."""
        return np.array([joint.axis for joint in self.robot.joints]).T

    @cached_property
    def _prismatic(self) -> npt.NDArray[np.bool_]:
        return np.array([one.kind is JointKind.PRISMATIC for one in self.robot.joints])

"""Between Pinocchio's state and MuJoCo's.

The plant's own coordinates are the logged channels and their *rates*: per degree of freedom, the derivative of the
channel, and for a rotation its body angular velocity. They differ from Pinocchio's velocities where a joint translates
and rotates (planar, free-flyer): Pinocchio has that linear velocity in the moving frame, MuJoCo's slides in the fixed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from casysid.arrays import Array
from casysid.robot import Joint, JointKind, Robot
from casysid.robot.coordinates import configuration_from_channels

_ROTATING = {JointKind.SPHERICAL: 0, JointKind.FREE_FLYER: 3}  # where among its channels and rates the rotation begins
_MOVING_FRAME = {
    JointKind.PLANAR: 2,
    JointKind.FREE_FLYER: 3,
}  # how many linear velocities Pinocchio has in the moving frame


@dataclass(frozen=True, eq=False)
class Coordinates:
    """A robot's channels and rates (see the module), and their Pinocchio counterparts.

    Attributes:
        robot: Whose they are.
    """

    robot: Robot

    @cached_property
    def plain(self) -> bool:
        """Whether channels and rates are Pinocchio's own coordinates."""
        return self.robot.nq == self.robot.nv == len(self.robot.channels)

    @cached_property
    def additive(self) -> tuple[Any, Any]:
        """The channels that are not part of a quaternion, and the rates that belong to them, as indices."""
        channels: list[int] = []
        rates: list[int] = []
        for joint in self.robot.joints:
            count = _ROTATING.get(joint.kind, joint.v.stop - joint.v.start)
            channels += range(joint.channels.start, joint.channels.start + count)
            rates += range(joint.v.start, joint.v.start + count)
        return np.array(channels, dtype=int), np.array(rates, dtype=int)

    @cached_property
    def rotations(self) -> tuple[tuple[slice, slice], ...]:
        """Channels and rates of every quaternion."""
        return tuple(
            (slice(joint.channels.stop - 4, joint.channels.stop), slice(joint.v.stop - 3, joint.v.stop))
            for joint in self.robot.joints
            if joint.kind in _ROTATING
        )

    def moved(self, channels: Array, displacement: Array) -> Array:
        """Channels (..., channels) after a displacement (..., nv): rates times time."""
        if self.plain:
            return channels + displacement
        result = channels.copy()
        at, by = self.additive
        result[..., at] += displacement[..., by]
        for at_quaternion, by_rotation in self.rotations:
            start = Rotation.from_quat(channels[..., at_quaternion].reshape(-1, 4))
            turned = start * Rotation.from_rotvec(displacement[..., by_rotation].reshape(-1, 3))
            result[..., at_quaternion] = turned.as_quat().reshape(channels[..., at_quaternion].shape)
        return result

    def displacement(self, start: Array, stop: Array) -> Array:
        """The shortest displacement (nv,) from channels ``start`` to ``stop``, each (channels,)."""
        if self.plain:
            return stop - start
        result = np.empty(self.robot.nv)
        at, by = self.additive
        result[by] = stop[at] - start[at]
        for at_quaternion, by_rotation in self.rotations:
            turn = Rotation.from_quat(start[at_quaternion]).inv() * Rotation.from_quat(stop[at_quaternion])
            result[by_rotation] = turn.as_rotvec()
        return result

    def configuration(self, channels: Array) -> Array:
        """Pinocchio's q (nq,) of channels (channels,)."""
        return channels if self.plain else np.asarray(configuration_from_channels(self.robot, channels[None])[0])

    def velocity(self, channels: Array, rates: Array) -> Array:
        """Pinocchio's v (..., nv)."""
        return self._into_moving_frame(channels, rates)

    def rates(self, channels: Array, velocity: Array) -> Array:
        """What :meth:`velocity` came from."""
        return self._into_moving_frame(channels, velocity, back=True)

    def acceleration(self, channels: Array, rates: Array, change: Array) -> Array:
        """Pinocchio's a (..., nv), of the rates' change in time: ``Rᵀ p̈ - ω × v`` for a moving frame."""
        result = self._into_moving_frame(channels, change)
        if result is change:
            return change
        v = self.velocity(channels, rates)
        for joint in self.robot.joints:
            if joint.kind in _MOVING_FRAME:
                linear = slice(joint.v.start, joint.v.start + _MOVING_FRAME[joint.kind])
                w = v[..., linear.stop : joint.v.stop]
                result[..., linear] -= _cross(w, v[..., linear])
        return result

    def force(self, channels: Array, torque: Array) -> Array:
        """Pinocchio's tau (..., nv) of the forces along the rates."""
        return self._into_moving_frame(channels, torque)

    def force_along_rates(self, channels: Array, tau: Array) -> Array:
        """What :meth:`force` came from."""
        return self._into_moving_frame(channels, tau, back=True)

    def error(self, q: Array, q_reference: Array) -> Array:
        """From q (nq,) to the reference, in Pinocchio's velocity coordinates (nv,)."""
        return q_reference - q if self.plain else np.asarray(pin.difference(self.robot.model, q, q_reference))

    def _into_moving_frame(self, channels: Array, vectors: Array, *, back: bool = False) -> Array:
        if self.plain or not any(joint.kind in _MOVING_FRAME for joint in self.robot.joints):
            return vectors
        result = vectors.copy()
        for joint in self.robot.joints:
            if joint.kind in _MOVING_FRAME:
                linear = slice(joint.v.start, joint.v.start + _MOVING_FRAME[joint.kind])
                turn = _orientation(joint, channels)
                spec = "...ij,...j->...i" if back else "...ji,...j->...i"
                result[..., linear] = np.einsum(spec, turn, vectors[..., linear])
        return result


def _orientation(joint: Joint, channels: Array) -> Array:
    """Rotation from the moving frame to the fixed one, (..., 2, 2) for a planar joint, (..., 3, 3) for a free-flyer."""
    x = channels[..., joint.channels]
    if joint.kind is JointKind.PLANAR:
        c, s = np.cos(x[..., 2]), np.sin(x[..., 2])
        return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    return np.asarray(Rotation.from_quat(x[..., 3:].reshape(-1, 4)).as_matrix()).reshape(*x.shape[:-1], 3, 3)


def _cross(w: Array, v: Array) -> Array:
    """``ω × v``, in the plane for a single ω."""
    if w.shape[-1] == 1:
        return np.concatenate([-w * v[..., 1:2], w * v[..., 0:1]], axis=-1)
    return np.cross(w, v)

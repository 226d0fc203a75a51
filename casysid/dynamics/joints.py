"""What each kind of joint does: where it puts its child, and which motions it allows.

Pinocchio's conventions: quaternions ``x y z w``, continuous joints ``(cos, sin)``, planar joints ``(x, y, cos,
sin)``; velocities of spherical, planar and free-flyer joints in the child's frame, linear before angular.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from casysid.arrays import Array
from casysid.robot import Joint, JointKind

ROUNDING = 1e-14  # a placement's entries below this are rounding of exact zeros, and zeros keep the expressions sparse


class Placement(NamedTuple):
    """Pose of a frame: ``rotation`` (3, 3) and ``translation`` (3,) [m] take its coordinates to the outer frame's."""

    rotation: Any
    translation: Any

    def __matmul__(self, inner: Placement) -> Placement:
        """The pose of a frame that is given in this one."""
        return Placement(self.rotation @ inner.rotation, self.translation + self.rotation @ inner.translation)


def joint_placement(joint: Joint, q: Any) -> Placement:
    """Pose of the joint's child frame in the parent joint's frame, at the robot's configuration ``q`` (nq,)."""
    fixed = Placement(constant(joint.placement.rotation), constant(joint.placement.translation))
    return fixed @ _joint_motion(joint, q[joint.q])


def motion_subspace(joint: Joint) -> tuple[Array, Array]:
    """Linear and angular rows, shape (3, nv of the joint), of the constant motion subspace in the child's frame."""
    identity, none = np.eye(3), np.zeros((3, 3))
    match joint.kind:
        case JointKind.REVOLUTE | JointKind.CONTINUOUS:
            return none[:, :1], joint.axis[:, None]
        case JointKind.PRISMATIC:
            return joint.axis[:, None], none[:, :1]
        case JointKind.SPHERICAL:
            return none, identity
        case JointKind.PLANAR:
            return np.hstack([identity[:, :2], none[:, :1]]), np.hstack([none[:, :2], identity[:, 2:]])
        case JointKind.FREE_FLYER:
            return np.hstack([identity, none]), np.hstack([none, identity])


def constant(values: Any) -> Any:
    """A constant CasADi matrix without the entries that are zero up to rounding."""
    array = np.array(values, dtype=np.float64)
    array[np.abs(array) < ROUNDING] = 0.0
    return ca.sparsify(ca.SX(array))


def skew(vector: Any) -> Any:
    """The matrix of the cross product, ``skew(a) b = a × b``; entries that are zero stay structurally zero."""
    x, y, z = vector[0], vector[1], vector[2]
    return ca.sparsify(ca.vertcat(ca.horzcat(0, -z, y), ca.horzcat(z, 0, -x), ca.horzcat(-y, x, 0)))


def _joint_motion(joint: Joint, q: Any) -> Placement:
    """Pose of the child frame in the joint's own frame, at the joint's coordinates."""
    still, origin = ca.SX.eye(3), ca.SX(3, 1)
    match joint.kind:
        case JointKind.REVOLUTE:
            return Placement(_rotation_about(joint.axis, ca.cos(q), ca.sin(q)), origin)
        case JointKind.CONTINUOUS:
            return Placement(_rotation_about(joint.axis, q[0], q[1]), origin)
        case JointKind.PRISMATIC:
            return Placement(still, constant(joint.axis) * q)
        case JointKind.SPHERICAL:
            return Placement(_rotation_of_quaternion(q), origin)
        case JointKind.PLANAR:
            return Placement(_rotation_about(np.array([0.0, 0.0, 1.0]), q[2], q[3]), ca.vertcat(q[0], q[1], 0))
        case JointKind.FREE_FLYER:
            return Placement(_rotation_of_quaternion(q[3:]), q[:3])


def _rotation_about(axis: Array, cosine: Any, sine: Any) -> Any:
    """Rodrigues' formula, ``c 1 + s skew(axis) + (1 - c) axis axisᵀ``."""
    unit = constant(axis)
    return ca.sparsify(cosine * (ca.SX.eye(3) - unit @ unit.T) + sine * skew(unit) + unit @ unit.T)


def _rotation_of_quaternion(quaternion: Any) -> Any:
    """Rotation matrix of a unit quaternion ``x y z w``."""
    x, y, z, w = (quaternion[i] for i in range(4))
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        ca.horzcat(2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        ca.horzcat(2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )

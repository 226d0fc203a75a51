"""Logged channels to Pinocchio's state and back.

A log has one angle for a continuous joint, three numbers for a planar one, quaternions for spherical joints and free
bases; derivatives are those of the channels. Pinocchio wants (cos, sin), body angular velocity, and the linear velocity
of a free base in its own frame.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.robot.model import Joint, JointKind, Robot

State = tuple[Array, Array, Array]


def state_from_channels(robot: Robot, position: npt.ArrayLike, first: npt.ArrayLike, second: npt.ArrayLike) -> State:
    """Pinocchio's configuration, velocity and acceleration at every sample.

    Args:
        robot: Says what the channels are.
        position: Positions as logged, shape (N, channels). Quaternions (x, y, z, w) need not have unit length.
        first: Their first derivatives in time, shape (N, channels).
        second: Their second derivatives in time, shape (N, channels).

    Returns:
        q (N, nq), v (N, nv), a (N, nv). The arguments themselves where channels are Pinocchio's
        coordinates.

    Raises:
        ParameterError: A shape does not fit, or a quaternion is zero.
    """
    p, p1, p2 = (_checked(robot, values) for values in (position, first, second))
    if not len(p) == len(p1) == len(p2):
        raise ParameterError(f"position, first and second: samples must agree; got {len(p)}, {len(p1)}, {len(p2)}")
    if _is_plain(robot):
        return p, p1, p2
    v, a = np.empty((len(p), robot.nv)), np.empty((len(p), robot.nv))
    for joint in robot.joints:
        x, x1, x2 = (values[:, joint.channels] for values in (p, p1, p2))
        v[:, joint.v], a[:, joint.v] = _motion(joint, x, x1, x2)
    return configuration_from_channels(robot, p), v, a


def configuration_from_channels(robot: Robot, position: npt.ArrayLike) -> Array:
    """Pinocchio's configuration, shape (N, nq), for logged positions (N, channels); quaternions become units.

    Raises:
        ParameterError: The shape does not fit, or a quaternion is zero.
    """
    p = _checked(robot, position)
    if _is_plain(robot):
        return p
    q = np.empty((len(p), robot.nq))
    for joint in robot.joints:
        x = p[:, joint.channels]
        match joint.kind:
            case JointKind.CONTINUOUS:
                q[:, joint.q] = np.hstack([np.cos(x), np.sin(x)])
            case JointKind.PLANAR:
                q[:, joint.q] = np.column_stack([x[:, :2], np.cos(x[:, 2]), np.sin(x[:, 2])])
            case JointKind.SPHERICAL:
                q[:, joint.q] = _unit(joint, x)
            case JointKind.FREE_FLYER:
                q[:, joint.q] = np.hstack([x[:, :3], _unit(joint, x[:, 3:])])
            case _:
                q[:, joint.q] = x
    return q


def channels_from_configuration(robot: Robot, q: npt.ArrayLike) -> Array:
    """Positions as a log has them, shape (N, channels), for Pinocchio's configuration (N, nq); angles in (-π, π].

    Raises:
        ParameterError: The shape does not fit.
    """
    q = np.asarray(q, dtype=np.float64)
    if q.ndim != 2 or q.shape[1] != robot.nq:
        raise ParameterError(f"q: wanted shape (N, {robot.nq}) for robot '{robot.name}'; got {q.shape}")
    if _is_plain(robot):
        return q
    p = np.empty((len(q), len(robot.channels)))
    for joint in robot.joints:
        x = q[:, joint.q]
        if joint.kind is JointKind.CONTINUOUS:
            p[:, joint.channels] = np.arctan2(x[:, 1:], x[:, :1])
        elif joint.kind is JointKind.PLANAR:
            p[:, joint.channels] = np.column_stack([x[:, :2], np.arctan2(x[:, 3], x[:, 2])])
        else:
            p[:, joint.channels] = x
    return p


def _is_plain(robot: Robot) -> bool:
    """Whether channels and configuration are the same: revolute joints within limits and prismatic ones only."""
    return robot.nq == robot.nv == len(robot.channels)


def _checked(robot: Robot, values: npt.ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != len(robot.channels):
        raise ParameterError(
            f"wanted shape (N, {len(robot.channels)}) for the channels {', '.join(robot.channels)}; got {array.shape}"
        )
    return array


def _unit(joint: Joint, p: Array) -> Array:
    length = np.linalg.norm(p, axis=1, keepdims=True)
    if (length == 0.0).any():
        raise ParameterError(f"joint '{joint.name}': the quaternion of sample {int(np.argmin(length))} is zero")
    return np.asarray(p / length)


def _motion(joint: Joint, x: Array, x1: Array, x2: Array) -> tuple[Array, Array]:
    """Pinocchio's velocity and acceleration of one joint."""
    if joint.kind is JointKind.SPHERICAL:
        return _rotation_rates(joint, x, x1, x2)
    if joint.kind is JointKind.FREE_FLYER:
        w, dw = _rotation_rates(joint, x[:, 3:], x1[:, 3:], x2[:, 3:])
        unit = _unit(joint, x[:, 3:])
        v = _into_body(unit, x1[:, :3])
        dv = _into_body(unit, x2[:, :3]) - np.cross(w, v)
        return np.hstack([v, w]), np.hstack([dv, dw])
    if joint.kind is JointKind.PLANAR:
        c, s, w = np.cos(x[:, 2]), np.sin(x[:, 2]), x1[:, 2]
        vx, vy = c * x1[:, 0] + s * x1[:, 1], c * x1[:, 1] - s * x1[:, 0]
        ax, ay = c * x2[:, 0] + s * x2[:, 1], c * x2[:, 1] - s * x2[:, 0]
        return np.column_stack([vx, vy, w]), np.column_stack([ax + w * vy, ay - w * vx, x2[:, 2]])
    return x1, x2


def _rotation_rates(joint: Joint, p: Array, p1: Array, p2: Array) -> tuple[Array, Array]:
    """Body angular velocity and acceleration of the rotation ``p / |p|``.

    With the quaternion product p* ṗ, ``ω = 2 vec(p* ṗ) / |p|²``; differentiated, as ``vec(ṗ* ṗ) = 0``,
    ``α = 2 vec(p* p̈) / |p|² - 4 (p·ṗ) vec(p* ṗ) / |p|⁴``.
    """
    _unit(joint, p)
    square = np.sum(p * p, axis=1, keepdims=True)
    slope = np.sum(p * p1, axis=1, keepdims=True)
    w = 2.0 * _vector_of_product(p, p1) / square
    return w, 2.0 * _vector_of_product(p, p2) / square - 2.0 * slope * w / square


def _vector_of_product(p: Array, r: Array) -> Array:
    """Vector part of the quaternion product ``p* r``, both (x, y, z, w), shape (N, 3)."""
    u, n = p[:, :3], r[:, :3]
    return np.asarray(p[:, 3:] * n - r[:, 3:] * u - np.cross(u, n))


def _into_body(unit: Array, x: Array) -> Array:
    """Vectors (N, 3) of the outer frame in the rotated one, ``Rᵀ x``."""
    u = unit[:, :3]
    t = 2.0 * np.cross(u, x)
    return np.asarray(x - unit[:, 3:] * t + np.cross(u, t))

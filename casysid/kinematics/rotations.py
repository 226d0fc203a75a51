"""Rotation matrices, unit quaternions, roll-pitch-yaw angles and rotation vectors, one or many at once.

Quaternions are (x, y, z, w) with w ≥ 0. Roll, pitch and yaw are those of URDF, ``R = Rz(yaw) Ry(pitch) Rx(roll)``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError

_SMALL = 1e-4  # of an angle or sine: below it series are exact to rounding, their next term is 1e-16


def quaternion_from_rotation(rotation: npt.ArrayLike) -> Array:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3).

    Source: Shepperd, "Quaternion from rotation matrix", Journal of Guidance and Control 1 (1978).
    """
    R = np.asarray(rotation, dtype=np.float64)
    trace = R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2]
    K = np.empty((*R.shape[:-2], 4, 4))  # 4 p pᵀ
    for i in range(3):
        K[..., i, i] = 1.0 + 2.0 * R[..., i, i] - trace
        j, k = (i + 1) % 3, (i + 2) % 3
        K[..., j, k] = K[..., k, j] = R[..., j, k] + R[..., k, j]
        K[..., i, 3] = K[..., 3, i] = R[..., k, j] - R[..., j, k]
    K[..., 3, 3] = 1.0 + trace
    best = np.argmax(np.diagonal(K, axis1=-2, axis2=-1), axis=-1)
    p = np.take_along_axis(K, best[..., None, None], axis=-2)[..., 0, :]
    p = p / np.linalg.norm(p, axis=-1, keepdims=True)
    return np.asarray(np.where(p[..., 3:] < 0.0, -p, p))


def rotation_from_quaternion(quaternion: npt.ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), which need not have unit length.

    Raises:
        ParameterError: A quaternion is zero or not finite.
    """
    p = np.asarray(quaternion, dtype=np.float64)
    length = np.linalg.norm(p, axis=-1, keepdims=True)
    if p.shape[-1:] != (4,) or not (np.isfinite(length).all() and (length > 0.0).all()):
        raise ParameterError(f"quaternion: wanted four finite numbers (x, y, z, w), not all zero; got {p}")
    p = p / length
    K = _skew(p[..., :3])
    return np.asarray(np.eye(3) + 2.0 * p[..., 3, None, None] * K + 2.0 * K @ K)


def rotation_from_rpy(rpy: npt.ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of roll, pitch and yaw (..., 3), [rad]."""
    angles = np.asarray(rpy, dtype=np.float64)
    x, y, z = (rotation_from_vector(angles[..., i, None] * np.eye(3)[i]) for i in range(3))
    return np.asarray(z @ y @ x)


def rpy_from_rotation(rotation: npt.ArrayLike) -> Array:
    """Roll, pitch and yaw (..., 3), [rad], of rotations (..., 3, 3); pitch in [-π/2, π/2], roll 0 at its ends."""
    R = np.asarray(rotation, dtype=np.float64)
    level = np.hypot(R[..., 0, 0], R[..., 1, 0])
    upright = level < _SMALL * _SMALL  # gimbal lock, up to rounding: only roll ± yaw is there
    pitch = np.arctan2(-R[..., 2, 0], level)
    roll = np.where(upright, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    yaw = np.where(upright, np.arctan2(-R[..., 0, 1], R[..., 1, 1]), np.arctan2(R[..., 1, 0], R[..., 0, 0]))
    return np.stack([roll, pitch, yaw], axis=-1)


def rotation_from_vector(vector: npt.ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) about vectors (..., 3) by their length [rad] (Rodrigues)."""
    v = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    K, tiny = _skew(v), angle < _SMALL
    safe = np.where(tiny, 1.0, angle)
    sine = np.where(tiny, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    versine = np.where(tiny, 0.5 - angle**2 / 24.0, 2.0 * (np.sin(safe / 2.0) / safe) ** 2)
    return np.asarray(np.eye(3) + sine * K + versine * (K @ K))


def vector_from_rotation(rotation: npt.ArrayLike) -> Array:
    """The shortest rotation vectors (..., 3), [rad], of rotation matrices (..., 3, 3); length in [0, π]."""
    p = quaternion_from_rotation(rotation)
    sine = np.linalg.norm(p[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, p[..., 3:])
    scale = np.where(sine < _SMALL, 2.0 + sine**2 / 3.0, angle / np.where(sine < _SMALL, 1.0, sine))
    return np.asarray(scale * p[..., :3])


def _skew(v: Array) -> Array:
    K = np.zeros((*v.shape[:-1], 3, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = v[..., 0], v[..., 1], v[..., 2]
    return np.asarray(K - np.swapaxes(K, -1, -2))

"""Random configurations within the joints' limits."""

from __future__ import annotations

import numpy as np

from casysid.arrays import Array
from casysid.robot import Joint, JointKind, Robot

FREE_RANGE = np.pi
"""Half the range of a joint without position limits: a turn in all [rad]; as many metres where it slides."""


def random_configurations(robot: Robot, rng: np.random.Generator, samples: int) -> Array:
    """Configurations (N, nq): joints uniform within their limits, rotations uniform, floating bases near the origin."""
    q = np.empty((samples, robot.nq))
    for joint in robot.joints:
        q[:, joint.q] = _positions(robot, joint, rng, samples)
    return q


def position_range(robot: Robot, joint: Joint) -> tuple[float, float]:
    """Where a joint of one degree of freedom may be looked for: its limits, or a turn about what limits it has."""
    lower, upper = (float(limits[joint.channels][0]) for limits in (robot.position_lower, robot.position_upper))
    if np.isfinite(lower) and np.isfinite(upper):
        return lower, upper
    if np.isfinite(lower):
        return lower, lower + 2.0 * FREE_RANGE
    if np.isfinite(upper):
        return upper - 2.0 * FREE_RANGE, upper
    return -FREE_RANGE, FREE_RANGE


def _positions(robot: Robot, joint: Joint, rng: np.random.Generator, samples: int) -> Array:
    match joint.kind:
        case JointKind.SPHERICAL:
            return _unit(rng.normal(size=(samples, 4)))
        case JointKind.FREE_FLYER:
            return np.hstack([rng.normal(size=(samples, 3)), _unit(rng.normal(size=(samples, 4)))])
        case JointKind.CONTINUOUS:
            return _unit(rng.normal(size=(samples, 2)))
        case JointKind.PLANAR:
            return np.hstack([rng.normal(size=(samples, 2)), _unit(rng.normal(size=(samples, 2)))])
        case _:
            return rng.uniform(*position_range(robot, joint), (samples, 1))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))

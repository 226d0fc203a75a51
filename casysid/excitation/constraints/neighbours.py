"""Which links cannot be kept apart, as they are joined."""

from __future__ import annotations

import numpy as np

from casysid.kinematics.frames import WORLD
from casysid.robot import Robot

FIT_FAULT = 0.5
"""Shapes that overlap in more than this share of all configurations do so because they are thicker than the links."""
_NEAR = 1e-4  # [m] below this, two joint frames count as one place


def are_neighbours(robot: Robot, one: int, other: int) -> bool:
    """Whether two links are the same, or joined by a joint, or by several joints in one place."""
    if one == other:
        return True
    return (
        _attached_to(robot, one) == other
        or _attached_to(robot, other) == one
        or (one != WORLD and other != WORLD and _touch(robot, one, other))
    )


def _touch(robot: Robot, one: int, other: int) -> bool:
    """Whether the later link hangs at the earlier one by joints whose frames coincide."""
    low, high = sorted((one, other))
    at = high
    while at != WORLD and at > low:
        joint = robot.joints[at]
        if joint.parent == low:
            return True
        if float(np.linalg.norm(joint.placement.translation)) > _NEAR:
            return False
        at = joint.parent
    return False


def _attached_to(robot: Robot, joint: int) -> int | None:
    return None if joint == WORLD else robot.joints[joint].parent

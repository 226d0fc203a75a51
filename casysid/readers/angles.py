"""Angles that were logged modulo a turn, and quaternions that are none."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from casysid.errors import RecordingError
from casysid.readers.columns import listing
from casysid.recording import Recording
from casysid.robot import Joint, JointKind, Robot

TURN = 2.0 * math.pi
RARELY = 0.05  # of the steps: more whole turns than this are no wrapping


def angle_joints(robot: Robot) -> tuple[Joint, ...]:
    """The joints whose one channel is an angle."""
    return tuple(joint for joint in robot.joints if joint.kind in (JointKind.REVOLUTE, JointKind.CONTINUOUS))


def check_quaternions(recording: Recording, robot: Robot) -> None:
    """Refuse orientations whose quaternions are not of unit length within 1 %.

    Raises:
        RecordingError: Naming the joint.
    """
    for joint in robot.joints:
        if joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER):
            norms = np.linalg.norm(recording.position[:, joint.channels][:, -4:], axis=1)
            worst = int(np.argmax(np.abs(norms - 1.0)))
            if abs(norms[worst] - 1.0) > 0.01:
                names = recording.channels[joint.channels][-4:]
                raise RecordingError(
                    f"{recording.label}: the quaternion of '{joint.name}' ({listing(names)}) has length "
                    f"{norms[worst]:.4g} in sample {worst + 1}, wanted 1; check which columns they are (w comes last)"
                )


def unwrap_angles(recording: Recording, robot: Robot) -> tuple[Recording, tuple[str, ...]]:
    """The recording with steps of a whole turn taken out of its angles, and a sentence about that if there were any.

    A joint at ``q`` and at ``q + 2π`` is in the same place, so this changes no dynamics; left in, each step would be a
    huge velocity.
    """
    if recording.time is None:
        return recording, ()
    position, wrapped = recording.position.copy(), []
    for joint in angle_joints(robot):
        steps = np.diff(position[:, joint.channels.start])
        turns = np.where(np.abs(np.abs(steps) - TURN) < 0.5, np.sign(steps), 0.0)
        count = int(np.count_nonzero(turns))
        if 0 < count <= RARELY * len(steps):
            position[1:, joint.channels.start] -= TURN * np.cumsum(turns)
            wrapped.append(f"{joint.name} ({count} times)")
    if not wrapped:
        return recording, ()
    sentence = f"angles jump by a whole turn: {listing(wrapped)}; taken as wrapped and unwrapped"
    return dataclasses.replace(recording, position=position), (sentence,)

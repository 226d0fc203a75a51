"""Angles that were logged modulo a turn, and quaternions that are none."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.columns import listing
from casysid.recording import Recording
from casysid.robot import Joint, JointKind, Robot

if TYPE_CHECKING:
    from casysid.readers.statistics import Statistics

TURN = 2.0 * math.pi
RARELY = 0.05  # of the steps: more whole turns than this are no wrapping
NEAR = 0.5  # [rad]: a step so near to a turn is one


def angle_joints(robot: Robot) -> tuple[Joint, ...]:
    """The joints whose one channel is an angle."""
    return tuple(joint for joint in robot.joints if joint.kind in (JointKind.REVOLUTE, JointKind.CONTINUOUS))


def check_quaternions(statistics: Statistics, robot: Robot) -> None:
    """Refuse orientations whose quaternions are not of unit length within 1 %.

    Raises:
        RecordingError: Naming the joint.
    """
    for joint in robot.joints:
        if joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER):
            length, row = statistics.worst_quaternion[joint.name]
            if abs(length - 1.0) > 0.01:
                names = robot.channels[joint.channels][-4:]
                raise RecordingError(
                    f"{statistics.label}: the quaternion of '{joint.name}' ({listing(names)}) has length "
                    f"{length:.4g} in sample {row + 1}, wanted 1; check which columns they are (w comes last)"
                )


def whole_turns(steps: Array, channels: Sequence[int]) -> Array:
    """Which steps, shape (N, n), of these channels are about a turn long: 1 or -1 there, and 0 elsewhere."""
    turns = np.zeros(steps.shape)
    for channel in channels:
        step = steps[:, channel]
        if max(step.max(initial=0.0), -step.min(initial=0.0)) > TURN - NEAR:
            turns[:, channel] = np.where(np.abs(np.abs(step) - TURN) < NEAR, np.sign(step), 0.0)
    return turns


def unwrapped_sentences(statistics: Statistics, robot: Robot) -> tuple[str, ...]:
    """A sentence about wrapped angles, if there are any.

    A joint at ``q`` and at ``q + 2π`` is in the same place, so taking the turns out changes no dynamics; left in, each
    step would be a huge velocity.
    """
    places = [(joint.name, joint.channels.start) for joint in angle_joints(robot)]
    wrapped = [f"{name} ({statistics.turns[k]} times)" for name, k in places if statistics.unwrapped[k]]
    return (f"angles jump by a whole turn: {listing(wrapped)}; taken as wrapped and unwrapped",) if wrapped else ()


def unwrap(batches: Iterable[Recording], channels: Sequence[int]) -> Iterator[Recording]:
    """Consecutive batches from the first on, the whole turns of some channels taken out."""
    last: Array | None = None
    turned: Array | float = 0.0
    for batch in batches:
        before = batch.position[:1] if last is None else last
        steps = np.diff(batch.position, axis=0, prepend=before)
        turns = turned + np.cumsum(whole_turns(steps, channels), axis=0)
        last, turned = batch.position[-1:], turns[-1]
        yield batch.with_position(batch.position - TURN * turns)

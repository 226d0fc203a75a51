"""Angles that were logged modulo a turn."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from casysid.arrays import Array
from casysid.recording.recording import Recording
from casysid.robot import Joint, JointKind, Robot

TURN = 2.0 * math.pi
RARELY = 0.05  # of the steps: more whole turns than this are no wrapping
NEAR = 0.5  # [rad]: a step so near to a turn is one


def angle_joints(robot: Robot) -> tuple[Joint, ...]:
    """The joints whose one channel is an angle."""
    return tuple(joint for joint in robot.joints if joint.kind in (JointKind.REVOLUTE, JointKind.CONTINUOUS))


def whole_turns(steps: Array, channels: Sequence[int]) -> Array:
    """Which steps, shape (N, n), of these channels are about a turn long: 1 or -1 there, and 0 elsewhere."""
    turns = np.zeros(steps.shape)
    for channel in channels:
        step = steps[:, channel]
        if max(step.max(initial=0.0), -step.min(initial=0.0)) > TURN - NEAR:
            turns[:, channel] = np.where(np.abs(np.abs(step) - TURN) < NEAR, np.sign(step), 0.0)
    return turns


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

"""Joints that are locked in the model against what a log shows of them: whether they rest, and where."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from casysid.errors import CasysidWarning
from casysid.robot import Robot
from casysid.robot.locking import lock_words

NOTICEABLE = 0.02
"""[rad or m]: a degree; less than that lets gravity's torque change by a fiftieth at most."""


def held_joint_remark(path: Path, robot: Robot) -> str:
    """What contradicts the locks in a log that has a position of locked joints; empty when nothing does.

    Raises:
        RecordingError: The file cannot be read.
    """
    from casysid.readers.candidates import POSITION
    from casysid.readers.table import open_table

    if not robot.locked:
        return ""
    table = open_table(path)
    columns = {
        f"{spelling}_{name}": (name, value)
        for name, value in robot.locked
        for spelling in POSITION.named
        if f"{spelling}_{name}" in table.names
    }
    ranges = dict.fromkeys(columns, (math.inf, -math.inf))
    for batch in table.batches(tuple(columns)) if columns else ():
        for column, (low, high) in ranges.items():
            seen = batch[column][np.isfinite(batch[column])]
            ranges[column] = min(low, seen.min(initial=low)), max(high, seen.max(initial=high))
    moving, elsewhere, right = [], [], dict[str, float]()
    for column, (low, high) in ranges.items():
        name, value = columns[column]
        if high - low > NOTICEABLE:
            moving.append(f"{column} moves by {high - low:.3g}")
        elif low <= high and abs(0.5 * (low + high) - value) > NOTICEABLE:
            elsewhere.append(f"{column} rests at {0.5 * (low + high):.4g}, not at {value:g}")
            right[name] = float(f"{0.5 * (low + high):.4g}")
    words = []
    if moving:
        words.append(f"{', '.join(moving)}: what a locked joint carries is then told wrongly; do not lock it")
    if elsewhere:
        words.append(f"{', '.join(elsewhere)}: {lock_words(right)}")
    return f"{path}: locked joints are not where they are locked: {'; '.join(words)}" if words else ""


def warn_of_held_joints(paths: Sequence[Path], robot: Robot, *, stacklevel: int = 2) -> None:
    """One :class:`CasysidWarning` for each log that contradicts the robot's locks."""
    for path in paths:
        if remark := held_joint_remark(path, robot):
            warnings.warn(remark, CasysidWarning, stacklevel=stacklevel + 1)

"""Joints that are held: what they carry becomes part of the link before them."""

from __future__ import annotations

import math
import shlex
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import pinocchio as pin

from casysid.errors import RobotError
from casysid.robot.limits import LARGEST

_NUMBERED = "\x1f"  # parts a frame's number from its name; no XML text can hold it


def lockable_values(
    locked: Mapping[str, float] | None, joints: Collection[str], source: Path
) -> tuple[tuple[str, float], ...]:
    """The joints to lock with their positions, checked.

    Raises:
        RobotError: A name is not among ``joints``, or a position is not a finite number.
    """
    held = []
    for name, value in (locked or {}).items():
        if name not in joints:
            raise RobotError(f"{source}: locked joint '{name}' does not exist; moving joints: {', '.join(joints)}")
        try:
            position = float(value)
        except (TypeError, ValueError) as error:
            raise RobotError(f"{source}: locked joint '{name}': wanted a position [rad or m]; got {value!r}") from error
        if not abs(position) <= LARGEST:
            raise RobotError(
                f"{source}: locked joint '{name}': wanted a finite position below {LARGEST:g} [rad or m]; got {value!r}"
            )
        held.append((name, position))
    return tuple(held)


def lock_words(positions: Mapping[str, float]) -> str:
    """What to write on the command line to lock joints, ready to copy."""
    return " ".join(f"--lock {shlex.quote(f'{name}={value:g}')}" for name, value in positions.items())


def lock_joints(model: Any, held: Sequence[tuple[str, float]], source: Path) -> Any:
    """The ``pin.Model`` without the held joints.

    Raises:
        RobotError: A held joint has more than one degree of freedom.
    """
    if not held:
        return model
    configuration = pin.neutral(model)
    for name, position in held:
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1:
            raise RobotError(f"{source}: joint '{name}' cannot be locked: only joints with one degree of freedom can")
        values = [position] if joint.nq == 1 else [math.cos(position), math.sin(position)]
        configuration[joint.idx_q : joint.idx_q + joint.nq] = values
    numbered = _with_frames_numbered(model)
    reduced = pin.buildReducedModel(numbered, [model.getJointId(name) for name, _ in held], configuration)
    for frame in reduced.frames:
        frame.name = frame.name.partition(_NUMBERED)[2] or frame.name
    return reduced


def _with_frames_numbered(model: Any) -> Any:
    """The model with names of frames that are unique: Pinocchio looks for those of links and fixed joints by name."""
    numbered = model.copy()
    for k, frame in enumerate(numbered.frames):
        if frame.type != pin.FrameType.JOINT and k > 0:
            frame.name = f"{k}{_NUMBERED}{frame.name}"
    return numbered

"""Frames that can be asked for by name: links and bodies, fixed ones included, sites, cameras, joints."""

from __future__ import annotations

import difflib
import enum
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.robot import Robot

WORLD = -1
"""Instead of a joint's index: what does not move."""
_TOLD = 12  # names in a message


class FrameKind(enum.Enum):
    """What a frame belongs to; where names are the same, the first in this order is meant."""

    LINK = "link"
    SITE = "site"
    CAMERA = "camera"
    JOINT = "joint"


_KINDS = {
    pin.FrameType.BODY: FrameKind.LINK,
    pin.FrameType.OP_FRAME: FrameKind.SITE,
    pin.FrameType.SENSOR: FrameKind.CAMERA,
    pin.FrameType.JOINT: FrameKind.JOINT,
    pin.FrameType.FIXED_JOINT: FrameKind.JOINT,
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """A frame that moves with a joint.

    Attributes:
        name: As in the file, or one's own.
        joint: Index in ``robot.joints`` of the joint that moves it, -1 for the world.
        rotation: Takes its coordinates to the joint's child frame's, shape (3, 3).
        translation: Its origin in the joint's child frame, shape (3,), [m].
        kind: What it belongs to.

    Raises:
        ParameterError: The rotation is none, or a number is not finite.
    """

    name: str
    joint: int
    rotation: Array
    translation: Array
    kind: FrameKind = FrameKind.SITE

    def __post_init__(self) -> None:
        R, t = frozen(self.rotation), frozen(self.translation)
        if R.shape != (3, 3) or t.shape != (3,) or not (np.isfinite(R).all() and np.isfinite(t).all()):
            raise ParameterError(
                f"frame '{self.name}': wanted a rotation (3, 3) and a translation (3,) of finite numbers; "
                f"got shapes {R.shape} and {t.shape}"
            )
        if not np.allclose(R.T @ R, np.eye(3), rtol=0.0, atol=1e-6) or np.linalg.det(R) < 0.0:
            raise ParameterError(f"frame '{self.name}': its rotation is no rotation matrix: {R.tolist()}")
        object.__setattr__(self, "rotation", R)
        object.__setattr__(self, "translation", t)


def frames_of(robot: Robot) -> tuple[Frame, ...]:
    """All named frames of a robot, each name once: links first, then sites, cameras and joints, in the file's order."""
    found = [
        Frame(
            name=str(frame.name),
            joint=int(frame.parentJoint) - 1,
            rotation=frame.placement.rotation,
            translation=frame.placement.translation,
            kind=_KINDS[frame.type],
        )
        for frame in robot.model.frames
        if frame.name != "universe"
    ]
    for i, joint in enumerate(robot.joints):  # models built in memory have no frames of their own
        for name, kind in ((joint.link, FrameKind.LINK), (joint.name, FrameKind.JOINT)):
            if name is not None:
                found.append(Frame(name=name, joint=i, rotation=np.eye(3), translation=np.zeros(3), kind=kind))
    first: dict[str, Frame] = {}
    for kind in FrameKind:
        for frame in found:
            if frame.kind is kind:
                first.setdefault(frame.name, frame)
    return tuple(first.values())


def find_frame(robot: Robot, name: str) -> Frame:
    """The frame of that name.

    Raises:
        ParameterError: There is none; the message names those nearest to it.
    """
    frames = {frame.name: frame for frame in frames_of(robot)}
    if name in frames:
        return frames[name]
    near = difflib.get_close_matches(name, frames, n=3)
    hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
    listed = ", ".join(list(frames)[:_TOLD]) + (f" and {len(frames) - _TOLD} more" if len(frames) > _TOLD else "")
    raise ParameterError(f"robot '{robot.name}' has no frame '{name}'{hint}; its frames are {listed}")

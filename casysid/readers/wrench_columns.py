"""Columns of wrenches and of contact flags, and the frames that they name."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from casysid.errors import RecordingError
from casysid.readers.messages import listing
from casysid.robot import Robot

if TYPE_CHECKING:
    from casysid.kinematics import Frame

COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
_WRENCH = re.compile(rf"(world_)?({'|'.join(COMPONENTS)})_(.+)")
_CONTACT = re.compile(r"contact(?:_(.*))?")


@dataclass(frozen=True)
class WrenchColumns:
    """Columns of one wrench.

    Attributes:
        frame: Where it acts.
        in_world: Whether its components are along the world's axes.
        columns: By component; None where it is not there.
    """

    frame: str
    in_world: bool
    columns: tuple[str | None, ...]


def find_wrenches(names: Sequence[str], robot: Robot, source: str) -> tuple[WrenchColumns, ...]:
    """Wrenches among the columns of a log.

    Raises:
        RecordingError: One names a frame that the robot has not, or is given along both axes.
    """
    found: dict[tuple[str, bool], dict[str, str]] = {}
    for name in names:
        if match := _WRENCH.fullmatch(name):
            _require_frame(robot, match[3], name, source)
            found.setdefault((match[3], match[1] is not None), {})[match[2]] = name
    both = sorted(frame for frame, in_world in found if in_world and (frame, False) in found)
    if both:
        raise RecordingError(
            f"{source}: the wrench of frame '{both[0]}' is given along the world's axes and along its own; keep one"
        )
    return tuple(
        WrenchColumns(frame, in_world, tuple(columns.get(component) for component in COMPONENTS))
        for (frame, in_world), columns in found.items()
    )


def find_contacts(names: Sequence[str], robot: Robot, source: str) -> dict[str, str]:
    """Columns of contact flags by frame.

    Raises:
        RecordingError: One names a frame that the robot has not.
    """
    found = {}
    for name in names:
        if match := _CONTACT.fullmatch(name):
            if not match[1]:
                raise RecordingError(
                    f"{source}: column '{name}' says of no frame that it touches; name it contact_<frame>. Frames: "
                    f"{listing([one.name for one in _frames(robot)])}"
                )
            _require_frame(robot, match[1], name, source)
            found[match[1]] = name
    return found


def _require_frame(robot: Robot, frame: str, column: str, source: str) -> None:
    names = [one.name for one in _frames(robot)]
    if frame not in names:
        near = difflib.get_close_matches(frame, names, n=3)
        hint = f"; did you mean {listing(near)}?" if near else "."
        raise RecordingError(
            f"{source}: column '{column}': robot '{robot.name}' has no frame '{frame}'{hint} Frames: {listing(names)}"
        )


def _frames(robot: Robot) -> Sequence[Frame]:
    from casysid.kinematics import frames_of

    return frames_of(robot)

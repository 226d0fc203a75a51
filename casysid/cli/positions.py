"""Joint positions from the words of a command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from casysid.cli.ranges import checked

if TYPE_CHECKING:
    from casysid.arrays import Array
    from casysid.robot import Robot


def configuration_from_words(robot: Robot, words: list[str], *, degrees: bool = False) -> Array:
    """Pinocchio's configuration (nq,) of positions in the order of the channels, or of words CHANNEL=POSITION.

    Channels that are not named are zero, quaternions no rotation; no words are that of all.

    Raises:
        ParameterError: A word is no number or names no channel, or they are too many or too few.
    """
    import numpy as np
    import pinocchio as pin

    from casysid.errors import ParameterError
    from casysid.robot.coordinates import channels_from_configuration, configuration_from_channels

    position = np.array(channels_from_configuration(robot, pin.neutral(robot.model)[None])[0])
    channels, listed = list(robot.channels), ", ".join(robot.channels)
    options = [word for word in words if word.startswith("--")]
    if options:
        raise ParameterError(f"there is no option {options[0][:80]!r}; look at --help")
    named = [word for word in words if "=" in word]
    if named and len(named) < len(words):
        raise ParameterError(f"positions: all as CHANNEL=POSITION or none; got {' '.join(words)[:80]!r}")
    if words and not named and len(words) != len(channels):
        raise ParameterError(f"positions: wanted {len(channels)}, for {listed}; got {len(words)}")
    pairs = [word.rpartition("=")[::2] for word in words] if named else list(zip(channels, words, strict=bool(words)))
    for name, text in pairs if words else []:
        if name not in channels:
            raise ParameterError(
                f"positions: {name!r} is no channel of robot '{robot.name}'; its channels are {listed}"
            )
        position[channels.index(name)] = _number(name, text) * (_angle(robot, channels.index(name)) if degrees else 1.0)
    return np.asarray(configuration_from_channels(robot, position[None])[0])


def _angle(robot: Robot, channel: int) -> float:
    """Radians in what is given for a channel in degrees: lengths and quaternions stay as they are."""
    import math

    from casysid.robot import JointKind

    joint = next(joint for joint in robot.joints if joint.channels.start <= channel < joint.channels.stop)
    turns = joint.kind in (JointKind.REVOLUTE, JointKind.CONTINUOUS)
    planar = joint.kind is JointKind.PLANAR and channel == joint.channels.stop - 1
    return math.pi / 180.0 if turns or planar else 1.0


def _number(name: str, text: str) -> float:
    from casysid.errors import ParameterError

    try:
        value = float(text)
    except ValueError as error:
        raise ParameterError(
            f"positions: wanted a number [rad or m] for '{name}', such as 0.5 or {name}=0.5; got {text[:80]!r}"
        ) from error
    return checked("POSITION", value)

"""Where frames are, in tables for the screen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from casysid.arrays import Array
from casysid.kinematics import Dexterity, Kinematics, Pose, dexterity_at
from casysid.kinematics.frames import WORLD
from casysid.reaching import Reach, Target
from casysid.report.tables import MICROMETRES, Table, number

_SHORT = 4  # decimals in a wide table


def frame_tables(kinematics: Kinematics, q: Array) -> list[tuple[str, Table]]:
    """All frames of a robot at a configuration (nq,)."""
    joints, rows = kinematics.robot.joints, []
    for frame in kinematics.frames.values():
        pose = kinematics.poses(frame, q)
        mover = "–" if frame.joint == WORLD else joints[frame.joint].name
        numbers = [*_fixed(pose.translation, _SHORT), *_fixed(np.rad2deg(pose.rpy), 1)]
        rows.append((frame.name, frame.kind.value, mover, *numbers))
    header = ("frame", "kind", "joint", "x", "y", "z", "roll", "pitch", "yaw")
    return [("Frames in the world [m, deg], and the joints that move them", Table(header, tuple(rows)))]


def pose_tables(kinematics: Kinematics, frame: str, q: Array) -> list[tuple[str, Table]]:
    """One frame at a configuration (nq,): where it is, and how freely it can move from there."""
    return [
        (f"Pose of {frame} in the world", pose_table(kinematics.poses(frame, q))),
        (f"Motion of {frame} from here", _dexterity(dexterity_at(kinematics, frame, q))),
    ]


def pose_table(pose: Pose) -> Table:
    """A pose in all the ways that people write it."""
    rows = (
        ("position x, y, z [m]", *_fixed(pose.translation), ""),
        ("quaternion x, y, z, w", *_fixed(pose.quaternion)),
        ("roll, pitch, yaw [rad]", *_fixed(pose.rpy), ""),
        ("roll, pitch, yaw [deg]", *_fixed(np.rad2deg(pose.rpy), _SHORT), ""),
    )
    return Table(("", "", "", "", ""), rows)


def mass_tables(kinematics: Kinematics, q: Array) -> list[tuple[str, Table]]:
    """Centre of mass of what moves, by the model file; nothing where the file gives no mass."""
    masses = kinematics.robot.inertial_parameters[::10]
    if not masses.sum() > 0.0:
        return []
    row = (number(float(masses.sum())), *_fixed(kinematics.centers_of_mass(q)))
    return [("Centre of mass of the moving links", Table(("mass [kg]", "x [m]", "y [m]", "z [m]"), (row,)))]


def reach_tables(kinematics: Kinematics, targets: Sequence[Target], answer: Reach) -> list[tuple[str, Table]]:
    """The posture that was found, and how near the frames are to their targets."""
    robot = kinematics.robot
    positions = tuple(
        (name, f"{value:.9f}", number(float(low)), number(float(high)))
        for name, value, low, high in zip(
            robot.channels, answer.position + 0.0, robot.position_lower, robot.position_upper, strict=True
        )
    )
    left = tuple(
        (target.words, f"{1e3 * distance:.3g}", f"{np.rad2deg(angle):.3g}")
        for target, distance, angle in zip(targets, answer.distance, answer.angle, strict=True)
    )
    return [
        ("Joint positions [rad, m]", Table(("channel", "position", "lower limit", "upper limit"), positions)),
        ("What is left", Table(("target", "distance [mm]", "angle [deg]"), left)),
    ]


def reach_words(answer: Reach) -> tuple[str, ...]:
    """How it ended, in sentences."""
    lines = [f"{answer.status.value} (starts: {answer.starts}, steps: {answer.steps}, {number(answer.seconds, 2)} s)"]
    if np.isfinite(answer.clearance):
        lines.append(f"least distance: {number(1e3 * answer.clearance)} mm, {answer.nearest}")
    return tuple(lines)


def _dexterity(dexterity: Dexterity) -> Table:
    linear, angular = dexterity.manipulability
    rows = [
        (what, str(rank), str(usual), value)
        for what, rank, usual, value in zip(
            ("position", "rotation", "both"),
            dexterity.ranks,
            dexterity.usual,
            (number(linear), number(angular), ""),
            strict=True,
        )
    ]
    if dexterity.is_singular:
        rows.append(("singular: the frame cannot move here as it usually can", "", "", ""))
    return Table(("", "rank of the Jacobian", "usually", "manipulability"), tuple(rows))


def _fixed(values: Array, decimals: int = MICROMETRES) -> tuple[str, ...]:
    rounded = np.round(values, decimals) + 0.0  # no negative zeros
    return tuple(f"{value:.{decimals}f}" for value in rounded)

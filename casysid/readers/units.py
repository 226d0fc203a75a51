"""Units that are not SI: time in milli-, micro- or nanoseconds, angles in degrees.

Two kinds of evidence for degrees. With logged velocities, the ratio of the distance travelled to the integral of the
velocity is 1, and 57.3 when only the position is in degrees. Without, positions far outside the model's limits that
would all lie inside them if they were degrees.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from casysid.errors import RecordingError
from casysid.readers.angles import angle_joints
from casysid.readers.columns import listing
from casysid.recording import Recording
from casysid.robot import Joint, Robot

Indices = npt.NDArray[np.intp]

DEGREE = 180.0 / math.pi
SLOWEST = 1.0  # [s] between samples
FASTEST = 1e-6  # [s] between samples
MOST_TURNS = 4.0 * math.pi  # [rad] that need no explanation


def check_units(recording: Recording, robot: Robot) -> None:
    """Refuse time stamps that are not seconds and angles that are not radians.

    Raises:
        RecordingError: If the evidence leaves no other reading.
    """
    if recording.time is not None:
        _check_seconds(recording.label, float(np.median(np.diff(recording.time))))
    _check_degrees_by_velocity(recording, robot)
    _check_degrees_by_limits(recording, robot)


def _check_seconds(source: str, step: float) -> None:
    if FASTEST <= step < SLOWEST:
        return
    if step < FASTEST:
        raise RecordingError(
            f"{source}: time steps of {step:.3g} s (median) are too short for a robot's log; is time in hours or days? "
            "Convert it to seconds"
        )
    unit, factor = next(u for u in (("milli", 1e3), ("micro", 1e6), ("nano", 1e9)) if step < 0.5 * u[1] or u[1] == 1e9)
    raise RecordingError(
        f"{source}: time looks like {unit}seconds: its median step is {step:.6g}. Divide it by {factor:.0e}. "
        "Poses held at rest, truly seconds apart, go in without time and with v = a = 0"
    )


def _check_degrees_by_velocity(recording: Recording, robot: Robot) -> None:
    position, velocity = [], []
    for joint in angle_joints(robot):
        ratio, correlation = travel_over_integral(recording, joint)
        if correlation > 0.9 and abs(ratio / DEGREE - 1.0) < 0.1:
            position.append(joint.name)
        if correlation > 0.9 and abs(ratio * DEGREE - 1.0) < 0.1:
            velocity.append(joint.name)
    for names, word, other, unit in (
        (position, "q", "v", "rad"),
        (velocity, "v", "q", "rad/s"),
    ):
        if names:
            raise RecordingError(
                f"{recording.label}: {word} looks like degrees for {listing(names)}: "
                f"it is 57.3 times what {other} makes of it. Convert it to {unit} (times pi/180)"
            )


def travel_over_integral(recording: Recording, joint: Joint) -> tuple[float, float]:
    """Ratio of the distance travelled to the integral of the logged velocity of a 1-DOF joint, and their correlation.

    Over stretches of a fiftieth of the recording, none across a gap. (nan, 0) where there is nothing to compare.
    """
    if recording.time is None or recording.velocity is None:
        return math.nan, 0.0
    q, v = recording.position[:, joint.channels.start], recording.velocity[:, joint.v.start]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(recording.time))])
    starts, stops = _stretches(recording.segments, max(len(recording) // 50, 1))
    x, y = integral[stops] - integral[starts], q[stops] - q[starts]
    xx, yy, xy = float(x @ x), float(y @ y), float(x @ y)
    if xx <= 0.0 or yy <= 0.0:
        return math.nan, 0.0
    return xy / xx, xy / math.sqrt(xx * yy)


def _stretches(segments: tuple[slice, ...], length: int) -> tuple[Indices, Indices]:
    """First and last samples of stretches of ``length`` steps, each overlapping the next by three quarters."""
    starts, stops = [], []
    for segment in segments:
        steps = min(length, segment.stop - segment.start - 1)
        if steps > 0:
            first = np.arange(segment.start, segment.stop - steps, max(steps // 4, 1))
            starts.append(first)
            stops.append(first + steps)
    return np.concatenate(starts), np.concatenate(stops)


def _check_degrees_by_limits(recording: Recording, robot: Robot) -> None:
    far = []
    for joint in angle_joints(robot):
        k = joint.channels.start
        low, high = robot.position_lower[k], robot.position_upper[k]
        if not math.isfinite(high - low):
            continue
        q, slack = recording.position[:, k], 0.1 * (high - low)
        if q.min() / DEGREE < low - slack or q.max() / DEGREE > high + slack:
            return
        if np.abs(q).max() > max(MOST_TURNS, 3.0 * max(abs(low), abs(high))):
            far.append(f"{joint.name} ({q.min():.4g} to {q.max():.4g}, limits {low:.4g} to {high:.4g} rad)")
    if far:
        raise RecordingError(
            f"{recording.label}: q looks like degrees: {listing(far, 4)}; "
            "as degrees every joint would be within its limits. Convert q, v and a to radians (times pi/180), "
            "or correct the model's limits"
        )

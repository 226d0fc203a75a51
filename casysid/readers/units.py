"""Units that are not SI: time in milli-, micro- or nanoseconds, angles in degrees.

Two kinds of evidence for degrees. With logged velocities, the ratio of the distance travelled to the integral of the
velocity is 1, and 57.3 when only the position is in degrees. Without, positions far outside the model's limits that
would all lie inside them if they were degrees.
"""

from __future__ import annotations

import math

from casysid.errors import RecordingError
from casysid.readers.angles import angle_joints
from casysid.readers.messages import listing
from casysid.readers.statistics import Statistics
from casysid.robot import Robot

DEGREE = 180.0 / math.pi
SLOWEST = 1.0  # [s] between samples
FASTEST = 1e-6  # [s] between samples
MOST_TURNS = 4.0 * math.pi  # [rad] that need no explanation


def check_units(statistics: Statistics, robot: Robot) -> None:
    """Refuse time stamps that are not seconds and angles that are not radians.

    Raises:
        RecordingError: If the evidence leaves no other reading.
    """
    if statistics.has_time:
        _check_seconds(statistics.label, statistics.steps.median)
    _check_degrees_by_velocity(statistics, robot)
    _check_degrees_by_limits(statistics, robot)


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


def _check_degrees_by_velocity(statistics: Statistics, robot: Robot) -> None:
    position, velocity = [], []
    for joint in angle_joints(robot):
        ratio, correlation = statistics.travel_over_integral(joint, unwrapped=False)
        if correlation > 0.9 and abs(ratio / DEGREE - 1.0) < 0.1:
            position.append(joint.name)
        if correlation > 0.9 and abs(ratio * DEGREE - 1.0) < 0.1:
            velocity.append(joint.name)
    for names, word, other, unit, quantity, per in (
        (position, "q", "v", "rad", "position", ""),
        (velocity, "v", "q", "rad/s", "velocity", "/s"),
    ):
        if names:
            raise RecordingError(
                f"{statistics.label}: {word} looks like degrees for {listing(names)}: "
                f"it is 57.3 times what {other} makes of it. "
                f"Say --units {quantity}=deg{per}, or convert it to {unit} (times pi/180)"
            )


def _check_degrees_by_limits(statistics: Statistics, robot: Robot) -> None:
    far, positions = [], statistics.positions(unwrapped=False)
    for joint in angle_joints(robot):
        k = joint.channels.start
        low, high = robot.position_lower[k], robot.position_upper[k]
        if not math.isfinite(high - low):
            continue
        lowest, highest, slack = positions.low[k], positions.high[k], 0.1 * (high - low)
        if lowest / DEGREE < low - slack or highest / DEGREE > high + slack:
            return
        if max(-lowest, highest) > max(MOST_TURNS, 3.0 * max(abs(low), abs(high))):
            far.append(f"{joint.name} ({lowest:.4g} to {highest:.4g}, limits {low:.4g} to {high:.4g} rad)")
    if far:
        raise RecordingError(
            f"{statistics.label}: q looks like degrees: {listing(far, 4)}; "
            "as degrees every joint would be within its limits. Say --units position=deg, convert q, v, a to radians, "
            "or correct the model's limits"
        )

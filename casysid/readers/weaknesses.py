"""What is weak about a recording that can be used: one sentence each, with its consequence."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from casysid.arrays import Array
from casysid.readers.angles import angle_joints
from casysid.readers.columns import listing
from casysid.readers.units import MOST_TURNS, travel_over_integral
from casysid.recording import Recording
from casysid.robot import Joint, JointKind, Robot

SLOW = 9.0  # [Hz]
STILL = 5e-3  # [rad, m]: less is friction's play or the encoder's last digits


def find_weaknesses(recording: Recording, robot: Robot) -> tuple[str, ...]:
    """Sentences about what the data leave open or make doubtful; none when there is nothing to say."""
    searches = (
        _gaps,
        _jitter,
        _slow,
        _still_joints,
        _outside_limits,
        _turns,
        _jumps,
        _velocity_mismatch,
        _saturation,
        _stuck,
        _repeats,
    )
    return tuple(sentence for search in searches for sentence in search(recording, robot))


def _gaps(recording: Recording, robot: Robot) -> Iterator[str]:
    if len(recording.segments) > 1 and recording.time is not None:
        steps = np.diff(recording.time)
        largest = int(np.argmax(steps))
        yield (
            f"{len(recording.segments) - 1} gaps in time, the largest {steps[largest]:.4g} s "
            f"after {recording.time[largest]:.6g} s (the usual step is {np.median(steps):.4g} s); "
            "the stretches between them are smoothed one by one"
        )


def _jitter(recording: Recording, robot: Robot) -> Iterator[str]:
    if recording.time is not None:
        steps = np.diff(recording.time)
        low, middle, high = np.quantile(steps, [0.05, 0.5, 0.95])
        if high - low > 0.2 * middle:
            yield (
                f"sampling is uneven: nine steps in ten last {low:.3g} to {high:.3g} s; "
                "derivatives are only as good as the time stamps"
            )


def _slow(recording: Recording, robot: Robot) -> Iterator[str]:
    if recording.rate < SLOW:
        yield (
            f"only {recording.rate:.3g} samples a second, too few to follow a robot's motion; "
            "check that time is in seconds, not milliseconds"
        )


def _still_joints(recording: Recording, robot: Robot) -> Iterator[str]:
    still = [j.name for j in robot.joints if np.ptp(recording.position[:, j.channels], axis=0).max() < STILL]
    if still:
        yield (
            f"never moving (less than {STILL:g} rad or m): {listing(still)}; "
            "friction and much of the inertia of such a joint cannot be identified"
        )


def _outside_limits(recording: Recording, robot: Robot) -> Iterator[str]:
    low, high = recording.position.min(axis=0), recording.position.max(axis=0)
    slack = 0.01 * np.nan_to_num(robot.position_upper - robot.position_lower, posinf=0.0)
    outside = (low < robot.position_lower - slack) | (high > robot.position_upper + slack)
    if outside.any():
        details = [
            f"{robot.channels[k]} {low[k]:.4g} to {high[k]:.4g} "
            f"(limits {robot.position_lower[k]:.4g} to {robot.position_upper[k]:.4g})"
            for k in np.flatnonzero(outside)
        ]
        yield f"positions outside the model's limits: {listing(details, 4)}; check the model's zeros and the units of q"


def _turns(recording: Recording, robot: Robot) -> Iterator[str]:
    """Angles without limits that would be many turns as radians, unless their speed is one that the model allows."""
    many = []
    for joint in angle_joints(robot):
        k, reach = joint.channels.start, np.abs(recording.position[:, joint.channels]).max()
        limited = np.isfinite(robot.position_upper[k] - robot.position_lower[k])
        if not limited and reach > MOST_TURNS and not _slow_enough(recording, robot, joint):
            many.append(f"{joint.name} (up to {reach:.4g})")
    if many:
        yield f"{listing(many)}: many turns in radians, or degrees? The model sets no limits to tell; convert degrees"


def _slow_enough(recording: Recording, robot: Robot, joint: Joint) -> bool:
    limit = float(robot.velocity_limit[joint.v.start])
    speed = _step_speed(recording, joint)
    return len(speed) > 0 and np.isfinite(limit) and float(np.quantile(speed, 0.99)) <= limit


def _step_speed(recording: Recording, joint: Joint) -> Array:
    """Speed from each sample to the next of a 1-DOF joint; empty without time."""
    if recording.time is None:
        return np.empty(0)
    return np.abs(np.diff(recording.position[:, joint.channels.start])) / np.diff(recording.time)


def _jumps(recording: Recording, robot: Robot) -> Iterator[str]:
    details = []
    for joint in (j for j in robot.joints if j.kind in _SINGLE and np.isfinite(robot.velocity_limit[j.v.start])):
        speed = _step_speed(recording, joint)
        jumps = np.flatnonzero(speed > 10.0 * robot.velocity_limit[joint.v.start])
        if len(jumps) and recording.time is not None:
            details.append(
                f"{joint.name} in {len(jumps)} of {len(speed)} steps, first at {recording.time[jumps[0] + 1]:.6g} s"
            )
    if details:
        yield (
            f"positions jump, faster than ten times the velocity limit: {listing(details, 4)}; "
            "cut out glitches, or check the units of q and time"
        )


_SINGLE = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


def _velocity_mismatch(recording: Recording, robot: Robot) -> Iterator[str]:
    details = []
    for joint in (j for j in robot.joints if j.kind in _SINGLE):
        ratio, correlation = travel_over_integral(recording, joint)
        moves = np.ptp(recording.position[:, joint.channels.start]) >= STILL
        if moves and np.isfinite(ratio) and not (0.8 < ratio < 1.25 and correlation > 0.8):
            details.append(f"{joint.name} (ratio {ratio:.3g}, correlation {correlation:.2g})")
    if details:
        yield f"the logged v is not the rate of change of q for {listing(details, 4)}; check sign, unit and joint order"


def _saturation(recording: Recording, robot: Robot) -> Iterator[str]:
    magnitude = np.abs(recording.torque)
    count = (magnitude >= 0.999 * robot.effort_limit).sum(axis=0)
    details = [
        f"{robot.dofs[k]} in {count[k]} rows (up to {magnitude[:, k].max():.4g}, limit {robot.effort_limit[k]:.4g})"
        for k in np.flatnonzero(count > 0.001 * len(recording))
    ]
    if details:
        yield (
            f"torque at or beyond the model's effort limit: {listing(details, 4)}; "
            "a clipped torque is not what moved the joint, and a larger one questions its unit or the limit"
        )


def _stuck(recording: Recording, robot: Robot) -> Iterator[str]:
    base = {k for j in robot.joints if j.kind is JointKind.FREE_FLYER for k in range(j.v.start, j.v.stop)}
    stuck = [d for k, d in enumerate(robot.dofs) if k not in base and np.ptp(recording.torque[:, k]) == 0.0]
    if stuck:
        yield f"torque of {listing(stuck)} is the same in every row: not measured, so it says nothing about that joint"


def _repeats(recording: Recording, robot: Robot) -> Iterator[str]:
    if recording.time is not None:
        same = [(x[1:] == x[:-1]).all(axis=1) for x in (recording.position, recording.torque)]
        share = float(np.logical_and(*same).mean())
        if share > 0.05:
            yield (
                f"{share:.0%} of the rows repeat the one before; the log is faster than the robot's measurements, "
                "so decimate it to the true rate"
            )

"""What is weak about a recording that can be used: one sentence each, with its consequence."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from casysid.arrays import Array
from casysid.readers.angles import angle_joints
from casysid.readers.messages import listing
from casysid.readers.statistics import SINGLE, Statistics
from casysid.readers.units import MOST_TURNS
from casysid.robot import Joint, JointKind, Robot

SLOW = 9.0  # [Hz]
STILL = 5e-3  # [rad, m]: less is friction's play or the encoder's last digits


def find_weaknesses(log: Statistics, robot: Robot) -> tuple[str, ...]:
    """Sentences about what the data leave open or make doubtful; none when there is nothing to say."""
    searches = (
        _wrapped_angles,
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
    return tuple(sentence for search in searches for sentence in search(log, robot))


def _wrapped_angles(log: Statistics, robot: Robot) -> Iterator[str]:
    """A sentence about wrapped angles, if there are any.

    A joint at ``q`` and at ``q + 2π`` is in the same place, so taking the turns out changes no dynamics; left in, each
    step would be a huge velocity.
    """
    places = [(joint.name, joint.channels.start) for joint in angle_joints(robot)]
    wrapped = [f"{name} ({log.turns[k]} times)" for name, k in places if log.unwrapped[k]]
    if wrapped:
        yield f"angles jump by a whole turn: {listing(wrapped)}; taken as wrapped and unwrapped"


def _gaps(log: Statistics, robot: Robot) -> Iterator[str]:
    gaps = log.steps.gaps
    if len(gaps):
        lengths = gaps[:, 1] - gaps[:, 0]
        largest = int(np.argmax(lengths))
        yield (
            f"{len(gaps)} gaps in time, the largest {lengths[largest]:.4g} s "
            f"after {gaps[largest, 0]:.6g} s (the usual step is {log.steps.median:.4g} s); "
            "what one parts that is long beside the low-pass is smoothed piece by piece"
        )


def _jitter(log: Statistics, robot: Robot) -> Iterator[str]:
    if log.has_time:
        low, middle, high = log.steps.quantiles([0.05, 0.5, 0.95])
        if high - low > 0.2 * middle:
            yield (
                f"sampling is uneven: nine steps in ten last {low:.3g} to {high:.3g} s; "
                "derivatives are only as good as the time stamps"
            )


def _slow(log: Statistics, robot: Robot) -> Iterator[str]:
    if log.steps.rate < SLOW:
        yield (
            f"only {log.steps.rate:.3g} samples a second, too few to follow a robot's motion; "
            "check that time is in seconds, not milliseconds"
        )


def _still_joints(log: Statistics, robot: Robot) -> Iterator[str]:
    travel = _travel(log)
    still = [joint.name for joint in robot.joints if travel[joint.channels].max() < STILL]
    if still:
        yield (
            f"never moving (less than {STILL:g} rad or m): {listing(still)}; "
            "friction and much of the inertia of such a joint cannot be identified"
        )


def _travel(log: Statistics) -> Array:
    positions = log.positions(unwrapped=True)
    return np.asarray(positions.high - positions.low)


def _outside_limits(log: Statistics, robot: Robot) -> Iterator[str]:
    positions = log.positions(unwrapped=True)
    low, high = positions.low, positions.high
    slack = 0.01 * np.nan_to_num(robot.position_upper - robot.position_lower, posinf=0.0)
    outside = (low < robot.position_lower - slack) | (high > robot.position_upper + slack)
    if outside.any():
        details = [
            f"{robot.channels[k]} {low[k]:.4g} to {high[k]:.4g} "
            f"(limits {robot.position_lower[k]:.4g} to {robot.position_upper[k]:.4g})"
            for k in np.flatnonzero(outside)
        ]
        yield f"positions outside the model's limits: {listing(details, 4)}; check the model's zeros and the units of q"


def _turns(log: Statistics, robot: Robot) -> Iterator[str]:
    """Angles without limits that would be many turns as radians, unless their speed is one that the model allows."""
    many, positions = [], log.positions(unwrapped=True)
    for joint in angle_joints(robot):
        k = joint.channels.start
        reach = max(-positions.low[k], positions.high[k])
        limited = np.isfinite(robot.position_upper[k] - robot.position_lower[k])
        if not limited and reach > MOST_TURNS and not _slow_enough(log, robot, joint):
            many.append(f"{joint.name} (up to {reach:.4g})")
    if many:
        yield f"{listing(many)}: many turns in radians, or degrees? The model sets no limits to tell; convert degrees"


def _slow_enough(log: Statistics, robot: Robot, joint: Joint) -> bool:
    """Whether no more than one step in a hundred is faster than the joint's limit."""
    fast = log.positions(unwrapped=True).fast[joint.channels.start]
    return bool(log.steps.count and np.isfinite(robot.velocity_limit[joint.v.start]) and fast <= 0.01 * log.steps.count)


def _jumps(log: Statistics, robot: Robot) -> Iterator[str]:
    positions = log.positions(unwrapped=True)
    details = [
        f"{robot.channels[k]} in {positions.jumps[k]} of {log.steps.count} steps, "
        f"first at {positions.first_jump[k]:.6g} s"
        for k in np.flatnonzero(positions.jumps)
    ]
    if details:
        yield (
            f"positions jump, faster than ten times the velocity limit: {listing(details, 4)}; "
            "cut out glitches, or check the units of q and time"
        )


def _velocity_mismatch(log: Statistics, robot: Robot) -> Iterator[str]:
    details, travel = [], _travel(log)
    for joint in (j for j in robot.joints if j.kind in SINGLE):
        ratio, correlation = log.travel_over_integral(joint, unwrapped=True)
        moves = travel[joint.channels.start] >= STILL
        if moves and np.isfinite(ratio) and not (0.8 < ratio < 1.25 and correlation > 0.8):
            details.append(f"{joint.name} (ratio {ratio:.3g}, correlation {correlation:.2g})")
    if details:
        yield f"the logged v is not the rate of change of q for {listing(details, 4)}; check sign, unit and joint order"


def _saturation(log: Statistics, robot: Robot) -> Iterator[str]:
    count, largest = log.saturated, np.maximum(-log.torque_low, log.torque_high)
    details = [
        f"{robot.dofs[k]} in {count[k]} rows (up to {largest[k]:.4g}, limit {robot.effort_limit[k]:.4g})"
        for k in np.flatnonzero(count > 0.001 * log.samples)
    ]
    if details:
        yield (
            f"torque at or beyond the model's effort limit: {listing(details, 4)}; "
            "a clipped torque is not what moved the joint, and a larger one questions its unit or the limit"
        )


def _stuck(log: Statistics, robot: Robot) -> Iterator[str]:
    base = {k for j in robot.joints if j.kind is JointKind.FREE_FLYER for k in range(j.v.start, j.v.stop)}
    constant = log.torque_low == log.torque_high
    stuck = [dof for k, dof in enumerate(robot.dofs) if k not in base and constant[k] and dof not in log.unmeasured]
    if stuck:
        yield f"torque of {listing(stuck)} is the same in every row: not measured, so it says nothing about that joint"


def _repeats(log: Statistics, robot: Robot) -> Iterator[str]:
    share = log.repeats / max(log.steps.count, 1)
    if share > 0.05:
        yield (
            f"{share:.0%} of the rows repeat the one before; the log is faster than the robot's measurements, "
            "so decimate it to the true rate"
        )

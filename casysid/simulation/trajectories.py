"""Sinusoids in all joints, as the robots of Ting et al. (2006), §IV, moved: from rest to rest, within the limits."""

from __future__ import annotations

import dataclasses
import warnings
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.errors import CasysidWarning, ParameterError
from casysid.robot import Joint, JointKind, Robot
from casysid.simulation.reference import Reference
from casysid.simulation.truth import finite_limit
from casysid.threads import single_threaded

_FREE_RANGE = {True: 0.2, False: 1.0}  # half the range of a coordinate without limits: [m] linear, [rad] angular
_FREE_SPEED = {True: 0.5, False: 3.0}  # [m/s], [rad/s]
_LARGEST_REACH = np.pi  # [rad, m]: half a range beyond this is no range
_FASTEST = 50.0  # [rad/s, m/s]: a velocity limit beyond this is a placeholder
_CHECKS = 2000  # instants at which torques are looked at
_RAMP_SLOPE = 1.875  # steepest slope of the ramp 10 s³ - 15 s⁴ + 6 s⁵


@dataclass(frozen=True, eq=False, kw_only=True)
class Sinusoids:
    """A sum of sinusoids along every motion coordinate, faded in and out; at rest before and after.

    A motion coordinate is a channel, or for a quaternion the angle about a fixed axis.

    Attributes:
        robot: Whose motion it is.
        center: Where every coordinate starts and ends, shape (m,), [rad, m].
        amplitude: Shape (m, components).
        frequency: Shape (m, components), [Hz].
        phase: Shape (m, components), [rad].
        axes: Rotation axis of every quaternion, shape (quaternions, 3), units.
        duration: [s].
        ramp: Time of fading in, and of fading out [s].
    """

    robot: Robot
    center: Array
    amplitude: Array
    frequency: Array
    phase: Array
    axes: Array
    duration: float
    ramp: float

    def __post_init__(self) -> None:
        for name in ("center", "amplitude", "frequency", "phase", "axes"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        _check_ramp(self.ramp, self.duration)

    def sample(self, time: Array) -> Reference:
        """The motion at times (N,), [s]."""
        time = np.asarray(time, dtype=np.float64)
        x, x1, x2 = (np.empty((len(time), self.center.size)) for _ in range(3))
        s, s1, s2 = (w[:, None] for w in self._fade(time))
        for m, (amplitude, frequency, phase) in enumerate(zip(self.amplitude, self.frequency, self.phase, strict=True)):
            w = 2.0 * np.pi * frequency
            angle = np.multiply.outer(time, w) + phase
            sine, cosine = np.sin(angle), np.cos(angle)
            f, f1, f2 = sine @ amplitude, cosine @ (amplitude * w), -(sine @ (amplitude * w * w))
            x[:, m] = self.center[m] + s[:, 0] * f
            x1[:, m] = s1[:, 0] * f + s[:, 0] * f1
            x2[:, m] = s2[:, 0] * f + 2.0 * s1[:, 0] * f1 + s[:, 0] * f2
        return Reference.from_channels(self.robot, time, *self._channels(x, x1, x2))

    def _fade(self, time: Array) -> tuple[Array, Array, Array]:
        """The ramp 10 s³ - 15 s⁴ + 6 s⁵ up and down again, and its two derivatives in time."""
        rising = time < self.duration / 2.0
        s = np.clip(np.where(rising, time, self.duration - time) / self.ramp, 0.0, 1.0)
        sign = np.where(rising, 1.0, -1.0) / self.ramp
        value = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        slope = 30.0 * s**2 * (1.0 - s) ** 2
        bend = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
        return value, sign * slope, sign**2 * bend

    def _channels(self, x: Array, x1: Array, x2: Array) -> tuple[Array, Array, Array]:
        """Channels and derivatives of motion coordinates; a turn x about n is the quaternion (n sin x/2, cos x/2)."""
        columns: list[list[Array]] = [[], [], []]
        at = turn = 0
        for joint in self.robot.joints:
            linear = _plain_count(joint)
            for values, source in zip(columns, (x, x1, x2), strict=True):
                values.append(source[:, at : at + linear])
            at += linear
            if joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER):
                half, w, dw = x[:, at : at + 1] / 2.0, x1[:, at : at + 1] / 2.0, x2[:, at : at + 1] / 2.0
                n, s, c = self.axes[turn], np.sin(half), np.cos(half)
                columns[0].append(np.hstack([n * s, c]))
                columns[1].append(w * np.hstack([n * c, -s]))
                columns[2].append(dw * np.hstack([n * c, -s]) - w * w * np.hstack([n * s, c]))
                at, turn = at + 1, turn + 1
        position, first, second = (np.hstack(values) for values in columns)
        return position, first, second


@single_threaded()
def design_sinusoids(
    robot: Robot,
    *,
    duration: float,
    seed: int = 0,
    components: int = 3,
    band: tuple[float, float] = (0.1, 1.0),
    range_share: float = 0.8,
    velocity_share: float = 0.8,
    torque_share: float = 0.8,
    ramp: float = 1.0,
) -> Sinusoids:
    """Random sinusoids that keep to the robot's limits.

    Every coordinate has its own frequencies, phases and shares of the amplitude. The sum of its amplitudes, and the
    largest velocity that phases and fading could ever add up to, stay within the shares given. All amplitudes shrink
    together until the torques that the model file expects do, too; if weight alone is too much, there is a
    :class:`CasysidWarning`.

    Args:
        robot: Its limits; without limits ±1 rad (0.2 m) and 3 rad/s (0.5 m/s).
        duration: [s].
        seed: Of the draw.
        components: Sinusoids per coordinate.
        band: Lowest and highest frequency [Hz].
        range_share: Of half the range about its middle.
        velocity_share: Of the velocity limit.
        torque_share: Of the effort limit.
        ramp: Time of fading in, and of fading out [s].

    Raises:
        ParameterError: A setting is out of range.
    """
    shares = (range_share, velocity_share, torque_share)
    _check_ramp(ramp, duration)
    if components < 1 or not 0.0 < band[0] <= band[1] or not all(0.0 < share <= 1.0 for share in shares):
        raise ParameterError(
            "sinusoids: wanted at least one component, a band of positive rising frequencies, shares above 0 up to 1; "
            f"got components={components}, band={band}, shares {shares}"
        )
    rng = np.random.default_rng(seed)
    center, reach, speed = np.array([limits for joint in robot.joints for limits in _limits(robot, joint)]).T
    shape = (len(center), components)
    frequency = rng.uniform(*band, shape)
    amplitude = rng.dirichlet(np.full(components, 2.0), len(center))
    fastest = (amplitude * (2.0 * np.pi * frequency + _RAMP_SLOPE / ramp)).sum(axis=1)
    amplitude *= np.minimum(range_share * reach, velocity_share * speed / fastest)[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, shape)
    count = sum(joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER) for joint in robot.joints)
    axes = rng.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    motion = Sinusoids(
        robot=robot,
        center=center,
        amplitude=amplitude,
        frequency=frequency,
        phase=phase,
        axes=axes,
        duration=duration,
        ramp=ramp,
    )
    return _within_torque(motion, torque_share)


def _within_torque(motion: Sinusoids, share: float) -> Sinusoids:
    """The motion, made smaller until the torques of the robot's file stay within a share of the effort limits."""
    robot, data = motion.robot, motion.robot.model.createData()
    limit = share * finite_limit(robot.effort_limit, np.inf)
    time = np.linspace(0.0, motion.duration, _CHECKS)
    for shrink in 0.85 ** np.arange(20):
        smaller = dataclasses.replace(motion, amplitude=shrink * motion.amplitude)
        reference = smaller.sample(time)
        rigid = [pin.rnea(robot.model, data, *x) for x in zip(reference.q, reference.v, reference.a, strict=True)]
        torque = rigid + robot.damping * reference.v + robot.dry_friction * np.sign(reference.v)
        if (np.abs(torque) <= limit).all():
            return smaller
    worst = int(np.argmax(np.abs(torque).max(axis=0) / limit))
    warnings.warn(
        f"sinusoids: weight alone takes '{robot.dofs[worst]}' of robot '{robot.name}' beyond {share:.0%} of its effort "
        f"limit of {robot.effort_limit[worst]:.6g}; check the limits in {robot.source.name}",
        CasysidWarning,
        stacklevel=4,
    )
    return motion


def _check_ramp(ramp: float, duration: float) -> None:
    if not 0.0 < 2.0 * ramp <= duration < np.inf:
        raise ParameterError(
            "sinusoids: the ramp must be positive and fit twice into the duration; "
            f"got ramp {ramp} s, duration {duration} s"
        )


def _plain_count(joint: Joint) -> int:
    """How many motion coordinates of a joint are channels."""
    return {JointKind.SPHERICAL: 0, JointKind.PLANAR: 3, JointKind.FREE_FLYER: 3}.get(joint.kind, 1)


def _limits(robot: Robot, joint: Joint) -> list[tuple[float, float, float]]:
    """Centre, largest excursion and largest velocity of each motion coordinate of a joint."""
    if joint.kind not in (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC):
        linear_ones = [True] * min(_plain_count(joint), 2 if joint.kind is JointKind.PLANAR else 3) + [False]
        return [(0.0, _FREE_RANGE[linear], _FREE_SPEED[linear]) for linear in linear_ones]
    linear = joint.kind is JointKind.PRISMATIC
    low, high = float(robot.position_lower[joint.channels][0]), float(robot.position_upper[joint.channels][0])
    reach = _FREE_RANGE[linear]
    if not np.isfinite(low):
        low = high - 2.0 * reach if np.isfinite(high) else -reach
    if not np.isfinite(high):
        high = low + 2.0 * reach
    speed = float(finite_limit(robot.velocity_limit[joint.v], np.inf)[0])
    return [
        (
            (low + high) / 2.0,
            min((high - low) / 2.0, _LARGEST_REACH),
            speed if speed <= _FASTEST else _FREE_SPEED[linear],
        )
    ]

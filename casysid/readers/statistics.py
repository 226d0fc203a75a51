"""What one scan keeps of a log's samples, batch by batch, for checks, warnings and facts."""

from __future__ import annotations

import copy
import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.readers.angles import RARELY, TURN, angle_joints, whole_turns
from casysid.readers.steps import StepStatistics
from casysid.recording.file import Facts
from casysid.recording.recording import Recording
from casysid.recording.resolution import ResolutionScan
from casysid.recording.spectrum import SpectrumScan
from casysid.robot import Joint, JointKind, Robot

Indices = npt.NDArray[np.intp]

SINGLE = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)
MOST_MARKS = 1 << 12
"""Rows whose sums are remembered: up to twice as many are, and then every second one is dropped."""
JUMP = 10.0
"""A step faster than so many velocity limits is a jump."""
FASTEST = 1e5
"""Of a joint from one sample to the next [rad/s, m/s]: the fastest spindles turn at a million revolutions a minute."""
SATURATED = 0.999
"""Of the effort limit."""


class Positions:
    """Ranges of the channels, and steps of the joints of one degree of freedom that are too fast.

    Attributes:
        low: Lowest by channel, shape (channels,).
        high: Highest by channel.
        fast: Steps faster than the joint's velocity limit, by channel.
        jumps: Steps faster than ten times that.
        first_jump: Time after the first of those [s].
        leaps: Steps faster than any joint, by channel.
        first_leap: Row after the first of those, positions before and after, and step of time [s], (channels, 4).
    """

    def __init__(self, robot: Robot) -> None:
        channels = len(robot.channels)
        self.low, self.high = np.full(channels, np.inf), np.full(channels, -np.inf)
        self.fast, self.jumps = np.zeros(channels, dtype=np.intp), np.zeros(channels, dtype=np.intp)
        self.first_jump = np.full(channels, np.nan)
        self.leaps, self.first_leap = np.zeros(channels, dtype=np.intp), np.full((channels, 4), np.nan)
        limits = {
            joint.channels.start: float(robot.velocity_limit[joint.v.start])
            for joint in robot.joints
            if joint.kind in SINGLE and np.isfinite(robot.velocity_limit[joint.v.start])
        }
        self._limited, self._limits = list(limits), np.array(list(limits.values()))

    def add(self, position: Array, steps: Array, time: Array | None, row: int = 0) -> None:
        """Positions, and the steps to rows from ``row`` on, between samples at ``time``, one more than the steps."""
        self.low = np.minimum(self.low, position.min(axis=0))
        self.high = np.maximum(self.high, position.max(axis=0))
        if time is None or not len(steps):
            return
        self._find_leaps(position, steps, np.diff(time), row)
        if not self._limited:
            return
        speed = np.abs(steps[:, self._limited]) / np.diff(time)[:, None]
        fast = speed > self._limits
        if not fast.any():
            return
        self.fast[self._limited] += fast.sum(axis=0)
        jumps = speed > JUMP * self._limits
        for k in np.flatnonzero(jumps.any(axis=0)):
            channel = self._limited[k]
            if not self.jumps[channel]:
                self.first_jump[channel] = time[int(np.argmax(jumps[:, k])) + 1]
            self.jumps[channel] += int(jumps[:, k].sum())

    def _find_leaps(self, position: Array, steps: Array, time: Array, row: int) -> None:
        if np.abs(steps).max() <= FASTEST * time.min():
            return
        leaps = np.abs(steps) > FASTEST * time[:, None]
        for channel in np.flatnonzero(leaps.any(axis=0)):
            if not self.leaps[channel]:
                k = int(np.argmax(leaps[:, channel]))
                after = position[k + len(position) - len(steps), channel]
                self.first_leap[channel] = (row + k, after - steps[k, channel], after, time[k])
            self.leaps[channel] += int(np.count_nonzero(leaps[:, channel]))


class Marks:
    """Positions, turns and integrals of the velocities at some rows, evenly apart; at all rows of a short log.

    Attributes:
        stride: Rows from one to the next.
        rows: Which, shape (M,).
        values: Time, positions, turns and integrals there, shape (M, n).
    """

    def __init__(self) -> None:
        self.stride = 1
        self.rows: Indices = np.empty(0, dtype=np.intp)
        self.values = np.empty((0, 0))

    def add(self, first: int, values: Array) -> None:
        """Values at rows from ``first`` on."""
        picked = slice(-first % self.stride, None, self.stride)
        rows = np.arange(first, first + len(values))[picked]
        self.rows = np.concatenate([self.rows, rows])
        self.values = np.concatenate([self.values.reshape(-1, values.shape[1]), values[picked]])
        while len(self.rows) > 2 * MOST_MARKS:
            self.stride *= 2
            self.rows, self.values = self.rows[::2], self.values[::2]


class Statistics:
    """Of all samples of a log.

    Attributes:
        label: What to call the log in a message.
        samples: Number of rows.
        steps: Of time.
        torque_low: Lowest by degree of freedom, shape (dofs,).
        torque_high: Highest.
        saturated: Rows with a torque at or beyond the effort limit, by degree of freedom.
        repeats: Rows that repeat the one before.
        unmeasured: Degrees of freedom without a torque.
        turns: Steps of a whole turn, by channel.
        worst_quaternion: By joint, the length farthest from one and its row.
    """

    def __init__(self, robot: Robot, label: str) -> None:
        self._robot, self.label = robot, label
        self.samples = 0
        self.has_time = self.has_velocity = self.has_acceleration = False
        self.steps = StepStatistics()
        self.torque_low, self.torque_high = np.full(robot.nv, np.inf), np.full(robot.nv, -np.inf)
        self._torque_squares = np.zeros(robot.nv)
        self.saturated = np.zeros(robot.nv, dtype=np.intp)
        self.repeats = 0
        self.unmeasured: tuple[str, ...] = ()
        self.turns = np.zeros(len(robot.channels), dtype=np.intp)
        self.worst_quaternion: dict[str, tuple[float, int]] = {}
        self._turned = np.zeros(len(robot.channels))
        self._logged = self._straight = Positions(robot)
        self._marks, self._integral = Marks(), np.zeros(robot.nv)
        self._spectrum, self._resolution = SpectrumScan(), ResolutionScan()
        self._last: Recording | None = None
        self._angles = [joint.channels.start for joint in angle_joints(robot)]

    def add(self, rows: Recording) -> None:
        """Samples that follow those added before; not necessarily finite."""
        if not len(rows):
            return
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            self._add(rows)
        self.samples += len(rows)
        self._last = rows.selected(np.array([len(rows) - 1]))

    def _add(self, rows: Recording) -> None:
        before = rows.selected(slice(0, 1)) if self._last is None else self._last
        steps = np.diff(rows.position, axis=0, prepend=before.position)
        self._add_torque(rows.torque)
        self.unmeasured = rows.unmeasured
        self._add_quaternions(rows.position)
        self.has_velocity, self.has_acceleration = rows.has_velocity, rows.has_acceleration
        self.has_time = rows.time is not None and before.time is not None
        if rows.time is None or before.time is None:
            self._logged.add(rows.position, steps, None)
            return
        skip = int(self._last is None)  # the first sample of all has none before it
        time = rows.time if skip else np.concatenate([before.time, rows.time])
        self.steps.add(time)
        same = (steps[skip:] == 0.0).all(axis=1)
        torque = np.diff(rows.torque, axis=0, prepend=before.torque)[skip:]
        self.repeats += int(np.count_nonzero(same & (torque == 0.0).all(axis=1))) if same.any() else 0
        turns = whole_turns(steps, self._angles)
        turned = self._turned + np.cumsum(turns, axis=0)
        self._add_positions(rows.position, steps[skip:], turns[skip:], turned, time)
        self._turned = turned[-1]
        self._add_marks(rows, before, turned)
        self._spectrum.add(rows.time, rows.position - TURN * turned if turned.any() else rows.position)

    def _add_torque(self, torque: Array) -> None:
        self.torque_low = np.minimum(self.torque_low, torque.min(axis=0))
        self.torque_high = np.maximum(self.torque_high, torque.max(axis=0))
        self._torque_squares += np.einsum("ij,ij->j", torque, torque)
        self.saturated += np.count_nonzero(np.abs(torque) >= SATURATED * self._robot.effort_limit, axis=0)

    def _add_quaternions(self, position: Array) -> None:
        for joint in self._robot.joints:
            if joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER):
                lengths = np.linalg.norm(position[:, joint.channels][:, -4:], axis=1)
                row = int(np.argmax(np.abs(lengths - 1.0)))
                known = self.worst_quaternion.get(joint.name)
                if known is None or abs(lengths[row] - 1.0) > abs(known[0] - 1.0):
                    self.worst_quaternion[joint.name] = (float(lengths[row]), self.samples + row)

    def _add_positions(self, position: Array, steps: Array, turns: Array, turned: Array, time: Array) -> None:
        """As logged, and with whole turns taken out from when there is the first."""
        if turned.any() and self._straight is self._logged:
            self._straight = copy.deepcopy(self._logged)
        row = self.samples + len(position) - len(steps)
        self._logged.add(position, steps, time, row)
        if self._straight is not self._logged:
            self._straight.add(position - TURN * turned, steps - TURN * turns, time, row)
        self.turns += np.count_nonzero(turns, axis=0)
        self._resolution.add(position)

    def _add_marks(self, rows: Recording, before: Recording, turned: Array) -> None:
        assert rows.time is not None
        assert before.time is not None
        integral = np.zeros((len(rows), 0))
        if rows.velocity is not None and before.velocity is not None:
            speed = np.concatenate([before.velocity, rows.velocity])
            step = np.diff(rows.time, prepend=before.time)[:, None]
            integral = self._integral + np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step, axis=0)
            self._integral = integral[-1]
        self._marks.add(self.samples, np.column_stack([rows.time, rows.position, turned, integral]))

    @property
    def unwrapped(self) -> npt.NDArray[np.bool_]:
        """Which channels jump by a whole turn, and rarely, as wrapped angles do."""
        return np.asarray((self.turns > 0) & (self.turns <= RARELY * self.steps.count))

    def positions(self, *, unwrapped: bool) -> Positions:
        """Ranges and speeds as logged, or with the whole turns of wrapped angles taken out."""
        if not unwrapped or self._straight is self._logged or not self.unwrapped.any():
            return self._logged
        mixed = copy.copy(self._logged)
        for name in ("low", "high", "fast", "jumps", "first_jump", "leaps", "first_leap"):
            straight, logged = getattr(self._straight, name), getattr(self._logged, name)
            values = np.where(self.unwrapped.reshape(-1, *[1] * (logged.ndim - 1)), straight, logged)
            setattr(mixed, name, values)
        return mixed

    def travel_over_integral(self, joint: Joint, *, unwrapped: bool) -> tuple[float, float]:
        """Ratio of the distance travelled to the integral of the logged velocity of a 1-DOF joint, and correlation.

        Over stretches of a fiftieth of the recording, none across a gap. (nan, 0) where there is nothing to compare.
        """
        channels = len(self._robot.channels)
        if not self.has_time or not self.has_velocity:
            return math.nan, 0.0
        marks, channel = self._marks.values, joint.channels.start
        q, integral = marks[:, 1 + channel], marks[:, 1 + 2 * channels + joint.v.start]
        if unwrapped and self.unwrapped[channel]:
            q = q - TURN * marks[:, 1 + channels + channel]
        starts, stops = _stretches(self._mark_segments(), max(len(q) // 50, 1))
        x, y = integral[stops] - integral[starts], q[stops] - q[starts]
        xx, yy, xy = float(x @ x), float(y @ y), float(x @ y)
        if xx <= 0.0 or yy <= 0.0:
            return math.nan, 0.0
        return xy / xx, xy / math.sqrt(xx * yy)

    def _mark_segments(self) -> tuple[slice, ...]:
        edges = np.searchsorted(self._marks.rows, [0, *self.steps.gap_rows, self.samples])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(edges) if b > a)

    def facts(self) -> Facts:
        """For a :class:`~casysid.recording.RecordingFile`."""
        rows, edges = self.steps.holes
        positions = self.positions(unwrapped=True)
        return Facts(
            samples=self.samples,
            has_time=self.has_time,
            has_velocity=self.has_velocity,
            has_acceleration=self.has_acceleration,
            start=self.steps.start,
            stop=self.steps.stop,
            step=self.steps.median,
            rate=self.steps.rate,
            hole_rows=rows,
            hole_edges=edges,
            mark_rows=self._marks.rows,
            mark_times=self._marks.values[:, 0] if self.has_time else np.empty(0),
            position_range=np.stack([positions.low, positions.high], axis=1),
            torque_rms=np.sqrt(self._torque_squares / self.samples),
            torque_peak=np.maximum(np.abs(self.torque_low), np.abs(self.torque_high)),
            spectrum=self._spectrum.finish(self._resolution.finish(), self.steps.stop - self.steps.start, self.samples)
            if self.has_time
            else None,
        )


def _stretches(segments: tuple[slice, ...], length: int) -> tuple[Indices, Indices]:
    """First and last samples of stretches of ``length`` steps, each overlapping the next by three quarters."""
    starts, stops = [np.empty(0, dtype=np.intp)], [np.empty(0, dtype=np.intp)]
    for segment in segments:
        steps = min(length, segment.stop - segment.start - 1)
        if steps > 0:
            first = np.arange(segment.start, segment.stop - steps, max(steps // 4, 1))
            starts.append(first)
            stops.append(first + steps)
    return np.concatenate(starts), np.concatenate(stops)

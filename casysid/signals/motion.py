"""Motion: smoothed ``q, v, a`` and the torque beside them, ready for the regressor."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import RecordingError
from casysid.recording import BATCH, GAP, Recording, Source, Stretch
from casysid.recording.pieces import Piece, pieces
from casysid.robot import Robot
from casysid.robot.coordinates import configuration_from_channels, state_from_channels
from casysid.signals.alignment import moved_torque
from casysid.signals.noise import noise_of, smoothed_noise, speed_of
from casysid.signals.smoothing import Grid, build_smoother, memory
from casysid.signals.standstill import standing
from casysid.threads import single_threaded

MINIMUM_SAMPLES = 8
LONGEST_BRIDGE = 0.5
"""Holes of no more than so many periods of the cut-off are bridged by the spline. In the middle of one so long, a
motion at a quarter of the cut-off is off by 1e-5 of its acceleration (``tests/signals/test_pieces.py``)."""
SETTLING = 1.0
"""So many periods of the cut-off from an end, the spline is as good as anywhere: what an end does to it falls to
``exp(-π)`` in one."""
LARGEST_END = 0.05
"""But no more than this share of a stretch counts as one of its ends."""

SAMPLED = ("time", "q", "v", "a", "tau", "standing", "settled", "touching")
"""Attributes of a motion that have a value for every sample."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """Samples of a recording as the regressor wants them.

    Attributes:
        time: [s], shape (N,); sample numbers when the recording has no time.
        q: Configuration, shape (N, nq).
        v: Velocity, shape (N, nv).
        a: Acceleration, shape (N, nv).
        tau: Torque as logged, shape (N, nv).
        velocity_noise: Standard deviation of the noise left in ``v``, shape (nv,); zeros where it cannot be known.
        standing: Which samples find which degree of freedom standing, shape (N, nv); none where it cannot be known.
        settled: Which samples are away from the ends of stretches of time, shape (N,).
        cutoff: Of the low-pass that the positions went through [Hz]; inf when nothing was filtered.
        unmeasured: Degrees of freedom without a torque; zeros stand for it.
        contacts: Frames that touch the world with wrenches that nobody measured.
        touching: When each of them does, shape (N, contacts); None where there are none.
    """

    time: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    velocity_noise: Array
    standing: npt.NDArray[np.bool_]
    settled: npt.NDArray[np.bool_]
    cutoff: float
    unmeasured: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    touching: npt.NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        for name in ("time", "q", "v", "a", "tau", "velocity_noise"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        self.standing.setflags(write=False)
        self.settled.setflags(write=False)

    def __len__(self) -> int:
        return len(self.time)

    def without_ends(self) -> Motion:
        """The settled samples only."""
        return self if self.settled.all() else self.rows(self.settled)

    def rows(self, chosen: slice | npt.NDArray[np.bool_]) -> Motion:
        """Some samples only, in the order of time."""
        kept = [name for name in SAMPLED if getattr(self, name) is not None]
        return dataclasses.replace(self, **{name: getattr(self, name)[chosen] for name in kept})

    def decimated(self, stride: int) -> Motion:
        """Torque averaged over ``stride`` samples, the motion at their middle: for rates far above the low-pass.

        An even stride has no middle sample; one less is taken then.
        """
        stride -= 1 - stride % 2
        if stride <= 1:
            return self
        whole = len(self) // stride * stride
        middle = slice(stride // 2, whole, stride)
        picked = {name: getattr(self, name)[middle] for name in ("time", "q", "v", "a")}
        parts = (-1, stride, self.tau.shape[1])
        return dataclasses.replace(
            self,
            **picked,
            tau=self.tau[:whole].reshape(parts).mean(axis=1),
            standing=np.asarray(self.standing[:whole].reshape(parts).any(axis=1)),
            settled=np.asarray(self.settled[:whole].reshape(-1, stride).all(axis=1)),
            touching=None if self.touching is None else self._touching_ever(whole, stride),
        )

    def _touching_ever(self, whole: int, stride: int) -> npt.NDArray[np.bool_]:
        """In any of so many samples: what has no contact force loses nothing but equations when it is taken out."""
        assert self.touching is not None
        return np.asarray(self.touching[:whole].reshape(-1, stride, len(self.contacts)).any(axis=1))


class MotionScales(NamedTuple):
    """What tells a stand from a motion: figures of a whole recording.

    Attributes:
        noise: Standard deviation of position noise by channel, shape (channels,).
        speed: Root mean square velocity by channel, shape (channels,).
    """

    noise: Array
    speed: Array


class MotionPiece(NamedTuple):
    """The motion of some consecutive samples of one stretch of time.

    Attributes:
        motion: Of the piece's own samples, and of those beside them as far as was asked for.
        core: Which of its rows are its own: the cores of all pieces have every sample with a motion once.
        own: The piece's own time [s], from the first moment up to before the second; infinite at a stretch's ends.
        stretch: All of the stretch.
    """

    motion: Motion
    core: slice
    own: tuple[float, float]
    stretch: Stretch


def longest_bridge(cutoff: float, step: float) -> float:
    """Longer steps of time are gaps for a low-pass at ``cutoff`` [Hz], where steps are usually ``step`` [s], [s]."""
    return max(LONGEST_BRIDGE / cutoff, GAP * step)


def motion_pieces(
    robot: Robot,
    source: Source,
    cutoff: float | None,
    *,
    window: float = 0.0,
    gap: float | None = None,
    delays: Array | None = None,
    rows: int = BATCH,
    multiple: int = 1,
    scales: MotionScales | None = None,
) -> Iterator[MotionPiece]:
    """The motion of a recording of any length piece by piece: the same, to rounding, as if it were smoothed as a whole.

    Every piece is smoothed with so many samples beside it that the spline has forgotten where they end
    (:func:`~casysid.signals.smoothing.memory`). A stand that goes on beyond those is judged by the part that is seen.

    Args:
        robot: The robot.
        source: The recording.
        cutoff: Of the smoothing [Hz]; None, or a recording without time, takes the samples as logged.
        window: So much of the motion before and after the core is wanted too [s].
        gap: Longer steps of time part stretches [s]; None: :func:`longest_bridge`.
        delays: By which each degree of freedom's torque is late beside ``source.torque_delay`` [s], shape (nv,).
        rows: Of a core, about.
        multiple: The number of rows in a core is a multiple of it, but for a stretch's last.
        scales: For stands; None takes them from the source's spectrum.
    """
    if cutoff is None or not source.has_time:
        yield from _pieces_as_logged(robot, source, rows)
        return
    own_delays = np.zeros(robot.nv) if delays is None else delays
    latest = max(abs(source.torque_delay), float(np.abs(source.torque_delay + own_delays).max()))
    overlap = memory(cutoff) + latest + window
    gap = longest_bridge(cutoff, source.step) if gap is None else gap
    scales = scales or MotionScales(noise_of(source.spectrum), speed_of(source.spectrum))
    maker = _MotionMaker(robot, source, cutoff, scales, own_delays)
    for piece in pieces(source, overlap, rows=rows, gap=gap, multiple=multiple):
        if piece.stretch.rows.stop - piece.stretch.rows.start >= MINIMUM_SAMPLES:
            made = maker.make(piece, window)
            if made is not None:
                yield made


@single_threaded()
def motion_from_recording(
    robot: Robot,
    recording: Source,
    cutoff: float | None,
    gap: float | None = None,
    delays: Array | None = None,
) -> Motion:
    """The recording's positions smoothed at ``cutoff`` [Hz] and differentiated; each stretch between gaps by itself.

    Motion is taken ``recording.torque_delay`` earlier than the torque's time stamp, as it was when the torque acted.
    A gap is a step of time longer than ``gap`` [s]; None: :func:`longest_bridge`. Each degree of freedom's torque is
    late by ``delays`` more, shape (nv,), [s].

    Unordered samples (no time), and timed ones with ``cutoff`` None that carry velocity and acceleration, are taken as
    logged. Logged velocities are otherwise not used: the spline's derivatives of the position are consistent with it.

    Raises:
        RecordingError: Samples to be taken as logged lack velocity or acceleration, or no stretch is long enough.
    """
    rows = max(len(recording), 1)
    parts = [piece.motion for piece in motion_pieces(robot, recording, cutoff, gap=gap, delays=delays, rows=rows)]
    if not parts:
        raise RecordingError(
            f"{recording.label}: no {MINIMUM_SAMPLES} samples between gaps in time, so nothing can be differentiated"
        )
    return joined_motions(parts)


def joined_motions(parts: list[Motion]) -> Motion:
    """Consecutive motions as one."""
    if len(parts) == 1:
        return parts[0]
    names = [name for name in SAMPLED if getattr(parts[0], name) is not None]
    together: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return dataclasses.replace(parts[0], **together)


@single_threaded()
def low_passed(time: Array, values: Array, cutoff: float) -> Array:
    """Values, shape (N, n), behind the zero-phase low-pass, each stretch between gaps in time by itself."""
    smoothed = [
        build_smoother(time[piece], cutoff).smooth(values[piece]) if len(piece) >= MINIMUM_SAMPLES else values[piece]
        for piece in stretches(time)
    ]
    return np.concatenate(smoothed)


def stretches(time: Array) -> list[npt.NDArray[np.intp]]:
    """Indices of the samples between gaps in time."""
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > GAP * np.median(steps)) + 1
    return np.split(np.arange(len(time)), gaps)


def _pieces_as_logged(robot: Robot, source: Source, rows: int) -> Iterator[MotionPiece]:
    first, stretch = 0, Stretch(slice(0, len(source)), source.start, source.stop)
    for batch in source.batches(rows):
        own = (batch.start if first else -np.inf, np.inf)
        yield MotionPiece(_as_logged(robot, batch, first), slice(0, len(batch)), own, stretch)
        first += len(batch)


def _as_logged(robot: Robot, recording: Recording, first: int) -> Motion:
    if recording.velocity is None or recording.acceleration is None:
        raise RecordingError(
            f"{recording.label}: samples without a low-pass need velocity and acceleration in the log; add v_ and a_ "
            "columns, or time stamps so that they can be differentiated"
        )
    count = len(recording.torque)
    return Motion(
        time=np.arange(first, first + count, dtype=np.float64) if recording.time is None else recording.time,
        q=configuration_from_channels(robot, recording.position),
        v=recording.velocity,
        a=recording.acceleration,
        tau=recording.torque,
        velocity_noise=np.zeros(robot.nv),
        standing=np.zeros((count, robot.nv), dtype=bool),
        settled=np.ones(count, dtype=bool),
        cutoff=np.inf,
        unmeasured=recording.unmeasured,
        contacts=recording.contacts,
        touching=recording.touching,
    )


class _MotionMaker:
    """Makes the motion of pieces of one recording."""

    def __init__(self, robot: Robot, source: Source, cutoff: float, scales: MotionScales, own_delays: Array) -> None:
        self._robot, self._cutoff, self._scales, self._own_delays = robot, cutoff, scales, own_delays
        self._rate, self._step, self._delay = source.rate, source.step, source.torque_delay
        self._rates, self._channels = _single_channels(robot)
        self._velocity_noise = np.zeros(robot.nv)
        gain = smoothed_noise(cutoff, self._rate, 1)
        self._velocity_noise[self._rates] = gain * scales.noise[self._channels]

    def make(self, piece: Piece, window: float) -> MotionPiece | None:
        """Of the core and of ``window`` seconds beside it; None if none of that has a motion within the stretch."""
        recording, core, stretch = piece.recording, piece.core, piece.stretch
        assert recording.time is not None
        time = recording.time
        own = self._own_time(piece, time)
        wanted = slice(
            int(np.searchsorted(time, time[core.start] - window)),
            int(np.searchsorted(time, min(own[1], time[-1]) + window, side="right")),
        )
        within = self._within(time, stretch)
        rows = np.arange(wanted.start, wanted.stop)
        rows = rows[within[wanted]]
        if not len(rows):
            return None
        moved = time[rows] - self._delay
        smoother = build_smoother(time, self._cutoff, grid=Grid(stretch.start, stretch.stop, self._step))
        states = smoother.states(recording.position, moved if self._delay else time[rows])
        q, v, a = state_from_channels(self._robot, *states)
        motion = Motion(
            time=time[rows],
            q=q,
            v=v,
            a=a,
            tau=moved_torque(time, recording.torque, self._own_delays, rows),
            velocity_noise=self._velocity_noise,
            standing=self._standing(recording, time, moved),
            settled=self._settled(moved, stretch),
            cutoff=self._cutoff,
            unmeasured=recording.unmeasured,
            contacts=recording.contacts,
            touching=None if recording.touching is None else recording.touching[rows],
        )
        mine = slice(int(np.searchsorted(rows, core.start)), int(np.searchsorted(rows, core.stop)))
        return MotionPiece(motion, mine, own, stretch)

    @staticmethod
    def _own_time(piece: Piece, time: Array) -> tuple[float, float]:
        rows = piece.stretch.rows
        last = piece.first + piece.core.stop - piece.core.start
        return (
            -np.inf if piece.first == rows.start else float(time[piece.core.start]),
            np.inf if last == rows.stop else float(time[piece.core.stop]),
        )

    def _within(self, time: Array, stretch: Stretch) -> npt.NDArray[np.bool_]:
        """Which samples' torque belongs to a motion within the stretch, and every joint's is within it at that time."""
        moved = time - self._delay
        earliest, latest = min(self._own_delays.min(), 0.0), max(self._own_delays.max(), 0.0)
        inside = (moved >= stretch.start) & (moved <= stretch.stop)
        return np.asarray(inside & (time + earliest >= stretch.start) & (time + latest <= stretch.stop))

    def _settled(self, moved: Array, stretch: Stretch) -> npt.NDArray[np.bool_]:
        """Which samples' motion is away from both ends of its stretch."""
        end = min(SETTLING / self._cutoff, LARGEST_END * (stretch.stop - stretch.start))
        return np.asarray((moved >= stretch.start + end) & (moved <= stretch.stop - end))

    def _standing(self, recording: Recording, time: Array, moved: Array) -> npt.NDArray[np.bool_]:
        """Stands of joints with one channel; no window of the search is longer than a period of the cut-off."""
        channels = self._channels
        stands = np.zeros((len(moved), self._robot.nv), dtype=bool)
        found = standing(
            recording.position[:, channels],
            self._rate,
            self._scales.noise[channels],
            self._scales.speed[channels],
            1.0 / self._cutoff,
        )
        nearest = np.rint(np.interp(moved, time, np.arange(len(time)))).astype(np.intp)
        stands[:, self._rates] = found[nearest]
        return stands


def _single_channels(robot: Robot) -> tuple[list[int], list[int]]:
    """Places in rates and channels of the joints that have one of each."""
    single = [joint for joint in robot.joints if joint.channels.stop - joint.channels.start == 1]
    return [joint.v.start for joint in single], [joint.channels.start for joint in single]

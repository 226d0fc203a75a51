"""Motion: smoothed ``q, v, a`` and the torque beside them, ready for the regressor."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import RecordingError
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.robot.coordinates import configuration_from_channels, state_from_channels
from casysid.signals.noise import position_noise
from casysid.signals.smoothing import Smoother, build_smoother
from casysid.signals.standstill import standing
from casysid.threads import single_threaded

MINIMUM_SAMPLES = 8
LONGEST_RESPONSE = 4096
GAP_IN_STEPS = 5.0
SETTLING = 1.0
"""So many periods of the cut-off from an end, the spline is as good as anywhere: what an end does to it falls to
``exp(-π)`` in one."""
LARGEST_END = 0.05
"""But no more than this share of a stretch counts as one of its ends."""


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

    def __post_init__(self) -> None:
        for name in ("time", "q", "v", "a", "tau", "velocity_noise"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        self.standing.setflags(write=False)
        self.settled.setflags(write=False)

    def __len__(self) -> int:
        return len(self.time)

    def without_ends(self) -> Motion:
        """The settled samples only."""
        if self.settled.all():
            return self
        kept = ("time", "q", "v", "a", "tau", "standing", "settled")
        return dataclasses.replace(self, **{name: getattr(self, name)[self.settled] for name in kept})

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
        )


@single_threaded()
def motion_from_recording(robot: Robot, recording: Recording, cutoff: float | None) -> Motion:
    """The recording's positions smoothed at ``cutoff`` [Hz] and differentiated; each stretch between gaps by itself.

    Motion is taken ``recording.torque_delay`` earlier than the torque's time stamp, as it was when the torque acted.

    Unordered samples (no time), and timed ones with ``cutoff`` None that carry velocity and acceleration, are taken as
    logged. Logged velocities are otherwise not used: the spline's derivatives of the position are consistent with it.
    """
    if recording.time is None or cutoff is None:
        return _as_logged(robot, recording)
    pieces = [piece for piece in recording.segments if piece.stop - piece.start >= MINIMUM_SAMPLES]
    wanted = [_rows_with_motion(recording, piece) for piece in pieces]
    smoothers = [build_smoother(recording.time[piece], cutoff) for piece in pieces]
    smoothed = [
        _smooth_piece(robot, recording, smoother, piece, rows)
        for smoother, piece, rows in zip(smoothers, pieces, wanted, strict=True)
    ]
    q, v, a = (np.concatenate([piece[k] for piece in smoothed]) for k in range(3))
    rows = np.concatenate(wanted)
    smoother, longest = max(zip(smoothers, pieces, strict=True), key=lambda pair: len(pair[0].time))
    noise = position_noise(recording.time[longest], recording.position[longest])
    return Motion(
        time=recording.time[rows],
        q=q,
        v=v,
        a=a,
        tau=recording.torque[rows],
        velocity_noise=_velocity_noise(robot, smoother, noise),
        standing=_standing(robot, recording, pieces, wanted, noise, v, cutoff),
        settled=np.concatenate(
            [_settled(recording, piece, rows, cutoff) for piece, rows in zip(pieces, wanted, strict=True)]
        ),
        cutoff=cutoff,
    )


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
    gaps = np.flatnonzero(steps > GAP_IN_STEPS * np.median(steps)) + 1
    return np.split(np.arange(len(time)), gaps)


def _as_logged(robot: Robot, recording: Recording) -> Motion:
    if recording.velocity is None or recording.acceleration is None:
        raise RecordingError(
            f"{recording.label}: samples without a low-pass need velocity and acceleration in the log; add v_ and a_ "
            "columns, or time stamps so that they can be differentiated"
        )
    count = len(recording.torque)
    return Motion(
        time=np.arange(count, dtype=np.float64) if recording.time is None else recording.time,
        q=configuration_from_channels(robot, recording.position),
        v=recording.velocity,
        a=recording.acceleration,
        tau=recording.torque,
        velocity_noise=np.zeros(robot.nv),
        standing=np.zeros((count, robot.nv), dtype=bool),
        settled=np.ones(count, dtype=bool),
        cutoff=np.inf,
    )


def _rows_with_motion(recording: Recording, piece: slice) -> npt.NDArray[np.intp]:
    """Samples of a stretch whose torque belongs to a motion within it."""
    assert recording.time is not None
    time, rows = recording.time[piece], np.arange(piece.start, piece.stop)
    moved = time - recording.torque_delay
    return np.asarray(rows[(moved >= time[0]) & (moved <= time[-1])])


def _smooth_piece(
    robot: Robot, recording: Recording, smoother: Smoother, piece: slice, rows: npt.NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    assert recording.time is not None
    at = recording.time[rows] - recording.torque_delay if recording.torque_delay else None
    return state_from_channels(robot, *smoother.states(recording.position[piece], at))


def _settled(recording: Recording, piece: slice, rows: npt.NDArray[np.intp], cutoff: float) -> npt.NDArray[np.bool_]:
    """Which samples' motion is away from both ends of its stretch."""
    assert recording.time is not None
    time, moved = recording.time[piece], recording.time[rows] - recording.torque_delay
    end = min(SETTLING / cutoff, LARGEST_END * (time[-1] - time[0]))
    return np.asarray((moved >= time[0] + end) & (moved <= time[-1] - end))


def _velocity_noise(robot: Robot, smoother: Smoother, channel_noise: Array) -> Array:
    """Noise of the smoothed velocity of each degree of freedom, for joints with one channel each."""
    if len(smoother.time) > LONGEST_RESPONSE:
        smoother = build_smoother(smoother.time[:LONGEST_RESPONSE], smoother.cutoff)
    gain = np.sqrt(smoother.noise_covariance()[1, 1])
    noise = np.zeros(robot.nv)
    rates, channels = _single_channels(robot)
    noise[rates] = gain * channel_noise[channels]
    return noise


def _standing(
    robot: Robot,
    recording: Recording,
    pieces: Sequence[slice],
    wanted: Sequence[npt.NDArray[np.intp]],
    channel_noise: Array,
    v: Array,
    cutoff: float,
) -> npt.NDArray[np.bool_]:
    """Stands of the joints with one channel each; no window of the search is longer than a period of the cut-off."""
    rates, channels = _single_channels(robot)
    speed = np.sqrt(np.mean(v[:, rates] ** 2, axis=0))
    stands = np.zeros(v.shape, dtype=bool)
    found = [
        standing(recording.position[piece, channels], recording.rate, channel_noise[channels], speed, 1.0 / cutoff)
        for piece in pieces
    ]
    at = [_samples_of_motion(recording, piece, rows) for piece, rows in zip(pieces, wanted, strict=True)]
    stands[:, rates] = np.concatenate([still[rows] for still, rows in zip(found, at, strict=True)])
    return stands


def _samples_of_motion(recording: Recording, piece: slice, rows: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """The samples of a stretch nearest to the motion that belongs to the torque of ``rows``."""
    assert recording.time is not None
    time = recording.time[piece]
    number = np.interp(recording.time[rows] - recording.torque_delay, time, np.arange(len(time)))
    return np.asarray(np.rint(number).astype(np.intp))


def _single_channels(robot: Robot) -> tuple[list[int], list[int]]:
    """Places in rates and channels of the joints that have one of each."""
    single = [joint for joint in robot.joints if joint.channels.stop - joint.channels.start == 1]
    return [joint.v.start for joint in single], [joint.channels.start for joint in single]

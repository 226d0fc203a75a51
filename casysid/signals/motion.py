"""Motion: smoothed ``q, v, a`` with the torque seen through the same filter, ready for the regressor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import RecordingError
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.robot.coordinates import configuration_from_channels, state_from_channels
from casysid.signals.noise import position_noise
from casysid.signals.smoothing import build_smoother

MINIMUM_SAMPLES = 8


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """Samples of one or more recordings as the regressor wants them.

    Attributes:
        time: [s], shape (N,); sample numbers when the recording has no time.
        q: Configuration, shape (N, nq).
        v: Velocity, shape (N, nv).
        a: Acceleration, shape (N, nv).
        tau: Torque through the same low-pass as the motion, shape (N, nv).
        tau_measured: Torque as logged, shape (N, nv).
        velocity_noise: Standard deviation of the noise left in ``v``, shape (nv,); zeros when it cannot be known.
        cutoff: Cut-off of the low-pass [Hz]; inf when nothing was filtered.
    """

    time: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    tau_measured: Array
    velocity_noise: Array
    cutoff: float

    def __post_init__(self) -> None:
        for name in ("time", "q", "v", "a", "tau", "tau_measured", "velocity_noise"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.time)

    def every(self, stride: int) -> Motion:
        """Every ``stride``-th sample; the low-pass has already made the others nearly redundant."""
        picked = {name: getattr(self, name)[::stride] for name in ("time", "q", "v", "a", "tau", "tau_measured")}
        return Motion(**picked, velocity_noise=self.velocity_noise, cutoff=self.cutoff)


def motion_from_recording(robot: Robot, recording: Recording, cutoff: float | None) -> Motion:
    """The recording smoothed at ``cutoff`` [Hz] and differentiated; each stretch between gaps by itself.

    Unordered samples (no time), and timed ones with ``cutoff`` None that carry velocity and acceleration, are taken as
    logged. Logged velocities are otherwise not used: the spline's derivatives of the position are consistent with it.
    """
    if recording.time is None or cutoff is None:
        return _as_logged(robot, recording)
    pieces = [piece for piece in recording.segments if piece.stop - piece.start >= MINIMUM_SAMPLES]
    smoothed = [_smooth_piece(robot, recording, piece, cutoff) for piece in pieces]
    q, v, a, tau = (np.concatenate([piece[k] for piece in smoothed]) for k in range(4))
    rows = np.concatenate([np.arange(piece.start, piece.stop) for piece in pieces])
    longest = max(pieces, key=lambda piece: piece.stop - piece.start)
    return Motion(
        time=recording.time[rows],
        q=q,
        v=v,
        a=a,
        tau=tau,
        tau_measured=recording.torque[rows],
        velocity_noise=_velocity_noise(robot, recording, longest, cutoff),
        cutoff=cutoff,
    )


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
        tau_measured=recording.torque,
        velocity_noise=np.zeros(robot.nv),
        cutoff=np.inf,
    )


def _smooth_piece(robot: Robot, recording: Recording, piece: slice, cutoff: float) -> tuple[Array, Array, Array, Array]:
    assert recording.time is not None
    smoother = build_smoother(recording.time[piece], cutoff)
    position, first, second = (smoother.smooth(recording.position[piece], derivative) for derivative in range(3))
    return *state_from_channels(robot, position, first, second), smoother.smooth(recording.torque[piece])


def _velocity_noise(robot: Robot, recording: Recording, piece: slice, cutoff: float) -> Array:
    """Noise of the smoothed velocity of each degree of freedom, known for joints with one channel each."""
    assert recording.time is not None
    time = recording.time[piece]
    gain = np.sqrt(build_smoother(time[: min(len(time), 4096)], cutoff).noise_covariance()[1, 1])
    channel_noise = gain * position_noise(time, recording.position[piece])
    noise = np.zeros(robot.nv)
    for joint in robot.joints:
        if joint.channels.stop - joint.channels.start == 1:
            noise[joint.v] = channel_noise[joint.channels]
    return noise

"""Samples as they come, smoothed with a stated lag: the same motion, to a thousandth, as of the whole recording."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import Motion
from casysid.signals.averaging import SPACING
from casysid.signals.motion import MotionScales, motion_pieces
from casysid.signals.smoothing import memory

TOLERANCE = 1e-3
"""Of what the next samples would change in a smoothed one, as a fraction of itself."""
WINDOWS = 5
"""Averages of the equations in one batch at least. Its two ends cut as many as reach over them, three, which hold less
than their share; a longer batch would be noticed later."""
SHORTEST = 0.25
"""Batches are not shorter [s]: four a second cost little beside their samples."""


class Samples:
    """A buffer of logged samples.

    Attributes:
        dropped: Samples that were left out: time that does not go on, numbers that are not finite.
    """

    def __init__(self, robot: Robot) -> None:
        """Empty, for the robot's channels and degrees of freedom."""
        self._robot = robot
        self._channels, self._dofs = len(robot.channels), len(robot.dofs)
        self._rows = np.empty((1 << 10, 1 + self._channels + self._dofs))
        self._count = self.dropped = 0

    def __len__(self) -> int:
        return self._count

    @property
    def newest(self) -> float:
        """Time of the newest sample [s]; minus infinity without any."""
        return float(self._rows[self._count - 1, 0]) if self._count else -np.inf

    @property
    def oldest(self) -> float:
        """Time of the oldest sample that is still here [s]."""
        return float(self._rows[0, 0]) if self._count else np.inf

    def add(self, time: npt.ArrayLike, position: npt.ArrayLike, torque: npt.ArrayLike) -> None:
        """One sample, or several in the order of time.

        Raises:
            RecordingError: A shape does not fit.
        """
        t = np.atleast_1d(np.asarray(time, dtype=np.float64))
        q, tau = (np.atleast_2d(np.asarray(one, dtype=np.float64)) for one in (position, torque))
        wanted = (len(t), self._channels), (len(t), self._dofs)
        if t.ndim != 1 or (q.shape, tau.shape) != wanted:
            raise RecordingError(
                f"online: wanted time (N,), position (N, {self._channels}) and torque (N, {self._dofs}), or one sample "
                f"of them; got {np.shape(time)}, {np.shape(position)} and {np.shape(torque)}"
            )
        rows = np.column_stack([t, q, tau])
        sound = np.isfinite(rows).all(axis=1)
        before = np.maximum.accumulate(np.where(sound, t, -np.inf))
        sound &= t > np.maximum(np.append(-np.inf, before[:-1]), self.newest)
        self.dropped += int(np.sum(~sound))
        rows = rows if sound.all() else rows[sound]
        while self._count + len(rows) > len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self._count : self._count + len(rows)] = rows
        self._count += len(rows)

    def recording(self, until: float = np.inf) -> Recording:
        """All that is here, up to a time [s]."""
        rows = self._rows[: int(np.searchsorted(self._rows[: self._count, 0], until, side="right"))].copy()
        return Recording.unchecked(
            channels=self._robot.channels,
            dofs=self._robot.dofs,
            time=rows[:, 0],
            position=rows[:, 1 : 1 + self._channels],
            torque=rows[:, 1 + self._channels :],
        )

    def forget_before(self, time: float) -> None:
        """Leave only samples from then on [s]."""
        first = int(np.searchsorted(self._rows[: self._count, 0], time))
        self._rows[: self._count - first] = self._rows[first : self._count]
        self._count -= first


class MotionStream:
    """Batches of motion out of a buffer, each once its samples have enough others after them.

    Attributes:
        hop: Length of a batch [s].
        overlap: Samples of so much time on either side are looked at with it [s].
    """

    def __init__(
        self, robot: Robot, *, smoothing: float, cutoff: float, delays: Array, scales: MotionScales, stride: int
    ) -> None:
        """For one robot.

        Args:
            robot: The robot.
            smoothing: Cut-off of the positions' smoothing [Hz].
            cutoff: Of the equations' average [Hz].
            delays: By which each degree of freedom's torque is late, shape (nv,), [s].
            scales: That tell stands from motions.
            stride: Samples of which one is left.
        """
        self._robot, self._smoothing, self._delays, self._scales = robot, smoothing, delays, scales
        self._stride = stride
        self.hop = max(SHORTEST, WINDOWS * SPACING / cutoff)
        self.overlap = memory(smoothing, TOLERANCE) + float(np.abs(delays).max(initial=0.0))
        self._next = -np.inf

    @property
    def lag(self) -> float:
        """From a sample to its use at most [s]."""
        return self.hop + self.overlap

    def batches(self, samples: Samples) -> Iterator[Motion]:
        """The motion of all batches that are complete; their samples are forgotten."""
        while len(samples):
            start = max(self._next, samples.oldest)
            stop = start + self.hop
            if samples.newest < stop + self.overlap:
                return
            yield from self._batch(samples.recording(stop + self.overlap), start, stop)
            self._next = stop
            samples.forget_before(stop - self.overlap)

    def _batch(self, seen: Recording, start: float, stop: float) -> Iterator[Motion]:
        for piece in motion_pieces(
            self._robot, seen, self._smoothing, delays=self._delays, rows=max(len(seen), 1), scales=self._scales
        ):
            own = (piece.motion.time >= start) & (piece.motion.time < stop)
            motion = piece.motion.rows(own).decimated(self._stride)
            if len(motion):
                yield motion

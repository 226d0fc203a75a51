"""What a recording offers, be it in memory or on disk."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from casysid.errors import ParameterError, RecordingError

if TYPE_CHECKING:
    from casysid.recording.recording import Recording
    from casysid.recording.spectrum import PositionSpectrum
    from casysid.recording.summary import RecordingSummary

BATCH = 1 << 16
"""Rows of a batch: some megabytes, of which a step of work is large beside what Python adds to it."""
EXCERPTS = 16
"""Excerpts of a long recording, by default."""


Change = Callable[["Recording", int], "Recording"]


class Stretch(NamedTuple):
    """A run of samples between two gaps in time: its ``rows``, the time of its first and of its last sample [s]."""

    rows: slice
    start: float
    stop: float


class Source(ABC):
    """Samples in the order of time, given out in batches. What is in memory and what is on disk differ in nothing else.

    Attributes:
        channels: Names of the position channels.
        dofs: Names of the degrees of freedom.
        torque_delay: By how much the torque's time stamps are late against the positions' [s].
        sources: Files it came from.
        unused_columns: Columns of those files that were left aside.
        unmeasured: Degrees of freedom without a torque; zeros stand for it.
        contacts: Frames that touch the world with wrenches that nobody measured.
        wrenches: Frames whose measured wrenches are in the torques.
    """

    channels: tuple[str, ...]
    dofs: tuple[str, ...]
    torque_delay: float
    sources: tuple[str, ...]
    unused_columns: tuple[str, ...]
    unmeasured: tuple[str, ...]
    contacts: tuple[str, ...]
    wrenches: tuple[str, ...]

    @abstractmethod
    def __len__(self) -> int: ...

    @property
    def label(self) -> str:
        """What to call it in a message."""
        return ", ".join(self.sources) or "recording"

    @property
    @abstractmethod
    def has_time(self) -> bool:
        """Whether the samples have time stamps; unordered samples have none."""

    @property
    @abstractmethod
    def has_velocity(self) -> bool:
        """Whether velocities were logged."""

    @property
    @abstractmethod
    def has_acceleration(self) -> bool:
        """Whether accelerations were logged."""

    @property
    def logged(self) -> tuple[str, ...]:
        """Which of q, v, a, tau are there."""
        return ("q", *("v" * self.has_velocity), *("a" * self.has_acceleration), "tau")

    @property
    @abstractmethod
    def start(self) -> float:
        """Time of the first sample [s]; nan without time."""

    @property
    @abstractmethod
    def stop(self) -> float:
        """Time of the last sample [s]; nan without time."""

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]; nan without time."""
        return self.stop - self.start

    @property
    @abstractmethod
    def step(self) -> float:
        """Median step of time [s]; nan without time."""

    @property
    @abstractmethod
    def rate(self) -> float:
        """Samples per second, gaps left out [Hz]; nan without time."""

    @abstractmethod
    def stretches(self, gap: float | None = None) -> tuple[Stretch, ...]:
        """The runs of samples between steps of time longer than ``gap`` [s], five median steps if None.

        None without time. The order is that of time, and together they hold every sample once.
        """

    @property
    def segments(self) -> tuple[slice, ...]:
        """Rows of the runs of samples between steps of time longer than five median steps; empty without time."""
        return tuple(stretch.rows for stretch in self.stretches())

    @property
    @abstractmethod
    def spectrum(self) -> PositionSpectrum:
        """Averaged periodogram of the positions.

        Raises:
            RecordingError: Samples without time have none.
        """

    @abstractmethod
    def batches(self, rows: int = BATCH) -> Iterator[Recording]:
        """All samples in their order, in consecutive recordings of at most ``rows`` rows."""

    @abstractmethod
    def in_memory(self) -> Recording:
        """All samples at once."""

    @abstractmethod
    def summary(self) -> RecordingSummary:
        """What there is, in figures."""

    @abstractmethod
    def between(self, first: int, last: int) -> Self:
        """The samples from row ``first`` up to before row ``last``."""

    @abstractmethod
    def row_of(self, time: float) -> int:
        """The first row at ``time`` [s] or later; the number of rows when there is none."""

    @abstractmethod
    def flipped(self, columns: Sequence[str]) -> Self:
        """With the signs of some columns turned.

        Args:
            columns: ``tau_<joint>``; ``q_<joint>``, its velocity and acceleration with it; ``<joint>`` for both, as
                where its axis points the other way; ``tau`` for the torques of all joints.

        Raises:
            ParameterError: A column that is none of these, or of a joint that moves in several ways.
        """

    @abstractmethod
    def with_time_scaled(self, scale: float) -> Self:
        """With the time stamps multiplied; velocities and accelerations stay as logged."""

    @abstractmethod
    def mapped(self, change: Change) -> Self:
        """With other values of as many samples: ``change`` is given consecutive parts, and the row of their first."""

    @abstractmethod
    def with_torque_delay(self, delay: float) -> Self:
        """Told that its torques are so late [s] in all."""

    def split(self, fraction: float) -> tuple[Self, Self]:
        """The first ``fraction`` of the time and the rest; of the rows in their order when there is no time.

        Raises:
            ParameterError: If ``fraction`` is not between 0 and 1, or leaves one side empty.
        """
        if not 0.0 < fraction < 1.0:
            raise ParameterError(f"split: fraction must lie between 0 and 1, both excluded; got {fraction}")
        timed = self.has_time and len(self) > 0
        cut = self.row_of(self.start + fraction * self.duration) if timed else int(fraction * len(self))
        if cut in (0, len(self)):
            raise ParameterError(f"split: fraction {fraction} of {len(self)} samples leaves one side empty")
        return self.between(0, cut), self.between(cut, len(self))

    def trimmed(self, start: float | None = None, stop: float | None = None) -> Self:
        """The samples with ``start <= time < stop`` [s], in the recording's own clock; None leaves that end open.

        Raises:
            RecordingError: If there is no time, or no sample in that interval.
        """
        if not self.has_time:
            raise RecordingError(f"{self.label}: samples without time cannot be trimmed by time")
        first = 0 if start is None else self.row_of(start)
        last = len(self) if stop is None else self.row_of(stop)
        if first >= last:
            raise RecordingError(
                f"{self.label}: no samples from {start} s to {stop} s; "
                f"the recording runs from {self.start:.6g} s to {self.stop:.6g} s"
            )
        return self.between(first, last)

    def excerpts(self, count: int = EXCERPTS, rows: int = BATCH // EXCERPTS) -> tuple[Recording, ...]:
        """Short recordings in memory from ``count`` places evenly over this one; all of it if it is no longer."""
        if len(self) <= count * rows:
            from casysid.recording.recording import joined

            return (joined(tuple(self.batches(max(len(self), 1)))),)
        starts = np.linspace(0, len(self) - rows, count).astype(int).tolist()
        parts = (next(self.between(start, start + rows).batches(rows)) for start in starts)
        return tuple(dataclasses.replace(part) for part in parts)  # copies, where a part may be a view of a batch


def signs_of(source: Source, columns: Sequence[str]) -> tuple[list[float], list[float], list[float]]:
    """Signs of the positions by channel, of the motion and of the torque by degree of freedom; see `Source.flipped`."""
    single = [name for name in source.channels if name in source.dofs]
    known = ["tau", *(f"tau_{name}" for name in source.dofs), *(f"q_{name}" for name in single), *single]
    unknown = [column for column in columns if column not in known]
    if unknown:
        raise ParameterError(f"flip: no column {', '.join(unknown)} to turn; known are {', '.join(known)}")
    motion = {name: (-1.0) ** sum(column in (name, f"q_{name}") for column in columns) for name in source.dofs}
    torque = [(-1.0) ** sum(column in (name, f"tau_{name}", "tau") for column in columns) for name in source.dofs]
    return [motion[name] if name in single else 1.0 for name in source.channels], list(motion.values()), torque

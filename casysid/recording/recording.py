"""A recording: named, timed samples of a robot, checked once and never changed.

Positions are kept as they were logged, by *channel* (a continuous joint is one angle, a free-flyer seven numbers);
velocities, accelerations and torques by *degree of freedom*. Without time stamps the rows are unordered samples, and
then velocities and accelerations must be there, since nothing can be differentiated.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError, RecordingError
from casysid.recording.resolution import ResolutionScan
from casysid.recording.source import BATCH, Change, Source, Stretch, signs_of
from casysid.recording.spectrum import PositionSpectrum, SpectrumScan
from casysid.recording.summary import RecordingSummary

GAP = 5.0
"""A step of time longer than this many median steps is a gap."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Recording(Source):
    """Samples of positions and torques, and whatever of velocity, acceleration and time was logged; read-only.

    Attributes:
        channels: Names of the position channels (``robot.channels``).
        dofs: Names of the degrees of freedom (``robot.dofs``).
        position: Shape (N, channels), [rad, m; quaternions x y z w].
        torque: Shape (N, dofs), [N m, N].
        time: Strictly increasing, shape (N,), [s]; None for unordered samples.
        velocity: As logged, shape (N, dofs), [rad/s, m/s]; None when not logged.
        acceleration: As logged, shape (N, dofs), [rad/s², m/s²]; None when not logged.
        torque_delay: By how much the torque's time stamps are late against the positions' [s]; motion is taken so much
            earlier (:func:`casysid.signals.motion_from_recording`). Not written to files.
        sources: Files it came from.
        unused_columns: Columns of those files that were left aside.
        unmeasured: Degrees of freedom without a torque; zeros stand for it.
        contacts: Frames that touch the world with wrenches that nobody measured.
        touching: When each of them does, boolean, shape (N, contacts); None where there are none.
        wrenches: Frames whose measured wrenches are in ``torque``.

    Raises:
        RecordingError: On wrong shapes, values that are not finite, time that does not increase, or unordered samples
            without velocity or acceleration.
    """

    channels: tuple[str, ...]
    dofs: tuple[str, ...]
    position: Array = field(repr=False)
    torque: Array = field(repr=False)
    time: Array | None = field(default=None, repr=False)
    velocity: Array | None = field(default=None, repr=False)
    acceleration: Array | None = field(default=None, repr=False)
    torque_delay: float = 0.0
    sources: tuple[str, ...] = ()
    unused_columns: tuple[str, ...] = field(default=(), repr=False)
    unmeasured: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    touching: npt.NDArray[np.bool_] | None = field(default=None, repr=False)
    wrenches: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        samples = next(iter(np.shape(self.position)), 0)
        widths = {"position": (len(self.channels),), "torque": (len(self.dofs),), "time": ()}
        widths |= {"velocity": (len(self.dofs),), "acceleration": (len(self.dofs),)}
        for name, width in widths.items():
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, self._checked(name, frozen(values), (samples, *width)))
        self._check_touching(samples)
        if self.time is None and (self.velocity is None or self.acceleration is None):
            raise RecordingError(
                f"{self.label}: without time the samples are unordered and nothing can be differentiated; "
                "give time, or velocity and acceleration"
            )
        if self.time is not None and (np.diff(self.time) <= 0.0).any():
            raise RecordingError(
                f"{self.label}: time must increase from each sample to the next; sort the samples by time"
            )

    def _check_touching(self, samples: int) -> None:
        if self.touching is None and not self.contacts:
            return
        touching = np.array(self.touching)
        if touching.dtype != np.bool_ or touching.shape != (samples, len(self.contacts)):
            raise RecordingError(
                f"{self.label}: touching must be boolean with shape ({samples}, {len(self.contacts)}), one for each "
                f"contact; got {touching.dtype} with shape {touching.shape}"
            )
        touching.setflags(write=False)
        object.__setattr__(self, "touching", touching)

    def _checked(self, name: str, values: Array, shape: tuple[int, ...]) -> Array:
        if values.shape != shape:
            raise RecordingError(f"{self.label}: {name} must have shape {shape}; got {values.shape}")
        if not np.isfinite(values).all():
            first = np.argwhere(~np.isfinite(values))[0]
            raise RecordingError(
                f"{self.label}: {name} must be finite; got {values[tuple(first)]} in sample {first[0]}"
            )
        return values

    @classmethod
    def unchecked(cls, **fields: Any) -> Recording:
        """A recording of arrays that are known to be sound: taken as they are, neither checked nor copied."""
        recording = object.__new__(cls)
        for one in dataclasses.fields(cls):
            value = fields.get(one.name, one.default)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(recording, one.name, value)
        return recording

    def _with(self, **fields: Any) -> Recording:
        return Recording.unchecked(**({one.name: getattr(self, one.name) for one in dataclasses.fields(self)} | fields))

    def __len__(self) -> int:
        return len(self.position)

    @property
    def has_time(self) -> bool:
        """Whether the samples have time stamps."""
        return self.time is not None

    @property
    def has_velocity(self) -> bool:
        """Whether velocities were logged."""
        return self.velocity is not None

    @property
    def has_acceleration(self) -> bool:
        """Whether accelerations were logged."""
        return self.acceleration is not None

    @property
    def start(self) -> float:
        """Time of the first sample [s]; nan without time."""
        return float(self.time[0]) if self.time is not None and len(self) else float("nan")

    @property
    def stop(self) -> float:
        """Time of the last sample [s]; nan without time."""
        return float(self.time[-1]) if self.time is not None and len(self) else float("nan")

    @cached_property
    def step(self) -> float:
        """Median step of time [s]; nan without time."""
        return float(np.median(self._steps)) if len(self._steps) else float("nan")

    @cached_property
    def rate(self) -> float:
        """Samples per second, gaps left out [Hz]; nan without time."""
        gaps = self._steps[self._steps > GAP * self.step]
        count, length = len(self._steps) - len(gaps), self.duration - float(gaps.sum())
        return count / length if count and length > 0.0 else float("nan")

    def stretches(self, gap: float | None = None) -> tuple[Stretch, ...]:
        """The runs of samples between gaps in time; see :meth:`Source.stretches`."""
        if self.time is None:
            return ()
        longest = GAP * self.step if gap is None else gap
        edges = [0, *(np.flatnonzero(self._steps > longest) + 1).tolist(), len(self)]
        return tuple(
            Stretch(slice(first, last), float(self.time[first]), float(self.time[last - 1]))
            for first, last in pairwise(edges)
            if last > first
        )

    @cached_property
    def _steps(self) -> Array:
        return np.diff(self.time) if self.time is not None else np.empty(0)

    @cached_property
    def spectrum(self) -> PositionSpectrum:
        """Averaged periodogram of the positions.

        Raises:
            RecordingError: Samples without time, or fewer than two, have none.
        """
        scan, resolution = SpectrumScan(), ResolutionScan()
        for batch in self.batches() if self.time is not None else ():
            assert batch.time is not None
            scan.add(batch.time, batch.position)
            resolution.add(batch.position)
        spectrum = scan.finish(resolution.finish(), self.duration, len(self))
        if spectrum is None:
            raise RecordingError(f"{self.label}: no spectrum without two samples in time")
        return spectrum

    def selected(self, rows: slice | npt.NDArray[np.intp]) -> Recording:
        """Some samples only, in the order of time; a slice is a view."""
        return self._with(
            position=self.position[rows],
            torque=self.torque[rows],
            time=None if self.time is None else self.time[rows],
            velocity=None if self.velocity is None else self.velocity[rows],
            acceleration=None if self.acceleration is None else self.acceleration[rows],
            touching=None if self.touching is None else self.touching[rows],
        )

    def with_position(self, position: Array) -> Recording:
        """The recording with other positions, taken as they are."""
        return self._with(position=position)

    def between(self, first: int, last: int) -> Recording:
        """The samples from row ``first`` up to before row ``last``."""
        return self.selected(slice(first, last))

    def row_of(self, time: float) -> int:
        """The first row at ``time`` [s] or later; the number of rows when there is none."""
        if self.time is None:
            raise RecordingError(f"{self.label}: samples without time have no row at {time} s")
        return int(np.searchsorted(self.time, time))

    def batches(self, rows: int = BATCH) -> Iterator[Recording]:
        """All samples in their order, in consecutive views of at most ``rows`` rows."""
        for first in range(0, len(self), rows):
            yield self.selected(slice(first, first + rows))

    def with_time_scaled(self, scale: float) -> Recording:
        """The recording with its time stamps multiplied; velocities and accelerations stay as logged."""
        if self.time is None:
            return self
        return dataclasses.replace(self, time=self.time * scale, torque_delay=self.torque_delay * scale)

    def mapped(self, change: Change) -> Recording:
        """What ``change`` makes of the recording, from row 0."""
        return change(self, 0)

    def with_torque_delay(self, delay: float) -> Recording:
        """The recording, told that its torques are so late [s] in all."""
        return self._with(torque_delay=delay)

    def flipped(self, columns: Sequence[str]) -> Recording:
        """The recording with the signs of some columns turned; see :meth:`Source.flipped`."""
        position, motion, torque = signs_of(self, columns)
        return dataclasses.replace(
            self,
            position=self.position * position,
            velocity=None if self.velocity is None else self.velocity * motion,
            acceleration=None if self.acceleration is None else self.acceleration * motion,
            torque=self.torque * torque,
        )

    def decimated(self, factor: int) -> Recording:
        """Every ``factor``-th sample, plainly picked.

        What is faster than half the new rate folds back (aliases), unless a low-pass has removed it before.

        Raises:
            ParameterError: If ``factor`` is not a positive whole number.
        """
        if factor != int(factor) or factor < 1:
            raise ParameterError(f"decimated: factor must be a positive whole number; got {factor}")
        return self.selected(slice(None, None, int(factor)))

    def in_memory(self) -> Recording:
        """Itself."""
        return self

    def summary(self) -> RecordingSummary:
        """What there is, in figures."""
        return RecordingSummary(
            sources=self.sources,
            samples=len(self),
            duration=self.duration,
            rate=self.rate,
            segments=len(self.segments),
            logged=self.logged,
            position_range={
                c: (float(x.min()), float(x.max())) for c, x in zip(self.channels, self.position.T, strict=True)
            },
            torque_rms={d: float(np.sqrt(np.mean(x**2))) for d, x in zip(self.dofs, self.torque.T, strict=True)},
            torque_peak={d: float(np.abs(x).max()) for d, x in zip(self.dofs, self.torque.T, strict=True)},
            unused_columns=self.unused_columns,
        )

    def columns(self) -> dict[str, Array]:
        """The arrays as columns, named by the convention."""
        columns = {} if self.time is None else {"time": self.time}
        for letter, names, values in (
            ("q", self.channels, self.position),
            ("v", self.dofs, self.velocity),
            ("a", self.dofs, self.acceleration),
            ("tau", self.dofs, self.torque),
        ):
            if values is not None:
                columns |= {f"{letter}_{name}": column for name, column in zip(names, values.T, strict=True)}
        if self.touching is not None:
            flags = self.touching.T.astype(np.float64)
            columns |= {f"contact_{name}": column for name, column in zip(self.contacts, flags, strict=True)}
        return columns

    def write(self, path: str | Path) -> Path:
        """Write by suffix (.csv, .csv.gz, .tsv, .parquet, .npz), columns by name; read back, the numbers are the same.

        Returns:
            The path. A file that was there is replaced, and only once the new one is complete.

        Raises:
            RecordingError: If the suffix is none of these.
        """
        from casysid.readers.writing import write_columns

        return write_columns(Path(path), self.columns())


def joined(parts: Sequence[Recording]) -> Recording:
    """Consecutive recordings as one."""
    if len(parts) == 1:
        return parts[0]

    def together(name: str) -> npt.NDArray[Any] | None:
        values = [getattr(part, name) for part in parts]
        return None if values[0] is None else np.concatenate(values)

    names = ("time", "position", "velocity", "acceleration", "torque", "touching")
    fields = {one.name: getattr(parts[0], one.name) for one in dataclasses.fields(Recording)}
    return Recording.unchecked(**(fields | {name: together(name) for name in names}))

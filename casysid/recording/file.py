"""A recording that stays in its file: read batch by batch, as often as wanted, known beforehand from one scan."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.recording.recording import GAP, Recording, joined
from casysid.recording.source import BATCH, EXCERPTS, Change, Source, Stretch, signs_of
from casysid.recording.spectrum import PositionSpectrum
from casysid.recording.summary import RecordingSummary


class Log(Protocol):
    """Where the samples lie."""

    @property
    def seekable(self) -> bool:
        """Whether samples far into the file are found without reading all before them."""
        ...

    def read(self, first: int = 0, *, time_only: bool = False) -> Iterator[Recording]:
        """All samples from row ``first`` on, in consecutive batches.

        Args:
            first: Row, counted from 0.
            time_only: Whether nothing but the time stamps is wanted; the other arrays have no columns then.

        Raises:
            RecordingError: If the file is no longer what was scanned.
        """
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class Facts:
    """What one scan of a log found.

    Attributes:
        samples: Number of rows.
        has_time: Whether they have time stamps.
        has_velocity: Whether velocities were logged.
        has_acceleration: Whether accelerations were logged.
        start: Time of the first row [s]; nan without time.
        stop: Time of the last row [s]; nan without time.
        step: Median step of time [s]; nan without time.
        rate: Samples per second, gaps left out [Hz]; nan without time.
        hole_rows: First samples after long steps of time, shape (H,); all steps that any gap can be.
        hole_edges: Times before and after each of them [s], shape (H, 2).
        mark_rows: Some rows, from the first on, shape (M,).
        mark_times: Their times [s], shape (M,).
        position_range: Lowest and highest by channel [rad, m], shape (channels, 2).
        torque_rms: By degree of freedom [N m, N], shape (dofs,).
        torque_peak: Likewise, of the absolute torque.
        spectrum: Of the positions; None without time.
    """

    samples: int
    has_time: bool
    has_velocity: bool
    has_acceleration: bool
    start: float
    stop: float
    step: float
    rate: float
    hole_rows: np.ndarray[tuple[int], np.dtype[np.intp]]
    hole_edges: Array
    mark_rows: np.ndarray[tuple[int], np.dtype[np.intp]]
    mark_times: Array
    position_range: Array
    torque_rms: Array
    torque_peak: Array
    spectrum: PositionSpectrum | None


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordingFile(Source):
    """Samples in a file, or a part of them; no more than a batch is in memory.

    What is asked of it with changed signs, in another clock or in part is done while reading. Spectrum, rate, ranges
    and torques of a part are those of the whole file.

    Attributes:
        channels: Names of the position channels.
        dofs: Names of the degrees of freedom.
        log: Where the samples lie.
        facts: What was found in them.
        first: Row of the file with the first sample.
        last: Row after that of the last sample.
        first_time: Of the first sample, in the file's clock [s]; nan without time.
        last_time: Of the last sample [s]; nan without time.
        torque_delay: By how much the torque's time stamps are late against the positions' [s].
        time_scale: By which the file's time stamps are multiplied.
        flips: Columns whose signs are turned.
        changes: What is made of the samples at last; rows are those of the file.
        sources: The file.
        unused_columns: Its columns that were left aside.
        column_map: Which columns it is read from, as text for :func:`~casysid.recording.read_map`.
        unmeasured: Degrees of freedom without a torque; zeros stand for it.
        contacts: Frames that touch the world with wrenches that nobody measured.
        wrenches: Frames whose measured wrenches are in the torques.
    """

    channels: tuple[str, ...]
    dofs: tuple[str, ...]
    log: Log = field(repr=False)
    facts: Facts = field(repr=False)
    first: int
    last: int
    first_time: float
    last_time: float
    torque_delay: float = 0.0
    time_scale: float = 1.0
    flips: tuple[str, ...] = ()
    changes: tuple[Change, ...] = ()
    _known: dict[int, float] = field(default_factory=dict, init=False, repr=False)
    sources: tuple[str, ...] = ()
    unused_columns: tuple[str, ...] = field(default=(), repr=False)
    column_map: str = field(default="", repr=False)
    unmeasured: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    wrenches: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self.last - self.first

    @property
    def has_time(self) -> bool:
        """Whether the samples have time stamps."""
        return self.facts.has_time

    @property
    def has_velocity(self) -> bool:
        """Whether velocities were logged."""
        return self.facts.has_velocity

    @property
    def has_acceleration(self) -> bool:
        """Whether accelerations were logged."""
        return self.facts.has_acceleration

    @property
    def start(self) -> float:
        """Time of the first sample [s]; nan without time."""
        return self.first_time * self.time_scale

    @property
    def stop(self) -> float:
        """Time of the last sample [s]; nan without time."""
        return self.last_time * self.time_scale

    @property
    def step(self) -> float:
        """Median step of time [s]; nan without time."""
        return self.facts.step * self.time_scale

    @property
    def rate(self) -> float:
        """Samples per second, gaps left out [Hz]; nan without time."""
        return self.facts.rate / self.time_scale

    @property
    def spectrum(self) -> PositionSpectrum:
        """Averaged periodogram of the positions of the whole file.

        Raises:
            RecordingError: Samples without time have none.
        """
        if self.facts.spectrum is None:
            raise RecordingError(f"{self.label}: no spectrum without two samples in time")
        spectrum = self.facts.spectrum.with_time_scaled(self.time_scale)
        share = len(self) / max(self.facts.samples, 1)
        return dataclasses.replace(spectrum, samples=len(self), segments=max(spectrum.segments * share, 1.0))

    def stretches(self, gap: float | None = None) -> tuple[Stretch, ...]:
        """The runs of samples between steps of time longer than ``gap`` [s]; see :meth:`Source.stretches`."""
        if not self.has_time or not len(self):
            return ()
        longest = GAP * self.step if gap is None else gap
        rows, edges = self.facts.hole_rows, self.facts.hole_edges * self.time_scale
        cut = (edges[:, 1] - edges[:, 0] > longest) & (rows > self.first) & (rows < self.last)
        firsts = [0, *(rows[cut] - self.first).tolist()]
        lasts = [*firsts[1:], len(self)]
        starts, stops = [self.start, *edges[cut, 1].tolist()], [*edges[cut, 0].tolist(), self.stop]
        return tuple(
            Stretch(slice(first, last), start, stop)
            for first, last, start, stop in zip(firsts, lasts, starts, stops, strict=True)
        )

    def batches(self, rows: int = BATCH) -> Iterator[Recording]:
        """All samples in their order, in consecutive recordings of at most ``rows`` rows."""
        row = self.first
        signs = signs_of(self, self.flips) if self.flips else None
        for batch in self.log.read(self.first):
            kept = min(len(batch), self.last - row)
            for first in range(0, kept, rows):
                part = self._as_asked(batch.selected(slice(first, min(first + rows, kept))), signs)
                for change in self.changes:
                    part = change(part, row + first)
                yield part
            row += kept
            if row >= self.last:
                return

    def _as_asked(self, batch: Recording, signs: tuple[list[float], list[float], list[float]] | None) -> Recording:
        changed = dict(
            time=batch.time,
            position=batch.position,
            velocity=batch.velocity,
            acceleration=batch.acceleration,
            torque=batch.torque,
        )
        if batch.time is not None and self.time_scale != 1.0:
            changed["time"] = batch.time * self.time_scale
        if signs is not None:
            position, motion, torque = signs
            for name, sign in (
                ("position", position),
                ("velocity", motion),
                ("acceleration", motion),
                ("torque", torque),
            ):
                values = changed[name]
                changed[name] = None if values is None else values * np.asarray(sign)
        return Recording.unchecked(
            channels=self.channels,
            dofs=self.dofs,
            torque_delay=self.torque_delay,
            sources=self.sources,
            unused_columns=self.unused_columns,
            unmeasured=self.unmeasured,
            contacts=self.contacts,
            touching=batch.touching,
            wrenches=self.wrenches,
            **changed,
        )

    def excerpts(self, count: int = EXCERPTS, rows: int = BATCH // EXCERPTS) -> tuple[Recording, ...]:
        """Short recordings in memory from ``count`` places evenly over this one; all of it if it is no longer."""
        if self.log.seekable or len(self) <= count * rows:
            return super().excerpts(count, rows)
        found: list[list[Recording]] = [[] for _ in range(count)]
        starts, first = np.linspace(0, len(self) - rows, count).astype(int), 0
        for batch in self.batches():
            for start, parts in zip(starts.tolist(), found, strict=True):
                part = batch.selected(slice(max(start - first, 0), max(start + rows - first, 0)))
                if len(part):
                    parts.append(dataclasses.replace(part))
            first += len(batch)
        return tuple(joined(parts) for parts in found)

    def in_memory(self) -> Recording:
        """All samples at once."""
        return joined(list(self.batches()))

    def between(self, first: int, last: int) -> RecordingFile:
        """The samples from row ``first`` up to before row ``last``."""
        ends = [self._time(row + self.first) if self.has_time else float("nan") for row in (first, last - 1)]
        return dataclasses.replace(
            self, first=self.first + first, last=self.first + last, first_time=ends[0], last_time=ends[1]
        )

    def _time(self, row: int) -> float:
        """Of a row of the file, in the file's clock [s]."""
        known = self._known | {self.first: self.first_time, self.last - 1: self.last_time}
        return known[row] if row in known else float(next(self._times_from(row))[0])

    def _times_from(self, row: int) -> Iterator[Array]:
        """Time stamps from a row of the file on, batch by batch, in the file's clock [s]."""
        for batch in self.log.read(row, time_only=True):
            assert batch.time is not None
            if len(batch.time):
                yield batch.time

    def row_of(self, time: float) -> int:
        """The first row at ``time`` [s] or later; the number of rows when there is none."""
        if not self.has_time:
            raise RecordingError(f"{self.label}: samples without time have no row at {time} s")
        if time <= self.start:
            return 0
        if time > self.stop:
            return len(self)
        mark = max(int(np.searchsorted(self.facts.mark_times * self.time_scale, time)) - 1, 0)
        row = max(int(self.facts.mark_rows[mark]), self.first)
        for stamps in self._times_from(row):
            found = int(np.searchsorted(stamps * self.time_scale, time))
            near = slice(max(found - 1, 0), found + 1)
            self._known.update(zip(range(row, row + len(stamps))[near], stamps[near].tolist(), strict=True))
            if found < len(stamps):
                return row + found - self.first
            row += len(stamps)
        return len(self)

    def with_time_scaled(self, scale: float) -> RecordingFile:
        """With the time stamps multiplied; velocities and accelerations stay as logged."""
        if not self.has_time:
            return self
        return dataclasses.replace(
            self,
            time_scale=self.time_scale * scale,
            torque_delay=self.torque_delay * scale,
        )

    def mapped(self, change: Change) -> RecordingFile:
        """With other values of as many samples, whatever else is asked for done before; see :meth:`Source.mapped`."""
        return dataclasses.replace(self, changes=(*self.changes, change))

    def with_torque_delay(self, delay: float) -> RecordingFile:
        """Told that its torques are so late [s] in all."""
        return dataclasses.replace(self, torque_delay=delay)

    def flipped(self, columns: Sequence[str]) -> RecordingFile:
        """With the signs of some columns turned; see :meth:`Source.flipped`."""
        signs_of(self, columns)
        return dataclasses.replace(self, flips=(*self.flips, *columns))

    def summary(self) -> RecordingSummary:
        """What there is, in figures; ranges and torques of the whole file."""
        position, _, _ = signs_of(self, self.flips)
        ends = np.sort(self.facts.position_range * np.asarray(position)[:, None], axis=1)
        return RecordingSummary(
            sources=self.sources,
            samples=len(self),
            duration=self.duration,
            rate=self.rate,
            segments=len(self.stretches()),
            logged=self.logged,
            position_range={
                name: (float(low), float(high)) for name, (low, high) in zip(self.channels, ends, strict=True)
            },
            torque_rms=dict(zip(self.dofs, self.facts.torque_rms.tolist(), strict=True)),
            torque_peak=dict(zip(self.dofs, self.facts.torque_peak.tolist(), strict=True)),
            unused_columns=self.unused_columns,
        )

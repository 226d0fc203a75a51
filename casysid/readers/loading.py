"""From a file to a checked recording, in memory or left where it is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.angles import unwrap
from casysid.readers.batches import all_rows
from casysid.readers.checks import SampleChecks, check_quaternions, check_steps
from casysid.readers.columns import Layout, match_columns
from casysid.readers.generalised import with_generalised_forces
from casysid.readers.statistics import Statistics
from casysid.readers.table import Table, open_table
from casysid.readers.units import check_units
from casysid.readers.weaknesses import find_weaknesses
from casysid.recording.file import RecordingFile
from casysid.recording.recording import Recording
from casysid.robot import Robot
from casysid.threads import single_threaded


@single_threaded()
def load_recording(path: Path, robot: Robot) -> tuple[Recording, tuple[str, ...]]:
    """The recording in a file, and sentences about what is weak in it.

    Raises:
        RecordingError: If it cannot be used.
    """
    try:
        return _load(path, robot)
    except MemoryError as error:
        raise RecordingError(f"{path}: the recording does not fit into memory ({error}); cut it into pieces") from error


def _load(path: Path, robot: Robot) -> tuple[Recording, tuple[str, ...]]:
    table = with_generalised_forces(open_table(path), robot, str(path))
    layout = match_columns(table.names, robot.channels, robot.dofs, str(path))
    parts: list[dict[str, Array]] = []

    def kept() -> Iterator[dict[str, Array]]:
        for columns in table.batches(layout.used):
            parts.append(columns)
            yield columns

    statistics = _scan(table, layout, robot, str(path), kept())
    columns = all_rows(layout.used, parts)
    logged = _recording(columns, layout, robot, _about(path, table, layout))
    wrapped = _wrapped(statistics)
    recording = next(unwrap([logged], wrapped)) if wrapped else logged
    return recording, find_weaknesses(statistics, robot)


@single_threaded()
def scan_recording(path: Path, robot: Robot) -> tuple[RecordingFile, tuple[str, ...]]:
    """The recording in a file, where it stays, and sentences about what is weak in it; reads the file once.

    Raises:
        RecordingError: If it cannot be used.
    """
    table = with_generalised_forces(open_table(path), robot, str(path))
    layout = match_columns(table.names, robot.channels, robot.dofs, str(path))
    version = _version(path)
    statistics = _scan(table, layout, robot, str(path), table.batches(layout.used))
    facts = statistics.facts()
    wrapped = _wrapped(statistics)
    about = _about(path, table, layout)
    recording = RecordingFile(
        channels=robot.channels,
        dofs=robot.dofs,
        log=LogFile(path, version, table, layout, robot.channels, robot.dofs, wrapped),
        facts=facts,
        first=0,
        last=facts.samples,
        first_time=facts.start,
        last_time=facts.stop,
        sources=about["sources"],
        unused_columns=about["unused_columns"],
    )
    return recording, find_weaknesses(statistics, robot)


@dataclass(frozen=True)
class LogFile:
    """A file of which the columns and the wrapped angles are known; see :class:`~casysid.recording.file.Log`.

    Attributes:
        path: The file.
        version: Its size and time of change when it was scanned.
        table: Reads it.
        layout: The columns that are used.
        channels: Names of the position channels.
        dofs: Names of the degrees of freedom.
        wrapped: Channels whose whole turns are taken out.
    """

    path: Path
    version: tuple[int, int]
    table: Table
    layout: Layout
    channels: tuple[str, ...]
    dofs: tuple[str, ...]
    wrapped: tuple[int, ...]

    @property
    def seekable(self) -> bool:
        """Whether samples far into the file are found without reading all before them."""
        return self.table.seekable and not self.wrapped

    def read(self, first: int = 0, *, time_only: bool = False) -> Iterator[Recording]:
        """All samples from row ``first`` on, in consecutive batches.

        Raises:
            RecordingError: If the file is no longer what was scanned.
        """
        if _version(self.path) != self.version:
            raise RecordingError(f"{self.path}: changed while it was in use; run again once it is complete")
        if time_only and self.layout.time is not None:
            for columns in self.table.batches((self.layout.time,), first):
                time = columns[self.layout.time]
                none = np.empty((len(time), 0))
                yield Recording.unchecked(channels=(), dofs=(), time=time, position=none, torque=none)
            return
        if not self.wrapped:
            yield from self._logged(first)
            return
        row = 0  # the turns are counted from the start
        for batch in unwrap(self._logged(0), self.wrapped):
            if row + len(batch) > first:
                yield batch.selected(slice(max(first - row, 0), None))
            row += len(batch)

    def _logged(self, first: int) -> Iterator[Recording]:
        for columns in self.table.batches(self.layout.used, first):
            yield _recording(columns, self.layout, self, {})


def _version(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_size, status.st_mtime_ns


def _scan(
    table: Table, layout: Layout, robot: Robot, source: str, batches: Iterator[Mapping[str, Array]]
) -> Statistics:
    """Statistics of all batches, once the checks are passed.

    Raises:
        RecordingError: If they are not.
    """
    checks, statistics = SampleChecks(table, layout, source), Statistics(robot, source)
    for columns in batches:
        checks.add(columns)
        if not checks.faulty:
            statistics.add(_recording(columns, layout, robot, {}))
    checks.finish()
    check_quaternions(statistics, robot)
    check_units(statistics, robot)
    check_steps(table, layout, statistics)
    return statistics


def _wrapped(statistics: Statistics) -> tuple[int, ...]:
    return tuple(np.flatnonzero(statistics.unwrapped).tolist())


def _about(path: Path, table: Table, layout: Layout) -> dict[str, tuple[str, ...]]:
    return {
        "sources": (str(path),),
        "unused_columns": tuple(name for name in table.names if name not in layout.used),
    }


def _recording(
    columns: Mapping[str, Array], layout: Layout, names: Robot | LogFile, about: Mapping[str, tuple[str, ...]]
) -> Recording:
    return Recording.unchecked(
        channels=names.channels,
        dofs=names.dofs,
        time=None if layout.time is None else columns[layout.time],
        position=_stacked(layout.position, columns),
        velocity=None if layout.velocity is None else _stacked(layout.velocity, columns),
        acceleration=None if layout.acceleration is None else _stacked(layout.acceleration, columns),
        torque=_stacked(layout.torque, columns),
        **about,
    )


def _stacked(names: Sequence[str], columns: Mapping[str, Array]) -> Array:
    return np.column_stack([columns[name] for name in names])

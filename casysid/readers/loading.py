"""From a file to a checked recording, in memory or left where it is."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.angles import unwrap
from casysid.readers.base_motion import BaseMotion
from casysid.readers.checks import SampleChecks, check_quaternions, check_steps
from casysid.readers.columns import Layout
from casysid.readers.faults import decided_unit, emptied, glitches_of, too_fast
from casysid.readers.generalised import GeneralisedTable, with_generalised_forces
from casysid.readers.mapping import lay_out, text_of_map
from casysid.readers.repairs import Columns, together
from casysid.readers.samples import Samples
from casysid.readers.statistics import Statistics
from casysid.readers.survey import Survey
from casysid.readers.table import Table, open_table
from casysid.readers.units import check_units
from casysid.readers.weaknesses import find_weaknesses
from casysid.recording.declared import NOTHING, Declared
from casysid.recording.file import RecordingFile
from casysid.recording.recording import Recording
from casysid.robot import JointKind, Robot
from casysid.threads import single_threaded

MOST_ROUNDS = 8
"""Scans of a log: one for each kind of repair, and one more that finds nothing."""


@single_threaded()
def load_recording(path: Path, robot: Robot, declared: Declared = NOTHING) -> tuple[Recording, tuple[str, ...]]:
    """The recording in a file, and sentences about what is weak in it.

    Raises:
        RecordingError: If it cannot be used.
    """
    try:
        return _load(path, robot, declared)
    except MemoryError as error:
        raise RecordingError(f"{path}: the recording does not fit into memory ({error}); cut it into pieces") from error


def _load(path: Path, robot: Robot, declared: Declared) -> tuple[Recording, tuple[str, ...]]:
    parts: list[Columns] = []
    found = _scan(path, robot, declared, parts)
    logged = _recording(
        together(parts), found.samples.layout, robot, {"sources": (str(path),), "unused_columns": found.unused}
    )
    recording = next(unwrap([logged], found.wrapped)) if found.wrapped else logged
    return recording, found.sentences(robot)


@single_threaded()
def scan_recording(path: Path, robot: Robot, declared: Declared = NOTHING) -> tuple[RecordingFile, tuple[str, ...]]:
    """The recording in a file, where it stays, and sentences about what is weak in it; reads the file once.

    Raises:
        RecordingError: If it cannot be used.
    """
    version = _version(path) if path.exists() else (0, 0)
    found = _scan(path, robot, declared, None)
    facts = found.statistics.facts()
    recording = RecordingFile(
        channels=robot.channels,
        dofs=robot.dofs,
        log=LogFile(path, version, found.samples, robot.channels, robot.dofs, found.wrapped),
        facts=facts,
        first=0,
        last=facts.samples,
        first_time=facts.start,
        last_time=facts.stop,
        sources=(str(path),),
        unused_columns=found.unused,
        column_map=text_of_map(found.samples.layout, robot.channels, robot.dofs, declared, _lengths(robot)),
        unmeasured=_unmeasured(found.samples.layout, robot.dofs),
        contacts=tuple(frame for frame, _ in found.samples.layout.contacts),
        wrenches=found.samples.layout.wrenches,
    )
    return recording, found.sentences(robot)


@dataclass(frozen=True)
class LogFile:
    """A file of which the columns and the wrapped angles are known; see :class:`~casysid.recording.file.Log`.

    Attributes:
        path: The file.
        version: Its size and time of change when it was scanned.
        samples: Reads it.
        channels: Names of the position channels.
        dofs: Names of the degrees of freedom.
        wrapped: Channels whose whole turns are taken out.
    """

    path: Path
    version: tuple[int, int]
    samples: Samples
    channels: tuple[str, ...]
    dofs: tuple[str, ...]
    wrapped: tuple[int, ...]

    @property
    def seekable(self) -> bool:
        """Whether samples far into the file are found without reading all before them."""
        return self.samples.seekable and not self.wrapped

    def read(self, first: int = 0, *, time_only: bool = False) -> Iterator[Recording]:
        """All samples from row ``first`` on, in consecutive batches.

        Raises:
            RecordingError: If the file is no longer what was scanned.
        """
        if _version(self.path) != self.version:
            raise RecordingError(f"{self.path}: changed while it was in use; run again once it is complete")
        if time_only and self.samples.layout.time is not None:
            for time in self.samples.stamps(first):
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
        for columns in self.samples.batches(first):
            yield _recording(columns, self.samples.layout, self, {})


def _version(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_size, status.st_mtime_ns


@dataclass(frozen=True)
class _Scanned:
    """A log that passed all checks."""

    samples: Samples
    statistics: Statistics
    remarks: tuple[str, ...]

    @property
    def wrapped(self) -> tuple[int, ...]:
        return tuple(np.flatnonzero(self.statistics.unwrapped).tolist())

    @property
    def unused(self) -> tuple[str, ...]:
        used = set(self.samples.layout.used)
        return tuple(name for name in self.samples.table.names if name not in used)

    def sentences(self, robot: Robot) -> tuple[str, ...]:
        return (*self.remarks, *find_weaknesses(self.statistics, robot))


def _scan(path: Path, robot: Robot, declared: Declared, parts: list[Columns] | None) -> _Scanned:
    """A log scanned until there is nothing left to repair, and checked.

    Args:
        path: The file.
        robot: The robot.
        declared: What the user says of it.
        parts: The rows of the last scan are put here.

    Raises:
        RecordingError: If it cannot be used.
    """
    source = str(path)
    table = with_generalised_forces(open_table(path), robot, source)
    if table.nameless and not declared.columns:
        raise RecordingError(table.nameless)
    layout = lay_out(
        table.names, robot.channels, robot.dofs, source, table.labels, declared, _lengths(robot), robot.numbered
    )
    if isinstance(table, GeneralisedTable):
        table, layout = table.completed(layout)
    samples = Samples(table, layout).with_clock_started()
    samples.check_curves(source)
    remarks = list(layout.remarks)
    for _ in range(MOST_ROUNDS):
        checks = SampleChecks(table.place, samples.layout, source)
        base = BaseMotion(robot, source)
        statistics, survey = Statistics(robot, source), Survey(samples.layout, glitches_of(robot, samples.layout))
        if parts is not None:
            parts.clear()
        for columns in samples.batches():
            survey.add(columns)
            checks.add(columns)
            if not checks.faulty:
                rows = _recording(columns, samples.layout, robot, {})
                statistics.add(rows)
                base.add(rows)
            if parts is not None:
                parts.append(columns)
        found = _better(samples, survey, statistics, robot) or _own_twist(samples, base)
        if found is None:
            break
        samples, remark = found
        remarks.append(remark)
    checks.finish()
    check_quaternions(statistics, robot)
    remarks += [said for said in (_signs(table), base.check_order()) if said]
    check_units(statistics, robot)
    if samples.layout.clock is not None and samples.layout.clock.units != layout.clock.units:  # type: ignore[union-attr]
        too_fast(statistics, robot, samples.layout.clock.units[0])
    check_steps(samples.place, samples.layout, statistics)
    return _Scanned(samples, statistics, tuple(remarks))


def _better(samples: Samples, survey: Survey, statistics: Statistics, robot: Robot) -> tuple[Samples, str] | None:
    """The log with one more repair, and what to say of it; None when there is none to make."""
    return emptied(samples, survey, robot) or _repaired(samples, survey) or decided_unit(samples, survey, statistics)


def _own_twist(samples: Samples, base: BaseMotion) -> tuple[Samples, str] | None:
    """The log without a twist of the base that is along other axes than its own."""
    parts = base.twist_in_world() if samples.layout.velocity is not None else ()
    if not parts:
        return None
    return samples.laid_out(velocity=None, acceleration=None), (
        f"the base's {' and '.join(parts)} velocity is along the world's axes, not the body's; velocity and "
        "acceleration are left aside, as positions tell them"
    )


def _signs(table: Table) -> str:
    """What was done to the base's quaternions."""
    turned = table.turned[0] if isinstance(table, GeneralisedTable) else 0
    return f"the base's quaternion changes its sign between samples; {turned} were turned back" if turned else ""


def _repaired(samples: Samples, survey: Survey) -> tuple[Samples, str] | None:
    found = survey.repaired(samples.repairs, samples.table.place)
    return None if found is None else (dataclasses.replace(samples, repairs=found[0]), found[1])


def _lengths(robot: Robot) -> set[str]:
    """Channels and degrees of freedom that are lengths."""
    prismatic = [joint for joint in robot.joints if joint.kind is JointKind.PRISMATIC]
    names = [robot.channels[joint.channels.start] for joint in prismatic]
    return {*names, *(robot.dofs[joint.v.start] for joint in prismatic)}


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
        unmeasured=_unmeasured(layout, names.dofs),
        contacts=tuple(frame for frame, _ in layout.contacts),
        touching=_touching(layout, columns),
        wrenches=layout.wrenches,
        **about,
    )


def _unmeasured(layout: Layout, dofs: Sequence[str]) -> tuple[str, ...]:
    return tuple(dof for dof, column in zip(dofs, layout.torque, strict=True) if column in layout.unmeasured)


def _touching(layout: Layout, columns: Mapping[str, Array]) -> npt.NDArray[np.bool_] | None:
    return _stacked([column for _, column in layout.contacts], columns) > 0.5 if layout.contacts else None


def _stacked(names: Sequence[str], columns: Mapping[str, Array]) -> Array:
    return np.column_stack([columns[name] for name in names])

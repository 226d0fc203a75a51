"""Many logs: found in folders, opened where the work is done."""

from __future__ import annotations

import glob
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from casysid.errors import CasysidWarning, RecordingError
from casysid.identification.many.compact import compact
from casysid.identification.many.workers import Workers
from casysid.recording import Declared, RecordingFile
from casysid.recording.declared import NOTHING
from casysid.robot import Robot

BY_RECORDING = "recording"
Logs = str | Path | Sequence[str | Path]


@dataclass(frozen=True, eq=False)
class Opened:
    """One log as a worker has opened it.

    Attributes:
        fitted: Where its samples lie and what one scan found; no samples.
        held_out: The last part of it, where it is split.
        machine: Which machine it is of, in words; the file's name where nobody asked.
        weaknesses: Sentences about what is doubtful.
    """

    fitted: RecordingFile
    held_out: RecordingFile | None
    machine: str
    weaknesses: tuple[str, ...]


def find_logs(logs: Logs) -> tuple[Path, ...]:
    """The files meant, each once: files as they are, folders and patterns by all logs in them in the order of names.

    Args:
        logs: A file, a folder (such as a Parquet data set; hidden files and those whose name begins with ``_`` are not
            logs), a pattern such as ``logs/*.csv``, or several of them.

    Raises:
        RecordingError: There is no log, or one is given twice.
    """
    from casysid.readers.table import SUFFIXES, holds_logs, suffix_of

    found = list[Path]()
    for one in (logs,) if isinstance(logs, (str, Path)) else logs:
        path = Path(one)
        if holds_logs(path):
            inside = [
                file
                for file in path.rglob("*")
                if file.is_file() and file.name[0] not in "._" and suffix_of(file) in SUFFIXES
            ]
            if not inside:
                raise RecordingError(f"{path}: no log in this folder; wanted files of {', '.join(SUFFIXES)}")
            found += sorted(inside)
        elif not path.exists() and glob.has_magic(str(one)):
            matching = sorted(map(Path, glob.glob(str(one), recursive=True)))
            if not matching:
                raise RecordingError(f"{one}: no file has such a name; looked from {Path.cwd()}")
            found += matching
        else:
            found.append(path)
    places = [path.resolve() for path in found]
    if len(set(places)) < len(places):
        twice = next(path for path, place in zip(found, places, strict=True) if places.count(place) > 1)
        raise RecordingError(f"{twice}: given more than once; its samples would count as often. Give each file once")
    return tuple(places)


def open_logs(
    robot: Robot,
    files: Sequence[Path],
    workers: Workers,
    *,
    by: str | None = None,
    split: float | None = None,
    declared: Declared = NOTHING,
) -> tuple[Opened, ...]:
    """Open every log on a worker, and bring back what is known of it.

    Args:
        robot: Whose they are.
        files: As the workers see them.
        workers: Open them.
        by: Column whose constant value names the machine, a ``NAME=value`` folder of a data set, or ``recording``.
        split: Share of each recording's time that is fitted, the rest held out; None fits all.
        declared: What is known of the logs: units, columns, drives.

    Warns:
        CasysidWarning: For everything doubtful that leaves a recording usable.

    Raises:
        RecordingError: If one cannot be used.
    """
    opened = tuple(workers(partial(_opened, robot, by, split, declared), files))
    for path, one in zip(files, opened, strict=True):
        for weakness in one.weaknesses:
            warnings.warn(f"{path}: {weakness}", CasysidWarning, stacklevel=2)
    return opened


def _opened(robot: Robot, by: str | None, split: float | None, declared: Declared, path: Path) -> Opened:
    from casysid.readers.loading import scan_recording

    recording, weaknesses = scan_recording(path, robot, declared)
    fitted, held_out = (recording, None) if split is None else recording.split(split)
    return Opened(compact(fitted), None if held_out is None else compact(held_out), _machine_of(path, by), weaknesses)


def _machine_of(path: Path, by: str | None) -> str:
    from casysid.readers.constants import constant_of

    if by in (None, BY_RECORDING):
        return path.name
    for folder in reversed(path.parent.parts):
        if folder.startswith(f"{by}="):
            return folder.partition("=")[2]
    return constant_of(path, str(by))

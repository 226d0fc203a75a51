"""Recordings from files."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

from casysid.errors import CasysidWarning, RecordingError
from casysid.recording.declared import NOTHING, Declared
from casysid.recording.file import RecordingFile
from casysid.recording.recording import Recording
from casysid.robot import Robot


def read_recording(path: str | Path, robot: Robot, declared: Declared = NOTHING) -> Recording:
    """The recording in a CSV (plain or gzipped), Parquet or NPZ file.

    Columns are ``time`` [s], then by joint name ``q_<joint>, v_<joint>, a_<joint>, tau_<joint>``, or numbered
    ``q1, dq1, ddq1, tau1`` in the model file's order; :mod:`casysid.readers.columns` has the other spellings. SI units.
    Only q and tau are needed beside time; without time the rows are unordered samples, and need all four. Other columns
    are left aside.

    Warns:
        CasysidWarning: For everything doubtful that leaves the recording usable.

    Raises:
        RecordingError: If it cannot be used: file, column and line, and what to do.
    """
    from casysid.readers.loading import load_recording

    recording, weaknesses = load_recording(Path(path), robot, declared)
    for weakness in weaknesses:
        warnings.warn(f"{path}: {weakness}", CasysidWarning, stacklevel=2)
    return recording


def open_recording(path: str | Path, robot: Robot, declared: Declared = NOTHING) -> RecordingFile:
    """The recording in a file as :func:`read_recording` reads it, but left there: for logs of any length.

    The file is read once for checks and figures, and again whenever samples are asked for.

    Warns:
        CasysidWarning: For everything doubtful that leaves the recording usable.

    Raises:
        RecordingError: If it cannot be used: file, column and line, and what to do.
    """
    return open_recordings([path], robot, declared, _level=3)[0]


def open_recordings(
    paths: Sequence[str | Path], robot: Robot, declared: Declared = NOTHING, *, _level: int = 2
) -> tuple[RecordingFile, ...]:
    """The recordings in several files, in their order, left there; see :func:`open_recording`.

    Raises:
        RecordingError: If one cannot be used, or a file is given twice.
    """
    from casysid.readers.loading import scan_recording

    _require_once(paths)
    opened = [scan_recording(Path(path), robot, declared) for path in paths]
    for path, (_, weaknesses) in zip(paths, opened, strict=True):
        for weakness in weaknesses:
            warnings.warn(f"{path}: {weakness}", CasysidWarning, stacklevel=_level)
    return tuple(recording for recording, _ in opened)


def read_recordings(paths: Sequence[str | Path], robot: Robot, declared: Declared = NOTHING) -> tuple[Recording, ...]:
    """The recordings in several files, in their order; see :func:`read_recording`.

    Raises:
        RecordingError: If one cannot be used, or a file is given twice.
    """
    from casysid.readers.loading import load_recording

    _require_once(paths)
    loaded = [load_recording(Path(path), robot, declared) for path in paths]
    for path, (_, weaknesses) in zip(paths, loaded, strict=True):
        for weakness in weaknesses:
            warnings.warn(f"{path}: {weakness}", CasysidWarning, stacklevel=2)
    return tuple(recording for recording, _ in loaded)


def draft_map(path: str | Path) -> str:
    """What the columns of a log seem to be, without a robot, as the text of a map's file to edit.

    Raises:
        RecordingError: If the file cannot be read.
    """
    from casysid.readers.drafting import draft

    return draft(Path(path))


def is_log(path: str | Path) -> bool:
    """Whether a file is a log by its suffix."""
    from casysid.readers.table import READ, suffix_of

    return suffix_of(Path(path)) in READ


def _require_once(paths: Sequence[str | Path]) -> None:
    if isinstance(paths, (str, Path)):
        raise RecordingError(f"read_recordings: wanted a list of files; got one path, {paths}: put it in a list")
    files = [Path(path).resolve() for path in paths]
    twice = [str(path) for path, file in zip(paths, files, strict=True) if files.count(file) > 1]
    if twice:
        raise RecordingError(
            f"{twice[0]}: given {len(twice)} times; its samples would count as often. Give each file once"
        )

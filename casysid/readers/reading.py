"""From a file to a checked recording."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from casysid.arrays import Array
from casysid.errors import CasysidWarning, RecordingError
from casysid.readers.angles import check_quaternions, unwrap_angles
from casysid.readers.checks import check_samples
from casysid.readers.columns import match_columns
from casysid.readers.table import open_table
from casysid.readers.units import check_units
from casysid.readers.weaknesses import find_weaknesses
from casysid.recording import Recording
from casysid.robot import Robot


def read_recording(path: str | Path, robot: Robot) -> Recording:
    """The recording in a CSV (plain or gzipped), Parquet or NPZ file.

    Columns are ``time`` [s], then by joint name ``q_<joint>, v_<joint>, a_<joint>, tau_<joint>``, or numbered
    ``q1, dq1, ddq1, tau1`` in the model's order; :mod:`casysid.readers.columns` has the other spellings. SI units.
    Only q and tau are needed beside time; without time the rows are unordered samples, and need all four. Other columns
    are left aside.

    Warns:
        CasysidWarning: For everything doubtful that leaves the recording usable.

    Raises:
        RecordingError: If it cannot be used: file, column and line, and what to do.
    """
    recording, weaknesses = _read(Path(path), robot)
    for weakness in weaknesses:
        warnings.warn(f"{path}: {weakness}", CasysidWarning, stacklevel=2)
    return recording


def read_recordings(paths: Sequence[str | Path], robot: Robot) -> tuple[Recording, ...]:
    """The recordings in several files, in their order; see :func:`read_recording`.

    Raises:
        RecordingError: If one cannot be used, a file is given twice, or none is given.
    """
    if isinstance(paths, (str, os.PathLike)):
        raise RecordingError(f"read_recordings: wanted a list of files; got one path, {paths}: put it in a list")
    if not paths:
        raise RecordingError("read_recordings: no files given; name at least one log")
    files = [Path(path).resolve() for path in paths]
    twice = [str(path) for path, file in zip(paths, files, strict=True) if files.count(file) > 1]
    if twice:
        raise RecordingError(
            f"{twice[0]}: given {len(twice)} times; its samples would count as often. Give each file once"
        )
    recordings = []
    for path in paths:
        recording, weaknesses = _read(Path(path), robot)
        recordings.append(recording)
        for weakness in weaknesses:
            warnings.warn(f"{path}: {weakness}", CasysidWarning, stacklevel=2)
    return tuple(recordings)


def _read(path: Path, robot: Robot) -> tuple[Recording, tuple[str, ...]]:
    """The recording and what is weak about it."""
    table = open_table(path)
    layout = match_columns(table.names, robot.channels, robot.dofs, str(path))
    columns = table.read(layout.used)
    check_samples(table, layout, columns, str(path))
    logged = Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=None if layout.time is None else columns[layout.time],
        position=_stacked(layout.position, columns),
        velocity=None if layout.velocity is None else _stacked(layout.velocity, columns),
        acceleration=None if layout.acceleration is None else _stacked(layout.acceleration, columns),
        torque=_stacked(layout.torque, columns),
        sources=(str(path),),
        unused_columns=tuple(name for name in table.names if name not in layout.used),
    )
    check_quaternions(logged, robot)
    check_units(logged, robot)
    recording, unwrapped = unwrap_angles(logged, robot)
    return recording, (*unwrapped, *find_weaknesses(recording, robot))


def _stacked(names: Sequence[str], columns: Mapping[str, Array]) -> Array:
    return np.column_stack([columns[name] for name in names])

"""From a file to a checked recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.angles import check_quaternions, unwrap_angles
from casysid.readers.checks import check_samples, check_steps
from casysid.readers.columns import match_columns
from casysid.readers.table import open_table
from casysid.readers.units import check_units
from casysid.readers.weaknesses import find_weaknesses
from casysid.recording import Recording
from casysid.robot import Robot


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
    if recording.time is not None:
        for name, position in zip(layout.position, recording.position.T, strict=True):
            check_steps(table, name, recording.time, position, str(path))
    return recording, (*unwrapped, *find_weaknesses(recording, robot))


def _stacked(names: Sequence[str], columns: Mapping[str, Array]) -> Array:
    return np.column_stack([columns[name] for name in names])

"""Samples that cannot be used: each fault with the file, the column and the place of the first bad row."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.columns import Layout, listing
from casysid.readers.table import Table

FEWEST = 20
"""Fewer rows than this are no recording."""
LARGEST = 1e9
"""Of any value but time, in SI units: a wind turbine's shaft carries 1e7 N m, a spindle at FASTEST turns 1e9 rad in
three hours."""
FASTEST = 1e5
"""Of a joint from one sample to the next [rad/s, m/s]: the fastest spindles turn at a million revolutions a minute."""
LONGEST = 1e9
"""From the first sample to the last [s]: thirty years."""


def check_samples(table: Table, layout: Layout, columns: Mapping[str, Array], source: str) -> None:
    """Refuse samples that are too few, not finite, not in time order, or all the same.

    Raises:
        RecordingError: On the first of these faults.
    """
    _check_count(len(columns[layout.torque[0]]), source)
    _check_finite(table, columns, source)
    for name, values in columns.items():
        if name != layout.time:
            check_magnitude(table, name, values, source)
    if layout.time is not None:
        _check_order(table, layout.time, columns[layout.time], source)
    for word, names, means in (
        ("position", layout.position, "a robot at rest tells nothing about its inertia or friction; record it moving"),
        ("torque", layout.torque, "is this the measured torque, and were the drives on?"),
    ):
        if all(np.ptp(columns[name]) == 0.0 for name in names):
            raise RecordingError(f"{source}: no {word} ever changes ({listing(names)}); {means}")


def _check_count(samples: int, source: str) -> None:
    if samples == 0:
        raise RecordingError(f"{source}: a header but no rows; the log has no samples")
    if samples < FEWEST:
        raise RecordingError(f"{source}: {samples} rows are too few to identify anything; record at least {FEWEST}")


def _check_finite(table: Table, columns: Mapping[str, Array], source: str) -> None:
    bad = {name: np.flatnonzero(~np.isfinite(values)) for name, values in columns.items()}
    bad = {name: rows for name, rows in bad.items() if len(rows)}
    if bad:
        name, rows = next(iter(bad.items()))
        kind = "empty or NaN" if np.isnan(columns[name][rows[0]]) else "infinite"
        counts = listing([f"'{name}' in {len(rows)} rows" for name, rows in bad.items()], 6)
        raise RecordingError(
            f"{source}: values that are not finite numbers: {counts}; "
            f"'{name}' is {kind} in {table.place(int(rows[0]))} first. Cut those rows at the source; "
            "none is dropped or filled in silently"
        )


def check_magnitude(table: Table, name: str, values: Array, source: str, *, first: int = 0) -> None:
    """Refuse a value that no machine has: a glitch, an overflow, or another unit.

    Args:
        table: Says where a row stands.
        name: The column.
        values: Its numbers, or a stretch of them, shape (n,).
        source: The file.
        first: Row of the first of them.

    Raises:
        RecordingError: Naming the first of them.
    """
    far = np.flatnonzero(np.abs(values) > LARGEST)
    if len(far):
        raise RecordingError(
            f"{source}: '{name}' is {values[far[0]]:.6g} in {table.place(first + int(far[0]))}, beyond {LARGEST:g}, "
            f"which no machine reaches in SI units ({len(far)} rows); cut out the glitch, or convert the column"
        )


def check_steps(table: Table, name: str, time: Array, position: Array, source: str, *, first: int = 0) -> None:
    """Refuse a position that leaps faster than any joint can move, and time that spans more than a life's work.

    Args:
        table: Says where a row stands.
        name: The column of positions, angles unwrapped.
        time: Shape (n,), [s].
        position: Shape (n,), [rad, m].
        source: The file.
        first: Row of the first sample.

    Raises:
        RecordingError: Naming the first leap.
    """
    steps = np.diff(time)
    if time[-1] - time[0] > LONGEST:
        row = int(np.argmax(steps)) + 1
        raise RecordingError(
            f"{source}: time spans {time[-1] - time[0]:.3g} s, its largest step before {table.place(first + row)} "
            f"({time[row - 1]:.9g} then {time[row]:.9g}); wanted seconds of one recording, at most {LONGEST:g}"
        )
    leaps = np.flatnonzero(np.abs(np.diff(position)) > FASTEST * steps)
    if len(leaps):
        row = int(leaps[0]) + 1
        raise RecordingError(
            f"{source}: '{name}' leaps from {position[row - 1]:.6g} to {position[row]:.6g} in {steps[row - 1]:.3g} s "
            f"before {table.place(first + row)}, faster than {FASTEST:g} a second, which no joint is ({len(leaps)} "
            "steps); cut out the glitch, or check the units of q and time"
        )


def _check_order(table: Table, name: str, time: Array, source: str) -> None:
    steps = np.diff(time)
    back, same = np.flatnonzero(steps < 0.0), np.flatnonzero(steps == 0.0)
    if len(back):
        row = int(back[0]) + 1
        raise RecordingError(
            f"{source}: '{name}' runs backwards {len(back)} times, first in {table.place(row)} "
            f"({time[row - 1]:.9g} then {time[row]:.9g}); sort the rows, or give joined logs as separate files"
        )
    if len(same):
        row = int(same[0]) + 1
        raise RecordingError(
            f"{source}: '{name}' repeats the stamp before it in {len(same)} rows, first in {table.place(row)} "
            f"({time[row]:.9g}); remove the repeated rows, or write time with more digits"
        )

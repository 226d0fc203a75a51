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


def check_samples(table: Table, layout: Layout, columns: Mapping[str, Array], source: str) -> None:
    """Refuse samples that are too few, not finite, not in time order, or all the same.

    Raises:
        RecordingError: On the first of these faults.
    """
    _check_count(len(columns[layout.torque[0]]), source)
    _check_finite(table, columns, source)
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

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


class SampleChecks:
    """Refuses samples that are too few, not finite, not in time order, or all the same, once all batches were seen."""

    def __init__(self, table: Table, layout: Layout, source: str) -> None:
        self._table, self._layout, self._source = table, layout, source
        self._samples = 0
        self._bad: dict[str, tuple[int, int, float]] = {}
        self._back = self._same = 0
        self._first_back: tuple[int, float, float] | None = None
        self._first_same: tuple[int, float] | None = None
        self._last_time = np.empty(0)
        self._low: dict[str, float] = {}
        self._high: dict[str, float] = {}

    @property
    def faulty(self) -> bool:
        """Whether figures of the samples would be meaningless."""
        return bool(self._bad or self._back or self._same)

    def add(self, columns: Mapping[str, Array]) -> None:
        """Rows that follow those added before."""
        rows = len(columns[self._layout.torque[0]])
        if not rows:
            return
        for name, values in columns.items():
            self._add_finite(name, values)
        if self._layout.time is not None:
            self._add_order(columns[self._layout.time])
        for name in (*self._layout.position, *self._layout.torque):
            self._low[name] = min(self._low.get(name, np.inf), float(columns[name].min()))
            self._high[name] = max(self._high.get(name, -np.inf), float(columns[name].max()))
        self._samples += rows

    def _add_finite(self, name: str, values: Array) -> None:
        finite = np.isfinite(values)
        if not finite.all():
            first = int(np.argmin(finite))
            count, row, value = self._bad.get(name, (0, self._samples + first, float(values[first])))
            self._bad[name] = (count + int(np.count_nonzero(~finite)), row, value)

    def _add_order(self, time: Array) -> None:
        joined = np.concatenate([self._last_time, time])
        steps, offset = np.diff(joined), self._samples - len(self._last_time)
        back, same = steps < 0.0, steps == 0.0
        if back.any() and self._first_back is None:
            k = int(np.argmax(back))
            self._first_back = (offset + k + 1, float(joined[k]), float(joined[k + 1]))
        if same.any() and self._first_same is None:
            k = int(np.argmax(same))
            self._first_same = (offset + k + 1, float(joined[k + 1]))
        self._back += int(np.count_nonzero(back))
        self._same += int(np.count_nonzero(same))
        self._last_time = time[-1:]

    def finish(self) -> None:
        """Judge what was added.

        Raises:
            RecordingError: On the first of these faults.
        """
        self._check_count()
        self._check_finite()
        self._check_order()
        for word, names, means in (
            (
                "position",
                self._layout.position,
                "a robot at rest tells nothing about its inertia or friction; record it moving",
            ),
            ("torque", self._layout.torque, "is this the measured torque, and were the drives on?"),
        ):
            if all(self._low[name] == self._high[name] for name in names):
                raise RecordingError(f"{self._source}: no {word} ever changes ({listing(names)}); {means}")

    def _check_count(self) -> None:
        if self._samples == 0:
            raise RecordingError(f"{self._source}: a header but no rows; the log has no samples")
        if self._samples < FEWEST:
            raise RecordingError(
                f"{self._source}: {self._samples} rows are too few to identify anything; record at least {FEWEST}"
            )

    def _check_finite(self) -> None:
        bad = {name: self._bad[name] for name in self._layout.used if name in self._bad}
        if bad:
            name, (_, row, value) = next(iter(bad.items()))
            kind = "empty or NaN" if np.isnan(value) else "infinite"
            counts = listing([f"'{name}' in {count} rows" for name, (count, _, _) in bad.items()], 6)
            raise RecordingError(
                f"{self._source}: values that are not finite numbers: {counts}; "
                f"'{name}' is {kind} in {self._table.place(row)} first. Cut those rows at the source; "
                "none is dropped or filled in silently"
            )

    def _check_order(self) -> None:
        name = self._layout.time
        if self._first_back is not None:
            row, before, after = self._first_back
            raise RecordingError(
                f"{self._source}: '{name}' runs backwards {self._back} times, first in {self._table.place(row)} "
                f"({before:.9g} then {after:.9g}); sort the rows, or give joined logs as separate files"
            )
        if self._first_same is not None:
            row, at = self._first_same
            raise RecordingError(
                f"{self._source}: '{name}' repeats the stamp before it in {self._same} rows, first in "
                f"{self._table.place(row)} ({at:.9g}); remove the repeated rows, or write time with more digits"
            )

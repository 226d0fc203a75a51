"""The samples of a table in SI units, repaired, each with its place in the file."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from casysid.errors import RecordingError
from casysid.readers.columns import Layout
from casysid.readers.repairs import NONE, ROW, Columns, Repairs
from casysid.readers.table import Table
from casysid.readers.words import curve_times


@dataclass(frozen=True)
class Samples:
    """Rows of a table, batch by batch.

    Attributes:
        table: Reads the file.
        layout: The columns that are used, and their units.
        repairs: What is done to the rows.
    """

    table: Table
    layout: Layout
    repairs: Repairs = NONE

    @property
    def seekable(self) -> bool:
        """Whether rows far into the file are found without reading all before them."""
        return self.table.seekable and self.repairs == NONE

    def batches(self, first: int = 0) -> Iterator[Columns]:
        """All samples from row ``first`` on of those that are left."""
        if self.repairs == NONE:
            yield from self._in_si(first)
            return
        row = 0
        for columns in self.repairs.apply(self._in_si(0), self.layout.time):
            rows = len(columns[ROW])
            if row + rows > first and rows:
                yield {name: values[max(first - row, 0) :] for name, values in columns.items()}
            row += rows

    def stamps(self, first: int = 0) -> Iterator[np.ndarray[tuple[int], np.dtype[np.float64]]]:
        """Time stamps from row ``first`` on."""
        clock = self.layout.clock
        assert clock is not None
        if self.repairs == NONE:
            yield from (clock.seconds(columns) for columns in self.table.batches(clock.columns, first))
        else:
            yield from (columns[clock.columns[0]] for columns in self.batches(first))

    def _in_si(self, first: int) -> Iterator[Columns]:
        clock, place = self.layout.clock, first
        for raw in self.table.batches(self.layout.used, first):
            columns: Columns = {}
            for name, values in raw.items():
                if clock is None or name not in clock.columns:
                    factor = self.layout.factors.get(name, 1.0)
                    columns[name] = values * factor if factor != 1.0 else values.astype(np.float64, copy=False)
            if clock is not None:
                columns[clock.columns[0]] = clock.seconds(raw)
            rows = len(next(iter(columns.values())))
            columns |= {name: np.zeros(rows) for name in self.layout.unmeasured}
            columns[ROW] = np.arange(place, place + rows, dtype=np.float64)
            place += rows
            yield columns

    def place(self, row: int) -> str:
        """Where a row that is left stands in the file."""
        if self.repairs != NONE:
            row = int(next(self.batches(row))[ROW][0])
        return self.table.place(row)

    def with_clock_started(self) -> Samples:
        """With the first stamp known."""
        clock = self.layout.clock
        if clock is None:
            return self
        first = next(self.table.batches(clock.columns), None)
        if first is None:
            return self
        return self.laid_out(clock=clock.started(first))

    def check_curves(self, source: str) -> None:
        """Nothing, if all curves of a plot have the same times.

        Raises:
            RecordingError: They have not.
        """
        times = curve_times(self.table.names)
        if self.layout.time not in times.values():
            return
        used = tuple(dict.fromkeys(times[name] for name in self.layout.used if name in times))
        for columns in self.table.batches(used):
            other = next((name for name in used if not np.array_equal(columns[name], columns[used[0]])), None)
            if other is not None:
                raise RecordingError(
                    f"{source}: the curves have times of their own ({other} is not {used[0]}); export one table, "
                    "or from one topic"
                )

    def laid_out(self, **changes: object) -> Samples:
        """With another layout."""
        return dataclasses.replace(self, layout=dataclasses.replace(self.layout, **changes))  # type: ignore[arg-type]

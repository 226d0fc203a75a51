"""Parquet, one column a channel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.table import from_row
from casysid.recording.source import BATCH

BUFFER = 1 << 18
"""Bytes that are read at once of each column."""


@dataclass(frozen=True)
class ParquetTable:
    """Columns of a Parquet file.

    Attributes:
        path: The file.
        names: Its top-level columns.
    """

    path: Path
    names: tuple[str, ...]

    def read(self, names: Sequence[str]) -> dict[str, Array]:
        """The named columns; see :class:`~casysid.readers.table.Table`."""
        import pyarrow as pa
        from pyarrow import parquet

        try:
            table = parquet.ParquetFile(self.path).read(columns=list(names))
        except (pa.ArrowException, OSError) as error:
            raise self._damaged(error) from error
        return {name: self._numbers(name, table.column(name)) for name in names}

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[dict[str, Array]]:
        """The named columns batch by batch; see :class:`~casysid.readers.table.Table`."""
        import pyarrow as pa
        from pyarrow import parquet

        try:
            # pages are read as they are wanted; a group of rows may be as large as the file
            with parquet.ParquetFile(self.path, buffer_size=BUFFER, pre_buffer=False) as file:
                rows = [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)]
                ends = np.cumsum(rows)
                groups = np.flatnonzero(ends > first).tolist()
                skipped = first - (int(ends[groups[0]]) - rows[groups[0]]) if groups else 0
                read = file.iter_batches(BATCH, row_groups=groups, columns=list(names), use_threads=False)
                yield from from_row(
                    ({name: self._numbers(name, batch.column(name)) for name in names} for batch in read), skipped
                )
        except (pa.ArrowException, OSError) as error:
            raise self._damaged(error) from error

    def place(self, row: int) -> str:
        """Row, counted from 1."""
        return f"row {row + 1} (the first is row 1)"

    def _damaged(self, error: Exception) -> RecordingError:
        return RecordingError(f"{self.path}: the Parquet file is damaged ({error}); copy or record it again")

    def _numbers(self, name: str, column: object) -> Array:
        import pyarrow as pa

        kind = column.type  # type: ignore[attr-defined]
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
            raise RecordingError(
                f"{self.path}: column '{name}' holds {kind}, wanted numbers in SI units (time in seconds); "
                "convert the column and write the file again"
            )
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False))  # type: ignore[attr-defined]


def open_parquet(path: Path) -> ParquetTable:
    """The columns of a Parquet file.

    Raises:
        RecordingError: If it is not Parquet, or was cut off.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        names = parquet.ParquetFile(path).schema_arrow.names
    except (pa.ArrowException, OSError) as error:
        raise RecordingError(f"{path}: not a Parquet file, or cut off ({error}); copy or record it again") from error
    return ParquetTable(path, tuple(names))

"""Parquet, one column a channel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from casysid.archives import Unpackable, check_ratio
from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.batches import from_row
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

    @property
    def seekable(self) -> bool:
        """See :class:`~casysid.readers.table.Table`."""
        return True

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[dict[str, Array]]:
        """The named columns batch by batch; see :class:`~casysid.readers.table.Table`."""
        import pyarrow as pa
        from pyarrow import parquet

        try:
            # pages are read as they are wanted: a group of rows may be as large as the file
            with parquet.ParquetFile(self.path, buffer_size=BUFFER, pre_buffer=False) as file:
                for name in names:
                    self._refuse_no_numbers(name, file.schema_arrow.field(name).type)
                # sizes of columns in the metadata are not asked: Arrow 26 ends the process where their statistics lie
                check_ratio(self.path.stat().st_size, 8 * file.metadata.num_rows * len(names))
                groups, skipped = _groups_from(file.metadata, first)
                read = file.iter_batches(BATCH, row_groups=groups, columns=list(names), use_threads=False)
                yield from from_row((_numbers(batch, names) for batch in read), skipped)
        except Unpackable as error:
            raise RecordingError(f"{self.path}: {error}") from error
        except (pa.ArrowException, OSError, KeyError, UnicodeDecodeError) as error:
            raise self._damage(error) from error

    def place(self, row: int) -> str:
        """Row, counted from 1."""
        return f"row {row + 1} (the first is row 1)"

    def _refuse_no_numbers(self, name: str, kind: object) -> None:
        import pyarrow as pa

        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
            raise RecordingError(
                f"{self.path}: column '{name}' holds {str(kind)[:80]}, wanted numbers in SI units (time in seconds); "
                "convert the column and write the file again"
            )

    def _damage(self, error: Exception) -> RecordingError:
        if isinstance(error, MemoryError):
            return RecordingError(f"{self.path}: a column does not fit into memory ({error}); cut the recording")
        return RecordingError(f"{self.path}: the Parquet file is damaged ({error}); copy or record it again")


def _numbers(batch: Any, names: Sequence[str]) -> dict[str, Array]:
    import pyarrow as pa

    return {name: batch.column(name).cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False) for name in names}


def _groups_from(metadata: Any, first: int) -> tuple[list[int], int]:
    """The groups of rows with row ``first`` and those after it, and how many rows of theirs come before it."""
    rows = [metadata.row_group(k).num_rows for k in range(metadata.num_row_groups)]
    ends = np.cumsum(rows)
    groups = np.flatnonzero(ends > first).tolist()
    return groups, first - (int(ends[groups[0]]) - rows[groups[0]]) if groups else 0


def open_parquet(path: Path) -> ParquetTable:
    """The columns of a Parquet file.

    Raises:
        RecordingError: If it is not Parquet, or was cut off.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        names = parquet.ParquetFile(path).schema_arrow.names
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"{path}: the name of a column is not UTF-8 text ({error}); rename it where the file is written"
        ) from error
    except (pa.ArrowException, OSError, KeyError) as error:
        raise RecordingError(f"{path}: not a Parquet file, or cut off ({error}); copy or record it again") from error
    return ParquetTable(path, tuple(names))

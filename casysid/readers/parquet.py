"""Parquet, one column a channel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError


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
            raise RecordingError(
                f"{self.path}: the Parquet file is damaged ({error}); copy or record it again"
            ) from error
        return {name: self._numbers(name, table.column(name)) for name in names}

    def place(self, row: int) -> str:
        """Row, counted from 1."""
        return f"row {row + 1} (the first is row 1)"

    def _numbers(self, name: str, column: object) -> Array:
        import pyarrow as pa

        kind = column.type  # type: ignore[attr-defined]
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
            raise RecordingError(
                f"{self.path}: column '{name}' holds {kind}, wanted numbers in SI units (time in seconds); "
                "convert the column and write the file again"
            )
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy())  # type: ignore[attr-defined]


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

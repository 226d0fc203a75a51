"""Parquet, one column a channel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from casysid.archives import Unpackable, check_ratio
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
            file = parquet.ParquetFile(self.path)
            for name in names:
                self._refuse_no_numbers(name, file.schema_arrow.field(name).type)
            # the sizes of columns in the metadata are not asked: Arrow 26 ends the process where their statistics lie
            packed, unpacked = self.path.stat().st_size, 8 * file.metadata.num_rows * len(names)
        except (pa.ArrowException, OSError, KeyError, UnicodeDecodeError) as error:
            raise self._damage(error) from error
        try:
            check_ratio(packed, unpacked)
            table = file.read(columns=list(names))
            return {name: np.asarray(table.column(name).cast(pa.float64(), safe=False).to_numpy()) for name in names}
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

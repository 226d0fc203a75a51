"""Parquet, one column a channel."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from casysid.archives import Unpackable, check_ratio
from casysid.errors import RecordingError
from casysid.readers.arrow import Fields, fields_of, is_list
from casysid.readers.batches import Batch, from_row
from casysid.readers.candidates import Labels
from casysid.recording.source import BATCH

BUFFER = 1 << 18
"""Bytes that are read at once of each column."""
LARGEST_INFO = 1 << 24
"""Bytes of a data set's description."""


@dataclass(frozen=True)
class ParquetTable:
    """Columns of a Parquet file.

    Attributes:
        path: The file.
        fields: Its top-level columns.
    """

    path: Path
    fields: Fields

    @property
    def names(self) -> tuple[str, ...]:
        """Column names, lists spread out."""
        return self.fields.names

    @property
    def labels(self) -> Labels:
        """See :class:`~casysid.readers.table.Table`."""
        return Labels(owners=self.fields.owners)

    @property
    def nameless(self) -> str:
        """See :class:`~casysid.readers.table.Table`."""
        return ""

    @property
    def seekable(self) -> bool:
        """See :class:`~casysid.readers.table.Table`."""
        return True

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[Batch]:
        """The named columns batch by batch; see :class:`~casysid.readers.table.Table`."""
        import pyarrow as pa
        from pyarrow import parquet

        try:
            # pages are read as they are wanted: a group of rows may be as large as the file
            with parquet.ParquetFile(self.path, buffer_size=BUFFER, pre_buffer=False) as file:
                sources = self.fields.sources(names)
                # sizes of columns in the metadata are not asked: Arrow 26 ends the process where their statistics lie
                check_ratio(self.path.stat().st_size, 8 * file.metadata.num_rows * len(names))
                groups, skipped = _groups_from(file.metadata, first)
                read = file.iter_batches(BATCH, row_groups=groups, columns=sources, use_threads=False)
                yield from from_row((self.fields.numbers(batch, names) for batch in read), skipped)
        except Unpackable as error:
            raise RecordingError(f"{self.path}: {error}") from error
        except (pa.ArrowException, OSError, KeyError, UnicodeDecodeError) as error:
            raise self._damage(error) from error

    def place(self, row: int) -> str:
        """Row, counted from 1."""
        return f"row {row + 1} (the first is row 1)"

    def _damage(self, error: Exception) -> RecordingError:
        if isinstance(error, MemoryError):
            return RecordingError(f"{self.path}: a column does not fit into memory ({error}); cut the recording")
        return RecordingError(f"{self.path}: the Parquet file is damaged ({error}); copy or record it again")


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
        with parquet.ParquetFile(path, buffer_size=BUFFER, pre_buffer=False) as file:
            schema = file.schema_arrow
            lists = [one.name for one in schema if is_list(one.type)]
            first = next(file.iter_batches(1, columns=lists, use_threads=False), None) if lists else None
            cells = {} if first is None else {name: first.column(name)[0].as_py() for name in lists}
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"{path}: the name of a column is not UTF-8 text ({error}); rename it where the file is written"
        ) from error
    except (pa.ArrowException, OSError, KeyError, IndexError) as error:
        raise RecordingError(f"{path}: not a Parquet file, or cut off ({error}); copy or record it again") from error
    return ParquetTable(path, fields_of(path, schema, cells, data_set_joints(path) if lists else {}))


def data_set_joints(path: Path) -> dict[str, tuple[str, ...]]:
    """Names of the entries of columns, from the ``meta/info.json`` of a LeRobot data set that the file is in."""
    for folder in list(path.absolute().parents)[:4]:
        place = folder / "meta" / "info.json"
        if place.is_file() and place.stat().st_size < LARGEST_INFO:
            break
    else:
        return {}
    try:
        features = json.loads(place.read_text(encoding="utf-8"))["features"]
        found = {name: _flat_names(feature.get("names")) for name, feature in features.items()}
    except (OSError, ValueError, KeyError, AttributeError, TypeError):
        return {}
    return {name: names for name, names in found.items() if names}


def _flat_names(names: object) -> tuple[str, ...]:
    """Names in a list, or in a table of lists."""
    if isinstance(names, dict):
        names = [name for part in names.values() for name in (part if isinstance(part, list) else [part])]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return ()
    return tuple(name.rsplit(".", 1)[0] if name.endswith((".pos", ".vel", ".effort")) else name for name in names)

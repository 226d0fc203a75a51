"""The one value of a column that says of which machine a log is: a number or a word."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from casysid.errors import RecordingError
from casysid.readers.parquet import ParquetTable
from casysid.readers.streams import open_lines
from casysid.readers.table import open_table
from casysid.readers.text import TextTable


def constant_of(path: Path, column: str) -> str:
    """The value of a column that is the same in every row, in words; whole numbers without a point.

    Raises:
        RecordingError: There is no such column, or it changes.
    """
    table = open_table(path)
    if column not in table.names:
        raise RecordingError(
            f"{path}: no column '{column}' to tell machines apart by; there are {', '.join(table.names)[:200]}"
        )
    if isinstance(table, ParquetTable):
        values: Iterable[object] = _of_parquet(table, column)
    elif isinstance(table, TextTable):
        values = _of_text(table, column)
    else:
        values = (value for batch in table.batches((column,)) for value in np.unique(batch[column]).tolist())
    found = set[str]()
    for value in values:
        found.add(_word(value))
        if len(found) > 1:
            one, two = sorted(found)
            raise RecordingError(
                f"{path}: column '{column}' tells the machine and changes within the log, {one!r} and {two!r}; "
                "wanted one value. Write each machine's rows to a file of their own"
            )
    word = found.pop() if found else ""
    if not word:
        raise RecordingError(f"{path}: column '{column}' is empty; wanted the machine's name or number")
    return word


def _of_parquet(table: ParquetTable, column: str) -> Iterator[object]:
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(table.path) as file:
            for batch in file.iter_batches(columns=[column], use_threads=False):
                yield from batch.column(0).unique().to_pylist()
    except (pa.ArrowException, OSError) as error:
        raise RecordingError(f"{table.path}: the Parquet file is damaged ({error}); copy or record it again") from error


def _of_text(table: TextTable, column: str) -> Iterator[object]:
    place = table.header.names.index(column)
    with open_lines(table.path, table.header.encoding) as lines:
        for row in table.rows(lines):
            yield row[place].strip() if place < len(row) else ""


def _word(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)

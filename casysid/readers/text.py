"""Delimited text, plain or gzipped: the header by hand, the numbers in bulk by Arrow, faults by a slow look."""

from __future__ import annotations

import csv
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from casysid.archives import Unpackable
from casysid.errors import RecordingError
from casysid.readers.batches import Batch, from_row
from casysid.readers.candidates import Labels
from casysid.readers.cells import MISSING, Kind, is_number
from casysid.readers.header import BLANKS, LONGEST_LINE, Header, read_header, wanted_cells
from casysid.readers.lists import ListColumns, find_lists, nanoseconds, owners_of_names
from casysid.readers.streams import open_lines, open_plain

BLOCK = 1 << 22
"""Bytes of text that Arrow reads at once: some ten thousand rows."""
NO_LINES = "wanted one line a sample; were line ends lost?"
SPELLINGS_OF_NAN = ("nan", "NaN", "-nan", "-NaN", "NAN", "1.#QNAN", "-1.#IND", "1.#IND", "-1.#QNAN")


@dataclass(frozen=True)
class TextTable:
    """Delimited text with at most one header line, and comment lines starting with # or % before it.

    Attributes:
        path: The file.
        header: How it is written.
        lists: Columns whose cells are lists; they count as one column an entry.
    """

    path: Path
    header: Header
    lists: Mapping[str, ListColumns] = field(default_factory=dict)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Column names in the file's order, lists spread out."""
        spread = ((self.lists[name].names if name in self.lists else (name,)) for name in self.header.names)
        return tuple(name for names in spread for name in names)

    @cached_property
    def labels(self) -> Labels:
        """Units from a row of them, and joints that messages name."""
        owners = dict(owners_of_names(self.header.names, self.header.first))
        for column in self.lists.values():
            owners |= column.owners
        return Labels(self.header.units, owners)

    @property
    def nameless(self) -> str:
        """See :class:`~casysid.readers.table.Table`."""
        return self.header.nameless

    @property
    def seekable(self) -> bool:
        """See :class:`~casysid.readers.table.Table`."""
        return False

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[Batch]:
        """The named columns batch by batch; see :class:`~casysid.readers.table.Table`."""
        from pyarrow import csv as pa_csv

        plain = [name for name in names if name in self._places]
        spread = [column for column in self.lists.values() if set(column.names) & set(names)]
        texts = list(dict.fromkeys(name for column in spread for name in column.sources))
        wanted = [*plain, *texts]
        with self._as_arrow(wanted) as (stream, options):
            yield from from_row(
                (self._columns(batch, plain, spread, texts, names) for batch in pa_csv.open_csv(stream, *options)),
                first,
            )

    @cached_property
    def _places(self) -> dict[str, int]:
        places: dict[str, int] = {}
        for place, name in enumerate(self.header.names):
            if name not in self.lists:
                places.setdefault(name, place)
        return places

    def _columns(
        self,
        batch: Any,
        plain: Sequence[str],
        spread: Sequence[ListColumns],
        texts: Sequence[str],
        names: Sequence[str],
    ) -> Batch:
        found: Batch = {}
        for name in plain:
            place = self._places[name]
            column = batch.column(str(place))
            if self._kind(place) is Kind.DATE:
                found[name] = nanoseconds(column, name, self.path)
            else:
                found[name] = column.to_numpy(zero_copy_only=False)
        cells = {name: batch.column(str(self.header.names.index(name))) for name in texts}
        for column in spread:
            found |= column.numbers(cells, names)
        return {name: np.asarray(found[name]) for name in names}

    def _kind(self, place: int) -> Kind:
        return self.header.kinds[place] if place < len(self.header.kinds) else Kind.NUMBER

    @contextmanager
    def _as_arrow(self, names: Sequence[str]) -> Iterator[tuple[Any, tuple[Any, Any, Any]]]:
        """The decompressed stream and Arrow's options for the named columns.

        Raises:
            RecordingError: For what Arrow finds wrong while this is open.
        """
        import pyarrow as pa
        from pyarrow import csv as pa_csv

        places = [self.header.names.index(name) for name in names]
        kinds = {Kind.WHOLE: pa.int64(), Kind.DATE: pa.string(), Kind.LIST: pa.string()}
        types = {str(k): kinds.get(self._kind(k), pa.float64()) for k in places}
        types |= {str(k): pa.string() for k, name in zip(places, names, strict=True) if self._is_text(name)}
        options = (
            pa_csv.ReadOptions(
                skip_rows=self.header.skipped,
                column_names=[str(i) for i in range(self.header.width)],
                block_size=BLOCK,
                use_threads=False,
            ),
            pa_csv.ParseOptions(delimiter=self.header.delimiter),
            pa_csv.ConvertOptions(
                include_columns=list(types),
                column_types=types,
                decimal_point=self.header.decimal,
                null_values=[*MISSING, *SPELLINGS_OF_NAN],
            ),
        )
        try:
            blanks = self.header.delimiter == BLANKS
            with (
                open_plain(self.path, self.header.encoding, blanks=blanks) as source,
                pa.PythonFile(source, mode="r") as stream,
            ):
                yield stream, options
        except Unpackable as error:
            raise RecordingError(f"{self.path}: {error}") from error
        except (pa.ArrowException, OSError, EOFError, zlib.error, UnicodeError) as error:
            raise RecordingError(f"{self.path}: {self._fault(names) or error}") from error

    def _is_text(self, name: str) -> bool:
        return name in self.lists or any(name in column.sources for column in self.lists.values())

    def place(self, row: int) -> str:
        """Line of the file, counted from 1 as an editor does, comments and blank lines included."""
        with open_lines(self.path, self.header.encoding) as lines:
            line, _ = next(islice(self._rows(lines), row, None), (self.header.skipped + 1 + row, []))
        return f"line {line} (the header is line {self.header.line})" if self.header.line else f"line {line}"

    def rows(self, lines: TextIO) -> Iterator[list[str]]:
        """Cells of every row that is not blank, of the file's text from its start on."""
        return (cells for _, cells in self._rows(lines))

    def _rows(self, lines: TextIO) -> Iterator[tuple[int, list[str]]]:
        """Line number and cells of every row that is not blank."""
        for _ in range(self.header.skipped):
            lines.readline()
        rows = csv.reader(self._bounded(lines), delimiter=self.header.delimiter)
        yield from ((self.header.skipped + rows.line_num, cells) for cells in rows if cells)

    def _bounded(self, lines: TextIO) -> Iterator[str]:
        while line := lines.readline(LONGEST_LINE):
            if len(line) == LONGEST_LINE:
                raise RecordingError(f"{self.path}: a row is longer than {LONGEST_LINE} characters; {NO_LINES}")
            yield " ".join(line.split()) + "\n" if self.header.delimiter == BLANKS and line.strip() else line

    def _fault(self, names: Sequence[str]) -> str | None:
        """What is wrong with the first row that Arrow cannot have liked; None when every row looks right."""
        numbers = [(name, k) for name in names if self._kind(k := self.header.names.index(name)) is Kind.NUMBER]
        columns = [(name, k) for name, k in numbers if not self._is_text(name)]
        with open_lines(self.path, self.header.encoding) as lines:
            rows = self._rows(lines)
            for line, cells in rows:
                if len(cells) != self.header.width:
                    last = next(rows, None) is None and len(cells) < self.header.width
                    advice = (
                        "writing was cut off: delete the line"
                        if last
                        else "mend the line; rows are not dropped silently"
                    )
                    text = self.header.delimiter.join(cells)[:60]
                    return f"line {line} has {len(cells)} cells {wanted_cells(self.header)}: '{text}'; {advice}"
                for name, k in columns:
                    if not is_number(cells[k].strip().replace(self.header.decimal, ".")):
                        return f"column '{name}' holds '{cells[k][:40]}' in line {line}: no number; mend the line"
        return None


def open_text(path: Path) -> TextTable:
    """The columns of a delimited text file.

    Raises:
        RecordingError: If the file is not text, is cut off, or has no header.
    """
    header = read_header(path)
    lists = find_lists(header.names, header.kinds, header.first, path)
    return TextTable(path, header, lists)

"""Delimited text, plain or gzipped: the header by hand, the numbers in bulk by Arrow, faults by a slow look."""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, TextIO

from casysid.archives import GzipBytes, Unpackable
from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.batches import from_row

BLOCK = 1 << 22
"""Bytes of text that Arrow reads at once: some ten thousand rows."""
BUFFER = 1 << 20
LONGEST_LINE = 1 << 20
LONGEST_PREFACE = 1 << 20
"""Characters of blank lines and comments before the header."""
NO_LINES = "wanted one line a sample; were line ends lost?"
NOT_TEXT = "is not text, though its suffix says so; is it a binary log, or another encoding than UTF-8?"


@dataclass(frozen=True)
class TextTable:
    """Delimited text with one header line, and comment lines starting with # before it.

    Attributes:
        path: The file.
        names: Cells of the header.
        header_line: Line of the header, counted from 1.
        delimiter: Comma, semicolon, tab or space.
        decimal: Decimal point or comma.
    """

    path: Path
    names: tuple[str, ...]
    header_line: int
    delimiter: str
    decimal: str

    @property
    def seekable(self) -> bool:
        """See :class:`~casysid.readers.table.Table`."""
        return False

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[dict[str, Array]]:
        """The named columns batch by batch; see :class:`~casysid.readers.table.Table`."""
        from pyarrow import csv as pa_csv

        columns = {name: str(self.names.index(name)) for name in names}
        with self._as_arrow(names) as (stream, options):
            read = pa_csv.open_csv(stream, *options)
            yield from from_row(
                (
                    {name: batch.column(column).to_numpy(zero_copy_only=False) for name, column in columns.items()}
                    for batch in read
                ),
                first,
            )

    @contextmanager
    def _as_arrow(self, names: Sequence[str]) -> Iterator[tuple[Any, tuple[Any, Any, Any]]]:
        """The decompressed stream and Arrow's options for the named columns.

        Raises:
            RecordingError: For what Arrow finds wrong while this is open.
        """
        import pyarrow as pa
        from pyarrow import csv as pa_csv

        chosen = [str(self.names.index(name)) for name in names]
        options = (
            pa_csv.ReadOptions(
                skip_rows=self.header_line,
                column_names=[str(i) for i in range(len(self.names))],
                block_size=BLOCK,
                use_threads=False,
            ),
            pa_csv.ParseOptions(delimiter=self.delimiter),
            pa_csv.ConvertOptions(
                include_columns=chosen,
                column_types=dict.fromkeys(chosen, pa.float64()),
                decimal_point=self.decimal,
            ),
        )
        try:
            with open_bytes(self.path) as source, pa.PythonFile(source, mode="r") as stream:
                yield stream, options
        except Unpackable as error:
            raise RecordingError(f"{self.path}: {error}") from error
        except (pa.ArrowException, OSError, EOFError, zlib.error) as error:
            raise RecordingError(f"{self.path}: {self._fault(names) or error}") from error

    def place(self, row: int) -> str:
        """Line of the file, counted from 1 as an editor does, comments and blank lines included."""
        with open_lines(self.path) as lines:
            line, _ = next(islice(self._rows(lines), row, None), (self.header_line + 1 + row, []))
        return f"line {line} (the header is line {self.header_line})"

    def rows(self, lines: TextIO) -> Iterator[list[str]]:
        """Cells of every row that is not blank, of the file's text from its start on."""
        return (cells for _, cells in self._rows(lines))

    def _rows(self, lines: TextIO) -> Iterator[tuple[int, list[str]]]:
        """Line number and cells of every row that is not blank."""
        for _ in range(self.header_line):
            lines.readline()
        rows = csv.reader(self._bounded(lines), delimiter=self.delimiter)
        yield from ((self.header_line + rows.line_num, cells) for cells in rows if cells)

    def _bounded(self, lines: TextIO) -> Iterator[str]:
        while line := lines.readline(LONGEST_LINE):
            if len(line) == LONGEST_LINE:
                raise RecordingError(f"{self.path}: a row is longer than {LONGEST_LINE} characters; {NO_LINES}")
            yield line

    def _fault(self, names: Sequence[str]) -> str | None:
        """What is wrong with the first row that Arrow cannot have liked; None when every row looks right."""
        columns = [(name, self.names.index(name)) for name in names]
        wanted = f"where the header (line {self.header_line}) names {len(self.names)}"
        with open_lines(self.path) as lines:
            rows = self._rows(lines)
            for line, cells in rows:
                if len(cells) != len(self.names):
                    last = next(rows, None) is None and len(cells) < len(self.names)
                    advice = (
                        "writing was cut off: delete the line"
                        if last
                        else "mend the line; rows are not dropped silently"
                    )
                    return f"line {line} has {len(cells)} cells {wanted}: '{self.delimiter.join(cells)[:60]}'; {advice}"
                for name, k in columns:
                    if not is_number(cells[k].replace(self.decimal, ".")):
                        return f"column '{name}' holds '{cells[k][:40]}' in line {line}: no number; mend the line"
        return None


def open_text(path: Path) -> TextTable:
    """The header of a delimited text file; without one, the comment line before the numbers if it has as many cells.

    Raises:
        RecordingError: If the file is not text, is cut off, or has no header.
    """
    comment, header, number, seen = "", "", 0, 0
    with open_lines(path) as lines:
        while not header:
            line = lines.readline(LONGEST_LINE)
            seen += len(line)
            if not line or seen > LONGEST_PREFACE:
                raise RecordingError(
                    f"{path}: no header line, only blank lines and comments; wanted names such as time,q1,tau1"
                )
            number += 1
            comment, header = (line, "") if line.startswith("#") else (comment, line.strip("\r\n "))
        first = lines.readline(LONGEST_LINE)
    if "\0" in header or len(line) == LONGEST_LINE:
        raise RecordingError(f"{path}: {NOT_TEXT}")
    bare = re.sub('"[^"]*"', "", header)
    delimiter = max((mark for mark in ",;\t" if mark in bare), key=bare.count, default=" ")
    names = _cells(header, delimiter, path)
    if all(is_number(name) for name in names):
        names, number = _cells(comment.strip("#\r\n "), delimiter, path), number - 1
        if len(names) != len(_cells(header, delimiter, path)):
            raise RecordingError(
                f"{path}: line {number + 1} should name the columns, but holds numbers: '{header[:60]}'; "
                "put a header line such as time,q1,q2,tau1,tau2 before the numbers"
            )
    decimal = "," if delimiter == ";" and "," in first and "." not in first else "."
    return TextTable(path, names, number, delimiter, decimal)


def _cells(line: str, delimiter: str, path: Path) -> tuple[str, ...]:
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), ()))
    except csv.Error as error:
        raise RecordingError(
            f"{path}: the header cannot be cut into names of at most {csv.field_size_limit()} characters ({error}); "
            f"is a quote left open? It begins '{line[:60]}'"
        ) from error


def is_gzip(path: Path) -> bool:
    """Whether the contents are gzip, whatever the suffix says."""
    with path.open("rb") as stream:
        return stream.read(2) == b"\x1f\x8b"


def open_bytes(path: Path) -> BinaryIO:
    """The bytes of the file, decompressed, as :class:`~casysid.archives.GzipBytes` does if they are gzip."""
    return io.BufferedReader(GzipBytes(path), BUFFER) if is_gzip(path) else path.open("rb")


@contextmanager
def open_lines(path: Path) -> Iterator[TextIO]:
    """The text of the file, decompressed.

    Raises:
        RecordingError: If the stream is broken off, is not text, or holds more than its bytes honestly can.
    """
    try:
        with io.TextIOWrapper(open_bytes(path), encoding="utf-8-sig", newline="") as lines:
            yield lines
    except Unpackable as error:
        raise RecordingError(f"{path}: {error}") from error
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise RecordingError(
            f"{path}: the gzip stream is broken or cut off ({error}); copy or record the file again"
        ) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path}: {NOT_TEXT}") from error


def is_number(cell: str) -> bool:
    """Whether a cell is empty or a number."""
    try:
        float(cell or "nan")
    except ValueError:
        return cell.strip() in ("", "NA", "N/A", "n/a", "null", "NULL", "#N/A")
    return True

"""How a delimited text is written: its header, marks between cells, decimal mark, and what the first rows hold."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TextIO

from casysid.errors import RecordingError
from casysid.readers.cells import Kind, decimal_mark, is_number, is_value, kind_of
from casysid.readers.messages import listing
from casysid.readers.streams import NOT_TEXT, encoding_of, open_lines
from casysid.readers.units_of_columns import is_unit

LONGEST_LINE = 1 << 20
LONGEST_PREFACE = 1 << 20
"""Characters of blank lines and comments before the header."""
LOOKED_AT = 200
"""Rows that tell the marks and kinds."""
LOOKED_FOR_DECIMALS = 100_000
"""Rows that are looked through for a decimal mark where the first have none."""
BLANKS = " "
"""As a delimiter: any number of blanks and tabs."""
_BLANK_WORDS = re.compile(r"\S+(?:\s*[\[(][^\])]*[\])])?")


@dataclass(frozen=True)
class Header:
    """How a delimited text is written.

    Attributes:
        names: Of the columns.
        line: Of the header, counted from 1; 0 where the text has none and the names were made.
        skipped: Lines before the first row.
        width: Cells of a row; more than names where rows end in a mark.
        delimiter: Comma, semicolon, tab or blanks.
        decimal: Decimal point or comma.
        encoding: Of the text.
        kinds: Of the columns.
        units: By column, from a row of units.
        first: Cells of the first row.
        nameless: What to say of a text that does not name its columns; empty for others.
    """

    names: tuple[str, ...]
    line: int
    skipped: int
    width: int
    delimiter: str
    decimal: str
    encoding: str
    kinds: tuple[Kind, ...]
    units: dict[str, str]
    first: tuple[str, ...]
    nameless: str = ""


@dataclass(frozen=True)
class _Start:
    """The first lines: the last comment, the first other line and its number, and what follows."""

    comment: str
    line: str
    number: int
    rows: list[str]


def read_header(path: Path) -> Header:
    """The header of a delimited text file; without one, the comment line before the numbers if it has as many cells.

    Raises:
        RecordingError: If the file is not text, is cut off, or has no header.
    """
    encoding = encoding_of(path)
    with open_lines(path, encoding) as lines:
        start = _start(lines, path)
    delimiter = _delimiter(start, path)
    names, number, rows = _names(start, delimiter, path)
    nameless = ""
    if not names:
        names, nameless = _made_up(rows[0]), _no_names(rows[0], start, path)
    units: dict[str, str] = {}
    skipped = number
    if not nameless and rows and _are_units(rows[0]):
        units = {name: cell.strip(" []()") for name, cell in zip(names, rows[0], strict=False) if cell.strip(" []()")}
        skipped, rows = number + 1, rows[1:]
    width = _usual_width(rows, len(names))
    while len(names) > width and not names[-1]:
        names = names[:-1]
    if not _trails(rows, len(names), width):
        width = len(names)
    decimal = _decimal(path, encoding, delimiter, skipped, rows)
    columns = list(zip(*(row for row in rows if len(row) == width), strict=True)) or [()] * width
    kinds = tuple(kind_of(cells, decimal) for cells in columns[: len(names)])
    first = tuple(next((row for row in rows if len(row) == width), ()))
    return Header(names, number, skipped, width, delimiter, decimal, encoding, kinds, units, first, nameless)


def _start(lines: TextIO, path: Path) -> _Start:
    comment, header, number, seen = "", "", 0, 0
    while not header:
        line = lines.readline(LONGEST_LINE)
        seen += len(line)
        if not line or seen > LONGEST_PREFACE:
            raise RecordingError(
                f"{path}: no header line, only blank lines and comments; wanted names such as time,q1,tau1"
            )
        number += 1
        comment, header = (line, "") if line.startswith(("#", "%")) else (comment, line.strip("\r\n"))
        header = "" if not header.strip() else header
    if "\0" in header or len(line) == LONGEST_LINE:
        raise RecordingError(f"{path}: {NOT_TEXT}")
    rows = []
    for row in islice(iter(lambda: lines.readline(LONGEST_LINE), ""), LOOKED_AT):
        if row.strip():
            rows.append(row.strip("\r\n"))
    return _Start(comment.strip("\r\n "), header, number, rows)


def _delimiter(start: _Start, path: Path) -> str:
    """The mark that cuts most rows into as many cells as the header, the header into most cells."""
    bare = re.sub('"[^"]*"', "", start.line)
    marks = [mark for mark in ",;\t" if mark in bare]
    rows = start.rows or [start.line]
    scores = {}
    for mark in (*marks, BLANKS):
        width = _filled(cut(start.line, mark, path))
        fit = sum(_filled(_soft_cut(row, mark)) == width for row in rows[:50]) if width > 1 else 0
        scores[mark] = (2 * fit > len(rows[:50]), width) if mark != BLANKS else (2 * fit > len(rows[:50]), 1)
    if not marks:
        return BLANKS
    best = max(scores, key=lambda mark: scores[mark])
    return best if scores[best][0] else max(marks, key=bare.count)


def _filled(cells: Sequence[str]) -> int:
    """Cells up to the last that holds something."""
    return next((k for k in range(len(cells), 0, -1) if cells[k - 1].strip()), 0)


def _names(start: _Start, delimiter: str, path: Path) -> tuple[tuple[str, ...], int, list[tuple[str, ...]]]:
    """Names, the line of the header, and the rows looked at; no names where the text does not tell them."""
    header = cut(start.line, delimiter, path)
    rows = [_soft_cut(row, delimiter) for row in start.rows]
    first = next((cell for cell in header if cell), "")
    if not is_value(first) and not all(is_number(cell) for cell in header):
        if delimiter == BLANKS and rows and len(header) != len(rows[0]):
            whole = tuple(re.sub(r"\s+", " ", word) for word in _BLANK_WORDS.findall(start.line))
            header = whole if len(whole) == len(rows[0]) else header
        return header, start.number, rows
    rows = [header, *rows]
    width = _filled(header)
    comment = start.comment if start.comment.startswith("%time") else start.comment.lstrip("#% ")
    for mark in dict.fromkeys((delimiter, ",", BLANKS)):
        names = cut(comment, mark, path) if comment else ()
        if len(names) in (width, len(header)) and not all(is_number(name) for name in names):
            return names, start.number - 1, rows
    return (), start.number - 1, rows


def _made_up(row: Sequence[str]) -> tuple[str, ...]:
    return joint_state_names(row) or tuple(f"column{k + 1}" for k in range(len(row)))


def joint_state_names(row: Sequence[str]) -> tuple[str, ...]:
    """Columns of a row as ``ros2 topic echo --csv`` writes a JointState: stamp, frame, names, then three lists.

    Empty for other rows.
    """
    if len(row) < 7 or not (row[0].isdigit() and row[1].isdigit()) or (row[2].strip() and is_number(row[2])):
        return ()
    joints = next((k for k, cell in enumerate(row[3:]) if is_number(cell)), 0)
    if not joints or len(row) != 3 + 4 * joints or not all(is_number(cell) for cell in row[3 + joints :]):
        return ()
    lists = [f"{word}[{k}]" for word in ("name", "position", "velocity", "effort") for k in range(joints)]
    return ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id", *lists)


def _no_names(row: Sequence[str], start: _Start, path: Path) -> str:
    """A message for who has not named the columns, with the two likeliest headers; empty where they are known."""
    if joint_state_names(row):
        return ""
    count = len(row)
    likely = []
    for lists in (("q", "dq", "tau"), ("q", "tau"), ("q", "dq", "ddq", "tau")):
        joints, rest = divmod(count - 1, len(lists))
        if rest == 0 and joints:
            likely.append(
                "time," + ",".join(f"{name}1" + (f"..{name}{joints}" if joints > 1 else "") for name in lists)
            )
    guess = f" {count} columns would be ({') or ('.join(likely[:2])})." if likely else ""
    return (
        f"{path}: line {start.number} should name the columns, but holds numbers: '{start.line[:60]}';{guess} "
        "put a header line such as time,q1,q2,tau1,tau2 before the numbers, every name written out, or say which is "
        "which with --map FILE, in which they are column1, column2 and so on"
    )


def _are_units(row: Sequence[str]) -> bool:
    cells = [cell.strip(" []()") for cell in row]
    filled = [cell for cell in cells if cell and cell != "-"]
    return bool(filled) and all(is_unit(cell) for cell in filled)


def _usual_width(rows: Sequence[Sequence[str]], names: int) -> int:
    """Cells of most rows."""
    counts = [len(row) for row in rows]
    return max(set(counts), key=lambda width: (counts.count(width), width == names), default=names)


def _trails(rows: Sequence[Sequence[str]], names: int, width: int) -> bool:
    """Whether most rows have empty cells beyond the names."""
    wide = [row for row in rows if len(row) == width]
    return width > names and bool(wide) and all(not cell for row in wide for cell in row[names:])


def _decimal(path: Path, encoding: str, delimiter: str, skipped: int, rows: Sequence[Sequence[str]]) -> str:
    """The decimal mark; where the first rows have none it is looked for further on."""
    mark = decimal_mark([cell for row in rows for cell in row])
    if mark is None and len(rows) >= LOOKED_AT - 1 and delimiter != ",":
        with open_lines(path, encoding) as lines:
            further = islice(lines, skipped, skipped + LOOKED_FOR_DECIMALS)
            mark = next((one for row in further if (one := decimal_mark(_soft_cut(row, delimiter)))), None)
    return mark or "."


def cut(line: str, delimiter: str, path: Path) -> tuple[str, ...]:
    """The cells of a line.

    Raises:
        RecordingError: A quote is left open.
    """
    try:
        return _cells(line, delimiter)
    except csv.Error as error:
        raise RecordingError(
            f"{path}: the header cannot be cut into names of at most {csv.field_size_limit()} characters ({error}); "
            f"is a quote left open? It begins '{line[:60]}'"
        ) from error


def _soft_cut(line: str, delimiter: str) -> tuple[str, ...]:
    """The cells of a line; the line itself if it cannot be cut."""
    try:
        return _cells(line, delimiter)
    except csv.Error:
        return (line,)


def _cells(line: str, delimiter: str) -> tuple[str, ...]:
    if delimiter == BLANKS:
        line = " ".join(line.split())
    return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), ()))


def wanted_cells(header: Header) -> str:
    """How many cells a row should have, for a message."""
    if header.line:
        return f"where the header (line {header.line}) names {len(header.names)}"
    return f"where the first row has {len(header.names)} ({listing(header.names, 4)})"

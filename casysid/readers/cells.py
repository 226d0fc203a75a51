"""What stands in the cells of a text: numbers, whole numbers of many digits, dates, lists, words."""

from __future__ import annotations

import enum
import re
from collections.abc import Sequence

MISSING = ("", "NA", "N/A", "n/a", "null", "NULL", "#N/A", "None", "none", "-", "--", ".nan", ".NaN")
"""Cells that hold nothing, beside the spellings of NaN."""
_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d([.,]\d+)?)?\s*(Z|[+-]\d\d:?\d\d)?")
_LIST = re.compile(r"\s*(array\(|tuple\(|np\.array\()?\s*[\[(]")
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_POINT = re.compile(r"[+-]?(\d+\.\d*|\.\d+)([eE][+-]?\d+)?")
LONG_DIGITS = 16
"""A double has 53 bits, 15 decimal digits."""


class Kind(enum.Enum):
    """Of the cells of a column."""

    NUMBER = "number"
    WHOLE = "whole number of many digits"
    DATE = "date"
    LIST = "list"
    WORD = "word"


def is_number(cell: str) -> bool:
    """Whether a cell is empty or a number."""
    try:
        float(cell or "nan")
    except ValueError:
        return cell.strip() in MISSING
    return True


def kind_of(cells: Sequence[str], decimal: str) -> Kind:
    """What the cells of a column are, by those that hold something; words if they are no one thing."""
    filled = [cell.strip() for cell in cells if cell.strip() not in MISSING]
    plain = [cell.replace(decimal, ".") for cell in filled]
    if all(is_number(cell) for cell in plain):
        digits = [cell.lstrip("+-") for cell in plain]
        whole = bool(digits) and all(cell.isdigit() for cell in digits)
        return Kind.WHOLE if whole and max(map(len, digits)) >= LONG_DIGITS else Kind.NUMBER
    if all(_DATE.fullmatch(cell) for cell in filled):
        return Kind.DATE
    if all(_LIST.match(cell) for cell in filled):
        return Kind.LIST
    numbers = sum(map(is_number, plain))
    return Kind.NUMBER if 2 * numbers > len(plain) else Kind.WORD


def decimal_mark(cells: Sequence[str]) -> str | None:
    """The decimal mark that numbers among the cells have; None if none has one."""
    commas = sum(_COMMA.fullmatch(cell.strip()) is not None for cell in cells)
    points = sum(_POINT.fullmatch(cell.strip()) is not None for cell in cells)
    return "," if commas > points else "." if points else None


def is_value(cell: str) -> bool:
    """Whether a cell that is not empty holds a number, with a point or a comma, a date or a list."""
    text = cell.strip()
    if not text:
        return False
    number = is_number(text) or _COMMA.fullmatch(text) is not None
    return number or _DATE.fullmatch(text) is not None or _LIST.match(text) is not None

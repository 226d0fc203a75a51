"""Lists in the cells of a text, as JointState messages have them: ``[0.1, 0.2]``, ``(0.1, 0.2)``, ``['elbow']``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.batches import Batch
from casysid.readers.cells import Kind, is_number
from casysid.readers.messages import refuse_too_many
from casysid.readers.words import words_of

_FRAME = re.compile(r"^\s*(?:array|tuple|np\.array)?\(?\s*[\[(]|[\])]\s*(?:,\s*dtype=[^)]*)?\)?\s*$")
_APART = re.compile(r"'[^']*'|\"[^\"]*\"|[^\s'\"]+")


@dataclass(frozen=True)
class ListColumns:
    """A column of lists as one column an entry.

    Attributes:
        name: Of the column.
        width: Entries of a list.
        joints: Whose the entries are in the first row; empty where the log does not say.
        labelled_by: The column that says it; empty for none.
    """

    name: str
    width: int
    joints: tuple[str, ...] = ()
    labelled_by: str = ""
    names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", entry_names(self.name, self.width))

    @property
    def owners(self) -> dict[str, str]:
        """Joints by the names of entries."""
        return dict(zip(self.names, self.joints, strict=False))

    @property
    def sources(self) -> tuple[str, ...]:
        """Columns of text that are read."""
        return (self.name, *((self.labelled_by,) if self.labelled_by else ()))

    def numbers(self, cells: Mapping[str, Any], wanted: Sequence[str]) -> Batch:
        """Entries by name from cells of text; nan in rows whose list has others."""
        values = self._entries(cells[self.name])
        if self.labelled_by:
            values = self._in_order(values, cells[self.labelled_by])
        return {name: values[:, k] for k, name in enumerate(self.names) if name in wanted}

    def _entries(self, column: Any) -> Array:
        texts = column.to_pylist()
        values = np.full((len(texts), self.width), np.nan)
        for row, text in enumerate(texts):
            entries = _numbers(text or "")
            values[row, : min(len(entries), self.width)] = entries[: self.width]
            if self.labelled_by == "" and len(entries) != self.width:
                values[row] = np.nan
        return values

    def _in_order(self, values: Array, labels: Any) -> Array:
        """Entries in the order of the first row's joints."""
        encoded = labels.dictionary_encode()
        codes = encoded.indices.to_numpy(zero_copy_only=False)
        for code, text in enumerate(encoded.dictionary.to_pylist()):
            joints = _texts(text or "")
            if joints != self.joints:
                rows = codes == code
                places = [joints.index(joint) if joint in joints else -1 for joint in self.joints]
                picked = [k for k, place in enumerate(places) if 0 <= place < self.width]
                other = np.full((int(rows.sum()), self.width), np.nan)
                other[:, picked] = values[rows][:, [places[k] for k in picked]]
                values[rows] = other
        return values


def entry_names(name: str, width: int) -> tuple[str, ...]:
    """What the entries of a column of lists are called."""
    return tuple(f"{name}[{k}]" for k in range(width))


def find_lists(names: Sequence[str], kinds: Sequence[Kind], first: Sequence[str], path: Path) -> dict[str, ListColumns]:
    """The columns of lists of numbers.

    Raises:
        RecordingError: They have more entries than a recording can.
    """
    cells = {name: cell for name, cell, kind in zip(names, first, kinds, strict=False) if kind is Kind.LIST}
    texts = {name: _texts(cell) for name, cell in cells.items()}
    labels = {name: entries for name, entries in texts.items() if not all(map(is_number, entries))}
    found = {}
    for name, entries in texts.items():
        refuse_too_many(len(entries), str(path))
        if name in labels:
            continue
        label = next((key for key, joints in labels.items() if _siblings(key, name) and joints), "")
        if entries and (not label or len(labels[label]) == len(entries)):
            found[name] = ListColumns(name, len(entries), labels.get(label, ()), label)
    return found


def _siblings(label: str, name: str) -> bool:
    """Whether a column of names is of the same message as another column."""
    words, others = words_of(label), words_of(name)
    return bool(words) and words[-1] in ("name", "names") and words[:-1] == others[: len(words) - 1]


def owners_of_names(names: Sequence[str], first: Sequence[str]) -> dict[str, str]:
    """Joints by column where ``name0``, ``name1`` hold text and columns beside them share its beginning and number."""
    joints: dict[tuple[tuple[str, ...], str], str] = {}
    for name, cell in zip(names, first, strict=False):
        words = words_of(name)
        if len(words) > 1 and words[-1].isdigit() and words[-2] in ("name", "names") and not is_number(cell):
            joints[words[:-2], words[-1]] = cell.strip("'\" ")
    owners = {}
    for name in names if joints else ():
        words = words_of(name)
        if len(words) > 1 and words[-1].isdigit() and words[-2] not in ("name", "names"):
            for length in range(len(words) - 1, -1, -1):
                owner = joints.get((words[:length], words[-1]))
                if owner is not None:
                    owners[name] = owner
                    break
    return owners


@lru_cache(maxsize=1 << 10)
def _texts(cell: str) -> tuple[str, ...]:
    """The entries of a list as text, without quotes."""
    inner = _FRAME.sub("", cell)
    if "," not in inner and ";" not in inner:
        return tuple(part.strip("'\"") for part in _APART.findall(inner))
    return tuple(part.strip(" '\"\t") for part in inner.replace(";", ",").split(",") if part.strip(" '\"\t"))


def _numbers(cell: str) -> list[float]:
    inner = _FRAME.sub("", cell)
    parts = inner.replace(";", ",").split(",") if "," in inner or ";" in inner else inner.split()
    try:
        return [float(part) for part in parts if part.strip()]
    except ValueError:
        return []


def nanoseconds(column: Any, name: str, path: Path) -> np.ndarray[Any, Any]:
    """Dates as whole nanoseconds since 1970; nan where a cell is empty.

    Raises:
        RecordingError: One is no date.
    """
    import pyarrow as pa
    from pyarrow import compute as pc

    text = pc.replace_substring(pc.utf8_trim_whitespace(column), ",", ".")
    zoned = pc.any(pc.match_substring_regex(text, r"(Z|[+-]\d\d:?\d\d)$")).as_py()
    try:
        moments = pc.cast(text, pa.timestamp("ns", "UTC" if zoned else None))
    except pa.ArrowException as error:
        raise RecordingError(
            f"{path}: column '{name}' holds dates that cannot be read ({error}); wanted ISO 8601"
        ) from (error)
    return np.asarray(moments.cast(pa.int64()).to_numpy(zero_copy_only=False))

"""NumPy archives: arrays named as columns, or matrices q, v, a, tau with columns in the model file's order."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from casysid.archives import ArrayHeader, Unpackable, array_headers, check_ratio
from casysid.errors import RecordingError
from casysid.readers.batches import Batch
from casysid.readers.candidates import Labels
from casysid.readers.messages import listing, refuse_too_many
from casysid.readers.npy import open_member
from casysid.recording.source import BATCH

NUMBERS = "buif"  # kinds of NumPy types: truth values, whole numbers, real numbers


@dataclass(frozen=True)
class NpzTable:
    """Columns of an NPZ file; a matrix ``q`` of shape (N, n) counts as the columns ``q1`` to ``qn``.

    Attributes:
        path: The file.
        columns: Array and column in it (None: the whole array) by the name of the column.
    """

    path: Path
    columns: dict[str, tuple[str, int | None]]

    @property
    def names(self) -> tuple[str, ...]:
        """Column names, matrices spread out."""
        return tuple(self.columns)

    @property
    def labels(self) -> Labels:
        """See :class:`~casysid.readers.table.Table`."""
        return Labels()

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
        keys = list(dict.fromkeys(self.columns[name][0] for name in names))
        rows = self._checked_rows(names, keys)
        try:
            with zipfile.ZipFile(self.path) as archive, ExitStack() as opened:
                members = {key: opened.enter_context(open_member(archive, key)) for key in keys}
                for member in members.values():
                    member.skip(first)
                for _ in range(first, rows, BATCH):
                    arrays = {key: member.read(BATCH) for key, member in members.items()}
                    yield {
                        name: arrays[key] if k is None else arrays[key][:, k]
                        for name, (key, k) in ((name, self.columns[name]) for name in names)
                    }
        except Unpackable as error:
            raise RecordingError(f"{self.path}: cannot be read: {error}") from error

    def place(self, row: int) -> str:
        """Row, counted from 1."""
        return f"row {row + 1} (the first is row 1)"

    def _checked_rows(self, names: Sequence[str], keys: Sequence[str]) -> int:
        """How many rows the arrays have, once they are known to be numbers, equally long and no bomb."""
        headers = _headers(self.path)
        for key in keys:
            if headers[key].dtype.kind not in NUMBERS:
                raise RecordingError(
                    f"{self.path}: array '{key}' cannot be read as numbers: it holds {headers[key].dtype}, wanted real "
                    "numbers in SI units (time in seconds); convert it and write the file again with numpy.savez"
                )
        lengths = {name: headers[self.columns[name][0]].shape[0] for name in names}
        if len(set(lengths.values())) > 1:
            listed = listing([f"{name} {n}" for name, n in lengths.items()])
            raise RecordingError(
                f"{self.path}: the arrays must be equally long; got {listed}; cut them to the same samples"
            )
        try:
            check_ratio(sum(headers[key].packed for key in keys), sum(headers[key].size for key in keys))
        except Unpackable as error:
            raise RecordingError(f"{self.path}: cannot be read: {error}") from error
        return lengths[names[0]]


def open_npz(path: Path) -> NpzTable:
    """The arrays of an NPZ file.

    Raises:
        RecordingError: If it is not an NPZ file, was cut off, or two arrays mean the same column.
    """
    columns: dict[str, tuple[str, int | None]] = {}
    for key, header in _headers(path).items():
        shape = header.shape
        spread: dict[str, tuple[str, int | None]] = {}
        if len(shape) == 2:
            refuse_too_many(len(columns) + shape[1], str(path))
            spread = {f"{key}{k + 1}": (key, k) for k in range(shape[1])}
        elif len(shape) == 1:
            spread = {key: (key, None)}
        twice = sorted(columns.keys() & spread.keys())
        if twice:
            raise RecordingError(
                f"{path}: array '{key}' and another one both hold {listing(twice)}; remove one of them"
            )
        columns |= spread
    refuse_too_many(len(columns), str(path))
    return NpzTable(path, columns)


def _headers(path: Path) -> dict[str, ArrayHeader]:
    try:
        return array_headers(path)
    except Unpackable as error:
        raise RecordingError(f"{path}: not an NPZ file, or cut off ({error}); write it with numpy.savez") from error

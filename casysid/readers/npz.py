"""NumPy archives: arrays named as columns, or matrices q, v, a, tau with a column a channel in the model's order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from casysid.archives import ArrayHeader, Unpackable, array_headers, read_arrays
from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.columns import listing, refuse_too_many

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

    def read(self, names: Sequence[str]) -> dict[str, Array]:
        """The named columns; see :class:`~casysid.readers.table.Table`."""
        arrays = self._load(list(dict.fromkeys(self.columns[name][0] for name in names)))
        columns = {}
        for name in names:
            key, k = self.columns[name]
            columns[name] = arrays[key] if k is None else arrays[key][:, k]
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            listed = listing([f"{name} {n}" for name, n in lengths.items()])
            raise RecordingError(
                f"{self.path}: the arrays must be equally long; got {listed}; cut them to the same samples"
            )
        return columns

    def place(self, row: int) -> str:
        """Row, counted from 1."""
        return f"row {row + 1} (the first is row 1)"

    def _load(self, keys: list[str]) -> dict[str, Array]:
        headers = _headers(self.path)
        for key in keys:
            if headers[key].dtype.kind not in NUMBERS:
                raise RecordingError(
                    f"{self.path}: array '{key}' cannot be read as numbers: it holds {headers[key].dtype}, wanted real "
                    "numbers in SI units (time in seconds); convert it and write the file again with numpy.savez"
                )
        try:
            return {key: array.astype(np.float64, copy=False) for key, array in read_arrays(self.path, keys).items()}
        except Unpackable as error:
            raise RecordingError(f"{self.path}: cannot be read: {error}") from error


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

"""NumPy archives: arrays named as columns, or matrices q, v, a, tau with a column a channel in the model's order."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.npy import Member, open_member, read_header
from casysid.recording.source import BATCH


@dataclass(frozen=True)
class NpzTable:
    """Columns of an NPZ file; a matrix ``q`` of shape (N, n) counts as the columns ``q1`` to ``qn``.

    Attributes:
        path: The file.
        columns: Array and column in it (None: the whole array) by the name of the column.
        rows: Length by array.
    """

    path: Path
    columns: dict[str, tuple[str, int | None]]
    rows: dict[str, int]

    @property
    def names(self) -> tuple[str, ...]:
        """Column names, matrices spread out."""
        return tuple(self.columns)

    def read(self, names: Sequence[str]) -> dict[str, Array]:
        """The named columns; see :class:`~casysid.readers.table.Table`."""
        self._require_equal_lengths(names)
        arrays = _load(self.path, {self.columns[name][0] for name in names})
        columns = {}
        for name in names:
            key, k = self.columns[name]
            columns[name] = arrays[key] if k is None else arrays[key][:, k]
        return columns

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[dict[str, Array]]:
        """The named columns batch by batch; see :class:`~casysid.readers.table.Table`."""
        self._require_equal_lengths(names)
        try:
            with zipfile.ZipFile(self.path) as archive, ExitStack() as opened:
                members: dict[str, Member] = {}
                for name in names:
                    key, _ = self.columns[name]
                    if key not in members:
                        members[key] = opened.enter_context(open_member(archive, key))
                rows = next(iter(members.values())).rows
                for member in members.values():
                    member.skip(first)
                for _ in range(first, rows, BATCH):
                    arrays = {key: member.read(BATCH) for key, member in members.items()}
                    yield {
                        name: arrays[key] if k is None else arrays[key][:, k]
                        for name, (key, k) in ((name, self.columns[name]) for name in names)
                    }
        except (zipfile.BadZipFile, zlib.error, ValueError, TypeError, OSError, EOFError) as error:
            raise RecordingError(
                f"{self.path}: array '{key}' cannot be read as numbers ({error}); write it with numpy.savez"
            ) from error

    def _require_equal_lengths(self, names: Sequence[str]) -> None:
        lengths = {name: self.rows[self.columns[name][0]] for name in names}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name} {n}" for name, n in lengths.items())
            raise RecordingError(
                f"{self.path}: the arrays must be equally long; got {listed}; cut them to the same samples"
            )

    def place(self, row: int) -> str:
        """Row, counted from 1."""
        return f"row {row + 1} (the first is row 1)"


def open_npz(path: Path) -> NpzTable:
    """The arrays of an NPZ file.

    Raises:
        RecordingError: If it is not an NPZ file, or was cut off.
    """
    columns: dict[str, tuple[str, int | None]] = {}
    shapes = _shapes(path)
    for key, shape in shapes.items():
        if len(shape) == 2:
            columns |= {f"{key}{k + 1}": (key, k) for k in range(shape[1])}
        elif len(shape) == 1:
            columns[key] = (key, None)
    return NpzTable(path, columns, {key: shape[0] for key, shape in shapes.items() if shape})


def _shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Shapes by name, from the arrays' headers alone."""
    try:
        with zipfile.ZipFile(path) as archive:
            shapes = {}
            for member in (name for name in archive.namelist() if name.endswith(".npy")):
                with archive.open(member) as stream:
                    shapes[member.removesuffix(".npy")] = read_header(stream)[0]
    except (zipfile.BadZipFile, zlib.error, ValueError, OSError) as error:
        raise RecordingError(f"{path}: not an NPZ file, or cut off ({error}); write it with numpy.savez") from error
    return shapes


def _load(path: Path, keys: set[str]) -> dict[str, Array]:
    arrays = {}
    try:
        with np.load(path, allow_pickle=False) as archive:
            for key in keys:
                arrays[key] = archive[key].astype(np.float64, copy=False)
    except (zipfile.BadZipFile, zlib.error, ValueError, TypeError, OSError) as error:
        raise RecordingError(
            f"{path}: array '{key}' cannot be read as numbers ({error}); write it with numpy.savez"
        ) from error
    return arrays

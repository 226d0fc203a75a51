"""MATLAB's ``.mat`` files up to version 7: vectors and matrices, also in structures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from casysid.archives import UNQUESTIONED
from casysid.errors import RecordingError
from casysid.readers.batches import Batch
from casysid.readers.candidates import Labels
from casysid.readers.messages import listing, refuse_too_many
from casysid.recording.source import BATCH

DEEPEST = 4
"""Structures within structures that are looked into."""
NUMBERS = "buif"


@dataclass(frozen=True)
class MatTable:
    """Columns of the variables of a ``.mat`` file; a matrix ``q`` of shape (N, n) counts as ``q1`` to ``qn``.

    Attributes:
        path: The file.
        columns: All of them, in memory.
    """

    path: Path
    columns: Mapping[str, np.ndarray[Any, Any]]

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
        lengths = {name: len(self.columns[name]) for name in names}
        if len(set(lengths.values())) > 1:
            listed = listing([f"{name} {n}" for name, n in lengths.items()])
            raise RecordingError(
                f"{self.path}: the arrays must be equally long; got {listed}; cut them to the same samples"
            )
        for row in range(first, lengths[names[0]], BATCH):
            yield {name: self.columns[name][row : row + BATCH] for name in names}

    def place(self, row: int) -> str:
        """Row, counted from 1."""
        return f"row {row + 1} (the first is row 1)"


def open_mat(path: Path) -> MatTable:
    """The columns of a ``.mat`` file. Such a file is read whole; larger ones than 256 MB are refused.

    Raises:
        RecordingError: If it is none, is of version 7.3 (HDF5), is too large, or damaged.
    """
    from scipy.io import loadmat, whosmat

    with path.open("rb") as stream:
        if b"MATLAB 7.3" in stream.read(128):
            raise RecordingError(
                f"{path}: is of MATLAB's version 7.3, which is HDF5; save it with save(..., '-v7'), or write a CSV or "
                "Parquet file (writetable, parquetwrite)"
            )
    try:
        sizes = [8 * int(np.prod(shape, dtype=np.float64)) for _, shape, _ in whosmat(path)]
        if sum(sizes) > UNQUESTIONED or path.stat().st_size > UNQUESTIONED:
            raise RecordingError(
                f"{path}: holds {sum(sizes)} bytes and is read whole; at most {UNQUESTIONED} are. Write it as Parquet "
                "(parquetwrite), which is read piece by piece"
            )
        found = loadmat(path, squeeze_me=False, struct_as_record=True, chars_as_strings=True)
    except RecordingError:
        raise
    except Exception as error:  # whatever the bytes of a stranger make a decoder raise means damage
        raise RecordingError(
            f"{path}: not a MATLAB file, or damaged ({type(error).__name__}: {str(error)[:200]})"
        ) from (error)
    columns: dict[str, np.ndarray[Any, Any]] = {}
    for name, value in found.items():
        if not name.startswith("__"):
            columns |= _spread(name, value, path, DEEPEST)
    refuse_too_many(len(columns), str(path))
    return MatTable(path, columns)


def _spread(name: str, value: np.ndarray[Any, Any], path: Path, depth: int) -> dict[str, np.ndarray[Any, Any]]:
    """Columns of a variable; of structures those of their fields."""
    if value.dtype.names and value.size == 1 and depth:
        found: dict[str, np.ndarray[Any, Any]] = {}
        for field in value.dtype.names:
            found |= _spread(f"{name}.{field}", np.asarray(value[field].item()), path, depth - 1)
        return found
    if value.dtype.kind not in NUMBERS or value.ndim != 2 or not value.size:
        return {}
    if 1 in value.shape:
        return {name: _numbers(value.reshape(-1))}
    if value.shape[0] < value.shape[1] and value.shape[1] > 10 * value.shape[0]:
        value = value.T  # samples along columns, as Simulink has them
    refuse_too_many(value.shape[1], str(path))
    return {f"{name}{k + 1}": _numbers(column) for k, column in enumerate(value.T)}


def _numbers(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return values.astype(np.int64 if values.dtype.kind in "iu" else np.float64)

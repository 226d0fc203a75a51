"""Columns that come some rows at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from casysid.arrays import Array

Batch = dict[str, np.ndarray[Any, Any]]
"""Columns by name, of equally many rows: doubles, and whole numbers that a double does not hold."""


def from_row(batches: Iterable[Batch], first: int) -> Iterator[Batch]:
    """Batches without the rows before ``first``."""
    for columns in batches:
        rows = len(next(iter(columns.values())))
        if first < rows:
            yield {name: values[first:] for name, values in columns.items()} if first else columns
        first = max(first - rows, 0)


def all_rows(names: Sequence[str], batches: Iterable[Batch]) -> dict[str, Array]:
    """Consecutive batches of the named columns as one."""
    parts = list(batches)
    return {name: np.concatenate([part[name] for part in parts] or [np.empty(0)]) for name in names}

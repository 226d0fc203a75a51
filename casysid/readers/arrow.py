"""Columns of Arrow's tables as numbers: lists spread out, moments in nanoseconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from casysid.errors import RecordingError
from casysid.readers.batches import Batch
from casysid.readers.lists import entry_names
from casysid.readers.messages import refuse_too_many


@dataclass(frozen=True)
class Fields:
    """The columns of a table, each list as one column an entry.

    Attributes:
        path: The file.
        kinds: Arrow's types by column.
        spread: Column and entry by the name of a column that numbers are read of.
        owners: Joints by name, where a data set says it.
    """

    path: Path
    kinds: Mapping[str, Any]
    spread: Mapping[str, tuple[str, int | None]]
    owners: Mapping[str, str] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Columns with lists spread out."""
        return tuple(self.spread)

    def sources(self, names: Sequence[str]) -> list[str]:
        """Columns of the table that some names come from, each known to hold numbers.

        Raises:
            RecordingError: One does not.
        """
        found = list(dict.fromkeys(self.spread[name][0] for name in names))
        for name in found:
            self._refuse_no_numbers(name)
        return found

    def numbers(self, batch: Any, names: Sequence[str]) -> Batch:
        """Some columns of a record batch."""
        matrices: Batch = {}
        found: Batch = {}
        for name in names:
            source, entry = self.spread[name]
            if source not in matrices:
                column = batch.column(source)
                matrices[source] = _flat(column) if entry is None else _matrix(column, self._width(source))
            found[name] = matrices[source] if entry is None else matrices[source][:, entry]
        return found

    def _width(self, source: str) -> int:
        return sum(name == source for name, _ in self.spread.values())

    def _refuse_no_numbers(self, name: str) -> None:
        import pyarrow as pa

        kind = self.kinds[name]
        inner = kind.value_type if is_list(kind) else kind
        number = pa.types.is_integer(inner) or pa.types.is_floating(inner) or pa.types.is_decimal(inner)
        if not (number or pa.types.is_timestamp(inner)):
            raise RecordingError(
                f"{self.path}: column '{name}' holds {str(kind)[:80]}, wanted numbers in SI units (time in seconds); "
                "convert the column and write the file again"
            )


def is_list(kind: Any) -> bool:
    """Whether a column's cells are lists."""
    import pyarrow as pa

    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def fields_of(path: Path, schema: Any, first: Mapping[str, Any], owners: Mapping[str, Sequence[str]]) -> Fields:
    """The columns of a table.

    Args:
        path: The file.
        schema: Arrow's.
        first: The first cell of columns of lists.
        owners: Joints of the entries of some columns.

    Raises:
        RecordingError: They are more than a recording has.
    """
    spread: dict[str, tuple[str, int | None]] = {}
    said: dict[str, str] = {}
    for one in schema:
        width = len(first.get(one.name) or ()) if is_list(one.type) else 0
        refuse_too_many(len(spread) + width, str(path))
        if not width:
            spread[one.name] = (one.name, None)
            continue
        names = entry_names(one.name, width)
        spread |= {name: (one.name, k) for k, name in enumerate(names)}
        if len(owners.get(one.name, ())) == width:
            said |= dict(zip(names, owners[one.name], strict=True))
    return Fields(path, {one.name: one.type for one in schema}, spread, said)


def _flat(column: Any) -> np.ndarray[Any, Any]:
    import pyarrow as pa

    if pa.types.is_timestamp(column.type):
        return np.asarray(
            column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64()).to_numpy(zero_copy_only=False)
        )
    if pa.types.is_int64(column.type) and not column.null_count:
        return np.asarray(column.to_numpy(zero_copy_only=False))
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False))


def _matrix(column: Any, width: int) -> np.ndarray[Any, Any]:
    """Lists as rows, nan for those of another length."""
    import pyarrow as pa
    from pyarrow import compute as pc

    lengths = pc.fill_null(pc.list_value_length(column), -1).to_numpy(zero_copy_only=False)
    fit = lengths == width
    values = pc.list_flatten(column.filter(pa.array(fit))).cast(pa.float64(), safe=False)
    found = np.full((len(lengths), width), np.nan)
    found[fit] = values.to_numpy(zero_copy_only=False).reshape(-1, width)
    return found

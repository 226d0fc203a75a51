"""Feather and Arrow files, one column a channel or lists of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from casysid.archives import Unpackable, check_ratio
from casysid.errors import RecordingError
from casysid.readers.arrow import Fields, fields_of, is_list
from casysid.readers.batches import Batch, from_row
from casysid.readers.candidates import Labels
from casysid.recording.source import BATCH


@dataclass(frozen=True)
class FeatherTable:
    """Columns of a file in Arrow's format, for random access or as a stream.

    Attributes:
        path: The file.
        fields: Its columns.
    """

    path: Path
    fields: Fields

    @property
    def names(self) -> tuple[str, ...]:
        """Column names, lists spread out."""
        return self.fields.names

    @property
    def labels(self) -> Labels:
        """See :class:`~casysid.readers.table.Table`."""
        return Labels(owners=self.fields.owners)

    @property
    def nameless(self) -> str:
        """See :class:`~casysid.readers.table.Table`."""
        return ""

    @property
    def seekable(self) -> bool:
        """See :class:`~casysid.readers.table.Table`."""
        return False

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[Batch]:
        """The named columns batch by batch; see :class:`~casysid.readers.table.Table`."""
        sources = self.fields.sources(names)
        with _batches(self.path) as (_, batches):
            yield from from_row((self._numbers(part, names, sources) for part in _cut(batches, self.path)), first)

    def _numbers(self, batch: Any, names: Sequence[str], sources: Sequence[str]) -> Batch:
        return self.fields.numbers(batch.select(list(sources)), names)

    def place(self, row: int) -> str:
        """Row, counted from 1."""
        return f"row {row + 1} (the first is row 1)"


def open_feather(path: Path) -> FeatherTable:
    """The columns of a Feather or Arrow file.

    Raises:
        RecordingError: If it is neither, or damaged.
    """
    with _batches(path) as (schema, batches):
        lists = [one.name for one in schema if is_list(one.type)]
        first = next((part for part in batches if part.num_rows), None) if lists else None
        cells = {} if first is None else {name: first.column(name)[0].as_py() for name in lists}
        return FeatherTable(path, fields_of(path, schema, cells, {}))


@contextmanager
def _batches(path: Path) -> Iterator[tuple[Any, Iterator[Any]]]:
    """Schema and record batches.

    Raises:
        RecordingError: The file is damaged.
    """
    import pyarrow as pa
    from pyarrow import ipc

    with ExitStack() as opened:
        try:
            source = opened.enter_context(pa.memory_map(str(path)))
            if source.read(6) == b"ARROW1":
                file = opened.enter_context(ipc.open_file(source))
                yield file.schema, (file.get_batch(k) for k in range(file.num_record_batches))
            else:
                source.seek(0)
                stream = opened.enter_context(ipc.open_stream(source))
                yield stream.schema, iter(stream)
        except Unpackable as error:
            raise RecordingError(f"{path}: {error}") from error
        except (pa.ArrowException, OSError, KeyError, ValueError, UnicodeDecodeError) as error:
            if isinstance(error, RecordingError):
                raise
            raise RecordingError(
                f"{path}: not a Feather or Arrow file, or damaged ({str(error)[:200]}); copy or record it again"
            ) from error


def _cut(batches: Iterator[Any], path: Path) -> Iterator[Any]:
    """Parts of the batches, none larger than is kept in memory."""
    packed, unpacked = path.stat().st_size, 0
    for batch in batches:
        batch.validate()
        unpacked += batch.nbytes
        check_ratio(packed, unpacked)
        for first in range(0, batch.num_rows, BATCH):
            yield batch.slice(first, BATCH)

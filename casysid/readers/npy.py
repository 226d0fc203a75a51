"""An array in a zip archive, read some rows at a time, compressed or not."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import IO, Any

import numpy as np

from casysid.archives import Unpackable
from casysid.arrays import Array


@dataclass
class Member:
    """An array of one or two dimensions, open at some row.

    Attributes:
        name: Of the array.
        streams: One that gives row after row; one for each column where the columns lie one after the other.
        kind: Of its numbers.
        rows: How many.
        width: Numbers in a row; None when rows are numbers.
        row: The next one.
    """

    name: str
    streams: list[IO[bytes]]
    kind: np.dtype[Any]
    rows: int
    width: int | None
    row: int = 0

    def read(self, rows: int) -> Array:
        """The next rows, fewer at the end, as float64.

        Raises:
            Unpackable: If the array is damaged.
        """
        rows = min(rows, self.rows - self.row)
        self.row += rows
        if self.width is None or len(self.streams) == 1:
            values = self._numbers(self.streams[0], rows * (self.width or 1))
            return values if self.width is None else values.reshape(-1, self.width)
        return np.stack([self._numbers(stream, rows) for stream in self.streams], axis=1)

    def _numbers(self, stream: IO[bytes], count: int) -> Array:
        try:
            contents = stream.read(count * self.kind.itemsize)
        except Exception as error:  # whatever the bytes of a stranger make a decoder raise means damage
            raise Unpackable(f"array '{self.name}': {type(error).__name__}: {error}") from error
        if len(contents) < count * self.kind.itemsize:
            raise Unpackable(f"array '{self.name}' ends before its last row")
        return np.frombuffer(contents, dtype=self.kind).astype(np.float64, copy=False)

    def skip(self, rows: int) -> None:
        """Leave out the next rows."""
        self.row += rows
        size = rows * self.kind.itemsize * ((self.width or 1) if len(self.streams) == 1 else 1)
        for stream in self.streams:
            stream.seek(size, 1)


@contextmanager
def open_member(archive: zipfile.ZipFile, key: str) -> Iterator[Member]:
    """The array of that name, at its first row; its header is known to be sound."""
    with ExitStack() as opened:
        stream = opened.enter_context(archive.open(f"{key}.npy"))
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, columns_first, kind = read(stream)
        width = shape[1] if len(shape) == 2 else None
        streams = [stream]
        for column in range(1, width or 1) if columns_first else ():
            other = opened.enter_context(archive.open(f"{key}.npy"))
            other.seek(stream.tell() + column * shape[0] * kind.itemsize)
            streams.append(other)
        yield Member(key, streams, kind, shape[0], width)

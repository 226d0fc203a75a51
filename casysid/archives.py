"""Packed files from strangers: what they claim to hold is set against their size before and while it is unpacked."""

from __future__ import annotations

import gzip
import io
import math
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

LARGEST_RATIO = 200.0
"""Unpacked over packed size: deflate reaches 1032, real logs 2 to 5 and one of held samples 18 (measured)."""
UNQUESTIONED = 1 << 28
"""Bytes that are unpacked whatever the ratio: a recording of constants is no attack, and 256 MB fit anywhere."""


class Unpackable(ValueError):
    """A packed file is damaged, or would unpack to more than it can honestly hold; the message has no path."""


@dataclass(frozen=True)
class ArrayHeader:
    """What an array of an NPZ archive says about itself.

    Attributes:
        shape: Its lengths.
        dtype: Type of its entries.
        packed: Bytes in the archive.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    packed: int

    @property
    def size(self) -> int:
        """Bytes in memory."""
        return math.prod(self.shape) * self.dtype.itemsize


def check_ratio(packed: int, unpacked: int) -> None:
    """Nothing, if ``packed`` bytes can honestly hold ``unpacked`` bytes.

    Raises:
        Unpackable: They cannot.
    """
    if unpacked > UNQUESTIONED and unpacked > LARGEST_RATIO * max(packed, 1):
        raise Unpackable(
            f"{packed} bytes would unpack to {unpacked} and more, over {LARGEST_RATIO:g} times as much, which no "
            "recording of a moving robot does; write it again without what repeats"
        )


def array_headers(path: str | Path) -> dict[str, ArrayHeader]:
    """The arrays of an NPZ archive by name, from their headers alone; each is as large as its shape says.

    Raises:
        Unpackable: The file is no such archive, is damaged, or an array is not what its header says.
        OSError: The file cannot be opened.
    """
    headers: dict[str, ArrayHeader] = {}
    with open(path, "rb") as stream:
        for member, name in _members(stream):
            if name in headers:
                raise Unpackable(f"array '{name}' is there twice; keep one")
            headers[name] = _read_header(stream, member, name)
    return headers


def read_arrays(path: str | Path, names: Iterable[str]) -> dict[str, np.ndarray[Any, Any]]:
    """Some arrays of an NPZ archive, none of them of Python objects.

    Raises:
        Unpackable: An array is missing, damaged, or larger than what its bytes can honestly hold.
        OSError: The file cannot be opened.
    """
    headers, wanted = array_headers(path), list(names)
    missing = [name for name in wanted if name not in headers]
    if missing:
        raise Unpackable(f"there is no array '{missing[0]}'")
    check_ratio(sum(headers[name].packed for name in wanted), sum(headers[name].size for name in wanted))
    arrays = {}
    with open(path, "rb") as stream:
        for name in wanted:
            arrays[name] = _read_array(stream, name)
    return arrays


def _members(stream: io.BufferedReader) -> list[tuple[zipfile.ZipInfo, str]]:
    try:
        with zipfile.ZipFile(stream) as archive:
            entries = archive.infolist()
    except Exception as error:  # whatever the bytes of a stranger make a decoder raise means damage
        raise Unpackable(_reason(error)) from error
    return [(entry, entry.filename.removesuffix(".npy")) for entry in entries if entry.filename.endswith(".npy")]


def _read_header(stream: io.BufferedReader, member: zipfile.ZipInfo, name: str) -> ArrayHeader:
    try:
        with zipfile.ZipFile(stream) as archive, archive.open(member) as content:
            version = np.lib.format.read_magic(content)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, dtype = read(content)
            held = member.file_size - content.tell()
    except Exception as error:  # as above
        raise Unpackable(f"array '{name}': {_reason(error)}") from error
    header = ArrayHeader(shape, dtype, member.compress_size)
    if not dtype.hasobject and (min(shape, default=0) < 0 or header.size != held):
        raise Unpackable(f"array '{name}' says it has shape {shape} of {dtype}, but holds {held} bytes")
    return header


def _read_array(stream: io.BufferedReader, name: str) -> np.ndarray[Any, Any]:
    try:
        with zipfile.ZipFile(stream) as archive, archive.open(f"{name}.npy") as content:
            return np.asarray(np.lib.format.read_array(content, allow_pickle=False))
    except Exception as error:  # as above
        raise Unpackable(f"array '{name}': {_reason(error)}") from error


def _reason(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return "it does not fit into memory"
    return f"{type(error).__name__}: {str(error)[:200]}".rstrip(": ")


class GzipBytes(io.RawIOBase):
    """What a gzip file holds, as a stream of bytes.

    Args:
        path: The file.

    Raises:
        Unpackable: While reading: so far the file has given more than so few bytes can honestly hold.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._packed = path.open("rb")
        self._unpacked = gzip.GzipFile(fileobj=self._packed)
        self._count = 0

    def readable(self) -> bool:
        """Yes."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Fills the buffer as far as there are bytes; returns how many."""
        count = self._unpacked.readinto(buffer)
        self._count += count
        check_ratio(self._packed.tell(), self._count)
        return count

    def close(self) -> None:
        """Closes the file."""
        if not self.closed:
            self._unpacked.close()
            self._packed.close()
        super().close()

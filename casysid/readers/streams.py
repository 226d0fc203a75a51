"""The text of a log file: unpacked, in UTF-8, blanks between columns single, some megabytes at a time."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, TextIO

from casysid.archives import GzipBytes, Unpackable
from casysid.errors import RecordingError

BUFFER = 1 << 20
LOOKED_AT = 1 << 12
"""Bytes at the start that tell the encoding."""
NOT_TEXT = "is not text, though its suffix says so; is it a binary log, or another encoding than UTF-8?"
_BLANKS = re.compile(rb"[ \t]+")
_EDGES = re.compile(rb"(?m)^ | (?=\r?$)")


def is_gzip(path: Path) -> bool:
    """Whether the contents are gzip, whatever the suffix says."""
    with path.open("rb") as stream:
        return stream.read(2) == b"\x1f\x8b"


def open_bytes(path: Path) -> BinaryIO:
    """The bytes of the file, decompressed, as :class:`~casysid.archives.GzipBytes` does if they are gzip."""
    return io.BufferedReader(GzipBytes(path), BUFFER) if is_gzip(path) else path.open("rb")


def encoding_of(path: Path) -> str:
    """UTF-8, UTF-16 as its first bytes tell, or Windows-1252 where those are no UTF-8 and hold no control characters.

    Raises:
        RecordingError: As :func:`readable` says.
    """
    with readable(path), open_bytes(path) as stream:
        start = stream.read(LOOKED_AT)
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if len(start) > 3 and not any(start[1::2]) and b"\0" not in start[::2]:
        return "utf-16-le"
    if len(start) > 3 and not any(start[::2]) and b"\0" not in start[1::2]:
        return "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(start)
    except UnicodeDecodeError:
        if not any(byte < 9 or 13 < byte < 32 for byte in start):
            return "cp1252"
    return "utf-8-sig"


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """What goes wrong within, while the text is read, as one kind of error.

    Raises:
        RecordingError: If the stream is broken off, is not text, or holds more than its bytes honestly can.
    """
    try:
        yield
    except Unpackable as error:
        raise RecordingError(f"{path}: {error}") from error
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise RecordingError(
            f"{path}: the gzip stream is broken or cut off ({error}); copy or record the file again"
        ) from error
    except (UnicodeError, csv.Error) as error:
        raise RecordingError(f"{path}: {NOT_TEXT}") from error


@contextmanager
def open_lines(path: Path, encoding: str) -> Iterator[TextIO]:
    """The text of the file, decompressed.

    Raises:
        RecordingError: As :func:`readable` says.
    """
    with readable(path), io.TextIOWrapper(open_bytes(path), encoding=encoding, newline="") as lines:
        yield lines


def open_plain(path: Path, encoding: str, *, blanks: bool) -> BinaryIO:
    """The bytes of the file in UTF-8.

    Args:
        path: The file.
        encoding: Of its text.
        blanks: Whether columns are apart by any number of blanks and tabs; they are by one then.
    """
    if encoding == "utf-8-sig" and not blanks:
        return open_bytes(path)
    parts = _recoded(path, encoding)
    return io.BufferedReader(_Parts(_squeezed(parts) if blanks else parts), BUFFER)


def _recoded(path: Path, encoding: str) -> Iterator[bytes]:
    with io.TextIOWrapper(open_bytes(path), encoding=encoding, newline="") as lines:
        while part := lines.read(BUFFER):
            yield part.encode("utf-8")


def _squeezed(parts: Iterator[bytes]) -> Iterator[bytes]:
    """Whole lines with one blank between words and none at their ends."""
    rest = b""
    for part in parts:
        text, mark, rest = (rest + part).rpartition(b"\n")
        yield _EDGES.sub(b"", _BLANKS.sub(b" ", text)) + mark
    yield _EDGES.sub(b"", _BLANKS.sub(b" ", rest))


class _Parts(io.RawIOBase):
    """Parts of bytes as a stream."""

    def __init__(self, parts: Iterator[bytes]) -> None:
        super().__init__()
        self._parts, self._rest = parts, b""

    def readable(self) -> bool:
        """Yes."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Fills the buffer as far as there are bytes; returns how many."""
        while not self._rest:
            part = next(self._parts, None)
            if part is None:
                return 0
            self._rest = part
        count = min(len(buffer), len(self._rest))
        buffer[:count], self._rest = self._rest[:count], self._rest[count:]
        return count

    def close(self) -> None:
        """Closes what the parts come from."""
        if not self.closed:
            close = getattr(self._parts, "close", None)
            if close is not None:
                close()
        super().close()

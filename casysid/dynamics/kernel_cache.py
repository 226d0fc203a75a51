"""Compiled kernels on disk, loaded only if they are this user's own and unchanged.

Code from a folder that others can write to is their code. So the folder and the file are opened without following
links, and what was opened is asked for its owner and mode. A library that lost its end kills whoever loads it. So its
SHA-256, taken together with the key under which it is kept, stands behind its last byte, where a loader does not
look. What is loaded is a copy, in a folder that nobody else can enter, of the bytes that were checked.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import secrets
import stat
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from casysid.errors import CasysidWarning

KEPT = 64  # kernels; a robot and its kinds of friction need a handful
_DIGEST = hashlib.sha256().digest_size
_PARTIAL = ".part-"


def cache_folder() -> Path:
    """Where kernels are kept: ``casysid/kernels`` in the user's cache directory."""
    named = os.environ.get("XDG_CACHE_HOME", "")
    if named and not os.path.isabs(named):
        _warn(f"XDG_CACHE_HOME is {named!r}; wanted an absolute path. It is ignored, {Path.home() / '.cache'} is used")
        named = ""
    return (Path(named) if named else Path.home() / ".cache") / "casysid" / "kernels"


def find_library(key: str) -> bytes | None:
    """The library kept under a key; None when there is none that can be trusted, which a warning says.

    Raises:
        OSError: The cache cannot be read.
    """
    place = cache_folder()
    with suppress(FileNotFoundError), _opened(place) as folder:
        if folder is None:
            return None
        content, fault = _read(folder, _name(key))
        library, digest = content[:-_DIGEST], content[-_DIGEST:]
        if not fault and digest != _digest(key, library):
            fault = "is damaged"
        if not fault:
            os.utime(_name(key), dir_fd=folder)
            return library
        os.unlink(_name(key), dir_fd=folder)
        _warn(f"compiled kernels: {place / _name(key)} {fault}; it was removed, the next long recording makes another")
    return None


def keep_library(key: str, library: bytes) -> None:
    """Keep a library under a key, whole or not at all, unless others can write to the folder, which a warning says.

    Raises:
        OSError: The cache cannot be written.
    """
    place = cache_folder()
    place.mkdir(mode=0o700, parents=True, exist_ok=True)
    with _opened(place) as folder:
        if folder is None:
            return
        partial = _PARTIAL + secrets.token_hex(8)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        try:
            with open(os.open(partial, flags, 0o600, dir_fd=folder), "wb") as stream:
                stream.write(library + _digest(key, library))
                stream.flush()
                os.fsync(stream.fileno())
            os.rename(partial, _name(key), src_dir_fd=folder, dst_dir_fd=folder)
        except OSError:
            with suppress(OSError):
                os.unlink(partial, dir_fd=folder)
            raise
        os.fsync(folder)
        _forget_oldest(folder)


def load_library(library: bytes) -> ctypes.CDLL:
    """A library as code, from a copy that nobody else can reach.

    Raises:
        OSError: It cannot be copied, or is no library.
    """
    with tempfile.TemporaryDirectory(prefix="casysid-") as directory:
        copy = Path(directory) / "kernel.so"
        copy.write_bytes(library)
        return ctypes.CDLL(str(copy))


@contextmanager
def _opened(place: Path) -> Iterator[int | None]:
    """The folder's descriptor; None, with a warning, when somebody else could have put something there."""
    folder = os.open(place, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        fault = _fault(os.fstat(folder))
        if fault:
            _warn(
                f"compiled kernels: the folder {place} {fault}; nothing is loaded from it nor kept there. Remove it, "
                "or make it your own with mode 700"
            )
        yield None if fault else folder
    finally:
        os.close(folder)


def _read(folder: int, name: str) -> tuple[bytes, str]:
    """A file's content, or why it is not to be trusted."""
    if stat.S_ISLNK(os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode):
        return b"", "is a symbolic link"
    descriptor = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=folder)
    with open(descriptor, "rb") as stream:
        status = os.fstat(descriptor)
        fault = _fault(status) if stat.S_ISREG(status.st_mode) else "is no ordinary file"
        return (b"", fault) if fault else (stream.read(), "")


def _fault(status: os.stat_result) -> str:
    if status.st_uid != os.geteuid():
        return f"belongs to user {status.st_uid}, not to you"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"can be written by others (mode {stat.S_IMODE(status.st_mode):o})"
    return ""


def _forget_oldest(folder: int) -> None:
    """Keep the kernels that were used last, and what others may still be writing."""
    with os.scandir(folder) as entries:
        kept = [(entry.stat(follow_symlinks=False).st_mtime, entry.name) for entry in entries]
    old = [name for _, name in sorted(kept, reverse=True)][KEPT:]
    for name in old:
        with suppress(OSError):
            os.unlink(name, dir_fd=folder)


def _name(key: str) -> str:
    return f"{key[:32]}.so"


def _digest(key: str, library: bytes) -> bytes:
    return hashlib.sha256(key.encode() + library).digest()


def _warn(text: str) -> None:
    warnings.warn(text, CasysidWarning, stacklevel=3)

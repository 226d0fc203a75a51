"""Files that appear whole or not at all, and stay when the power fails.

A file is written under a name that nobody can guess and that must be new (``O_EXCL``, ``O_NOFOLLOW``: no link is
followed, nothing is overwritten), in the folder where it belongs, given to the disk (``fsync``), and then renamed. Its
writer holds a lock on it as long as it lives. What nobody holds was left behind by a writer that was killed, and is
removed by the next.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from casysid.errors import OutputError

SMALLEST_FILE = 4096
"""Room that any file takes: a block of the usual file systems [bytes]."""
TEMPORARY = re.compile(r"\.casysid-[0-9a-f]{16}(\..*)?")
"""Names of what is being written."""
_NEW = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
_ADVICE = {errno.ENOSPC: "Make room there, or name another place", errno.EDQUOT: "Free some of your quota there"}


@contextmanager
def whole_file(path: str | Path, *, keep_as: str | Path | None = None) -> Iterator[IO[bytes]]:
    """A stream to a temporary file beside ``path``, which replaces ``path`` once the context has ended without error.

    Args:
        path: Where the file belongs.
        keep_as: Put it there instead, on the same file system: it waits there for the other files of a run.

    Raises:
        OutputError: It cannot be written; nothing is left behind, and a file that was there is as it was.
    """
    path, kept = Path(path), Path(keep_as or path)
    with blaming(path):
        require_replaceable(path)
        remove_leftovers(path.parent)
        stream = _create(path.parent, path.suffix)
        descriptor = os.dup(stream.fileno())  # some libraries close what they write to
        try:
            with stream:
                yield stream
            os.fsync(descriptor)
            os.replace(stream.name, kept)
        except BaseException:
            with suppress(OSError):
                os.unlink(stream.name)
            raise
        finally:
            os.close(descriptor)
        sync_folder(kept.parent)


def write_whole(path: str | Path, content: bytes) -> Path:
    """Some bytes as a file, whole or not at all; its path.

    Raises:
        OutputError: It cannot be written.
    """
    with whole_file(path) as stream:
        stream.write(content)
    return Path(path)


def check_output_file(path: str | Path) -> None:
    """Nothing, if a file can be written there; nothing is left there.

    Raises:
        OutputError: It cannot; the message says why.
    """
    path = Path(path)
    with blaming(path):
        require_replaceable(path)
        if path.is_symlink() and not path.exists():
            raise OutputError(
                f"{path}: cannot be written: this symbolic link leads nowhere. Remove it, or name another"
            )
        if not path.parent.is_dir():
            kind = "is a file, not a folder" if path.parent.exists() else "does not exist; make it first"
            raise OutputError(f"{path}: cannot be written: the folder {path.parent} {kind}")
        if len(os.fsencode(path.name)) > os.pathconf(path.parent, "PC_NAME_MAX"):
            raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG))
        probe_room(path.parent, SMALLEST_FILE)


def require_replaceable(path: Path) -> None:
    """Nothing, if there is no file yet, or an ordinary one.

    Raises:
        OutputError: There is something else.
    """
    if path.is_dir():
        raise OutputError(
            f"{path}: cannot be written: there is a folder of this name. Remove it, or name another place"
        )
    if path.exists() and not path.is_file():
        raise OutputError(f"{path}: cannot be written: this is a device or a pipe, not an ordinary file")


def probe_room(folder: Path, room: int) -> None:
    """Nothing, if a file of so many bytes can be made in a folder; it is removed again.

    Raises:
        OSError: It cannot.
    """
    with _create(folder, "") as stream:
        try:
            stream.write(bytes(room))
            stream.flush()
            os.fsync(stream.fileno())
        finally:
            os.unlink(stream.name)


@contextmanager
def blaming(path: Path) -> Iterator[None]:
    """Errors of the operating system become one message that names the path.

    Raises:
        OutputError: There was one.
    """
    try:
        yield
    except OSError as error:
        advice = _ADVICE.get(error.errno or 0, "Name another place")
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}. {advice}") from error


def temporary_name(suffix: str = "") -> str:
    """A name that nobody can guess; :data:`TEMPORARY` knows it."""
    return f".casysid-{secrets.token_hex(8)}{suffix}"


def own_temporaries(folder: Path) -> list[Path]:
    """What is named as something being written and is this user's own; none if the folder cannot be looked into."""
    with suppress(OSError), os.scandir(folder) as entries:
        named = [entry for entry in entries if TEMPORARY.fullmatch(entry.name)]
        return [folder / one.name for one in named if one.stat(follow_symlinks=False).st_uid == os.geteuid()]
    return []


def remove_leftovers(folder: Path) -> None:
    """Remove the files (not the folders) that killed writers left in a folder."""
    for path in own_temporaries(folder):
        with suppress(OSError), opened(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC) as descriptor:
            if path.is_file() and lock(descriptor):
                path.unlink()


@contextmanager
def opened(path: Path, flags: int = _FOLDER) -> Iterator[int]:
    """The descriptor of a folder, or of what else the flags of ``os.open`` ask for."""
    descriptor = os.open(path, flags)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def lock(descriptor: int) -> bool:
    """Whether this process now holds the lock of an open file or folder, until it closes it, or ends in any way.

    False as well where the file system knows no locks.
    """
    with suppress(OSError):
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def sync_folder(folder: Path) -> None:
    """Give the names in a folder to the disk, where the file system can do that."""
    with suppress(OSError), opened(folder) as descriptor:
        os.fsync(descriptor)


def _create(folder: Path, suffix: str) -> IO[bytes]:
    """A new file under a temporary name, with its lock held."""
    while True:
        stream = open(folder / temporary_name(suffix), "w+b", opener=lambda name, _: os.open(name, _NEW, 0o666))
        with suppress(OSError):  # no locks on this file system
            fcntl.flock(stream.fileno(), fcntl.LOCK_EX)
        with suppress(FileNotFoundError):
            os.lstat(stream.name)
            return stream
        stream.close()  # taken for a leftover before it could be locked

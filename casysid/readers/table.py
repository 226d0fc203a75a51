"""A log file as a table: its column names at once, its numbers when asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Protocol

from casysid.errors import RecordingError
from casysid.readers.batches import Batch
from casysid.readers.candidates import Labels
from casysid.readers.messages import refuse_too_many

TEXT_SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz")
PARQUET_SUFFIXES = (".parquet", ".pq")
SUFFIXES = (*TEXT_SUFFIXES, *PARQUET_SUFFIXES, ".npz")
"""Of files that are written, too."""
OTHER_TEXT = (".dat", ".asc", ".log", ".dat.gz", ".log.gz", ".asc.gz")
FEATHER_SUFFIXES = (".feather", ".arrow", ".ipc")
BAG_SUFFIXES = (".bag", ".mcap", ".db3")
READ = (*SUFFIXES, *OTHER_TEXT, *FEATHER_SUFFIXES, ".mat", *BAG_SUFFIXES)


class Table(Protocol):
    """What every format offers."""

    @property
    def names(self) -> tuple[str, ...]:
        """Column names in the file's order."""
        ...

    @property
    def labels(self) -> Labels:
        """Units and joints that the file says beside the names."""
        ...

    @property
    def nameless(self) -> str:
        """What to say when the file does not name its columns and nobody else does; empty if it does."""
        ...

    @property
    def seekable(self) -> bool:
        """Whether rows far into the file are found without reading all before them."""
        ...

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[Batch]:
        """The columns as numbers from row ``first`` (counted from 0) on, some ten thousand rows at a time.

        Missing cells are nan. Doubles, and int64 where a file has whole numbers that a double may not hold.

        Raises:
            RecordingError: If they cannot be read as numbers.
        """
        ...

    def place(self, row: int) -> str:
        """Where the row (counted from 0) stands in the file, as a person would look for it."""
        ...


def suffix_of(path: Path) -> str:
    """The suffix in lower case, with the one before ``.gz``."""
    name = path.name.lower()
    inner, _, last = name.rpartition(".")
    return f"{Path(inner).suffix}.gz" if last == "gz" else Path(name).suffix


def holds_logs(path: Path) -> bool:
    """Whether a path is a folder that is not itself a log, as a ROS 2 bag is."""
    return path.is_dir() and not (path / "metadata.yaml").is_file()


def open_table(path: Path) -> Table:
    """The table in a file, by its suffix.

    Raises:
        RecordingError: If there is no such file, or no table in it.
    """
    _refuse_no_file(path)
    if holds_logs(path):
        raise RecordingError(f"{path}: is a directory; name the log files in it")
    if not path.is_file() and not path.is_dir():
        raise RecordingError(f"{path}: is no regular file; copy what it gives to a file and name that")
    if path.stat().st_size == 0:
        raise RecordingError(f"{path}: the file is empty; record again or name another log")
    openers, suffix = _openers(), ".bag" if path.is_dir() else suffix_of(path)
    if suffix in openers:
        try:
            table = openers[suffix](path)
        except PermissionError as error:
            raise RecordingError(f"{path}: may not be read; change its permissions") from error
        refuse_too_many(len(table.names), str(path))
        return table
    raise RecordingError(
        f"{path}: '{suffix or path.name}' is no known kind of log; convert it to one of {', '.join(READ)}"
    )


def _openers() -> dict[str, Callable[[Path], Table]]:
    from casysid.readers.feather import open_feather
    from casysid.readers.matlab import open_mat
    from casysid.readers.npz import open_npz
    from casysid.readers.parquet import open_parquet
    from casysid.readers.rosbag import open_bag
    from casysid.readers.text import open_text

    found: dict[str, Callable[[Path], Table]] = {".npz": open_npz, ".mat": open_mat}
    for suffixes, opener in (
        ((*TEXT_SUFFIXES, *OTHER_TEXT), open_text),
        (PARQUET_SUFFIXES, open_parquet),
        (FEATHER_SUFFIXES, open_feather),
        (BAG_SUFFIXES, open_bag),
    ):
        found |= dict.fromkeys(suffixes, opener)
    return found


def _refuse_no_file(path: Path) -> None:
    try:
        there = path.exists()
    except OSError as error:  # such as a name longer than the file system's
        raise RecordingError(f"{path}: cannot be opened: {error.strerror}") from error
    if not there:
        raise RecordingError(f"{path}: no such file; looked from {Path.cwd()}")

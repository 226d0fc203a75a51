"""The files of a run change all at once: whoever looks, whenever, finds those of one run, whatever was killed before.

Several files cannot be renamed together. Swapping whole folders (``RENAME_EXCHANGE``) can be atomic, but it tears
foreign files out of the folder, fails on mount points and under a parent that is read-only, and leaves a shell that
stands in the folder in the old one. So the folder stays, and what changes at once is one symbolic link that all names
go through for a few milliseconds:

1. All new files are written into ``DIR/.casysid-XXXX/new``, a name that nobody can guess, and given to the disk.
2. ``.casysid-XXXX/old`` gets hard links to the files that are in the folder now; ``.casysid-XXXX/current`` leads to
   ``old``. One by one every name in the folder becomes a link to ``.casysid-XXXX/current/NAME``: the same content.
3. ``current`` is replaced by a link to ``new``. This is the instant at which all files change.
4. One by one every name in the folder becomes an ordinary file again, by a rename out of ``new``: the same content.
   Then ``.casysid-XXXX`` is removed.

A writer that is killed leaves the old run before the third step and the new run after it, in both cases complete. The
next writer carries out the fourth step for it; so does a writer whose disk is full, for ``old``, since these renames
need no room. Names that only one of the runs has are links that lead nowhere while the other one is there: no
such file.

The folder itself is locked (``flock``) while its names change, so writers take turns; a writer's ``.casysid-XXXX`` is
locked as long as the writer lives, so that nobody takes it for a leftover. ``.casysid.json`` lists the run's files with
their SHA-256: when the next run has no file of such a name, the old one goes, unless it was changed since. All else in
the folder is somebody else's and never touched. Where there are no symbolic links, files are replaced one by one, and a
warning says so; where there are no locks, writers do not wait for each other.
"""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from casysid.errors import CasysidWarning, OutputError
from casysid.outputs.files import blaming, lock, opened, probe_room, require_replaceable, temporary_name, write_whole
from casysid.outputs.manifest import MANIFEST, Manifest
from casysid.outputs.switching import CURRENT, NEW, OLD, recover, settle, switch

PATIENCE = 60.0
"""Names change within milliseconds, within seconds on a slow network: who holds the lock so long was stopped [s]."""
_POLL = 0.02
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC


@dataclass(frozen=True)
class Stage:
    """Where the files of a run wait for each other.

    Attributes:
        folder: To write them to.
        home: Where they will be.
    """

    folder: Path
    home: Path

    def within(self, name: str) -> Stage:
        """The same for a folder in it, which is made."""
        (self.folder / name).mkdir(exist_ok=True)
        return Stage(self.folder / name, self.home / name)


def warn(text: str) -> None:
    """The text as a warning."""
    warnings.warn(text, CasysidWarning, stacklevel=2)


def ignore(directory: Path) -> None:
    """Nothing."""


@contextmanager
def run_folder(
    directory: str | Path,
    identity: str = "",
    *,
    claims: Sequence[str] = (),
    joining: bool = False,
    waiting: Callable[[str], None] = warn,
    written: Callable[[Path], None] = ignore,
) -> Iterator[Stage]:
    """A place for the files of a run, which appear in the directory together once the context has ended without error.

    Args:
        directory: Made if it is not there. Files of others in it stay; those of an earlier run go.
        identity: What tells this run from others, such as a digest of its result.
        claims: Names that belong to such a run, whether it has a file for them or not: what is there goes.
        joining: Add to the files of this run that are there already, instead of replacing them.
        waiting: Called with a sentence if another writer is at work in the directory.
        written: Called with the directory once the files have changed; Ctrl-C waits until then.

    Raises:
        OutputError: They cannot be written, or they would join another run. The directory is as it was.
    """
    home = Path(directory)
    with blaming(home), _folder(home, keep=True), _new_stage(home, waiting) as stage:
        with _named_after(home, stage / NEW):
            yield Stage(stage / NEW, home)
        with _uninterrupted(), _locked(home, waiting):
            recover(home)
            _change(stage, identity, claims, joining)
            written(home)


def add_to_run(path: str | Path, content: bytes, identity: str) -> Path:
    """A further file of a run: beside the others if they are in its folder, else on its own; its path.

    Raises:
        OutputError: It cannot be written, or the folder holds a file of this name that belongs to another run.
    """
    path = Path(path)
    if not Manifest.of(path.parent).files:
        return write_whole(path, content)
    with run_folder(path.parent, identity, joining=True) as stage:
        (stage.folder / path.name).write_bytes(content)
    return path


def check_run_folder(directory: str | Path, names: Sequence[str] = (), room: int = 0) -> None:
    """Nothing, if a run's files can be written there; what a killed run left there is put in order.

    Args:
        directory: Need not be there; nothing is left of it then.
        names: Of files that will be written.
        room: What they take at least [bytes].

    Raises:
        OutputError: They cannot; the message says why.
    """
    directory = Path(directory)
    with blaming(directory), _folder(directory, keep=False):
        for name in (*names, MANIFEST):
            require_replaceable(directory / name)
        with opened(directory, _FOLDER) as descriptor:
            if lock(descriptor):
                recover(directory)
        probe_room(directory, max(room, 1))


@contextmanager
def _folder(home: Path, *, keep: bool) -> Iterator[None]:
    """The folder is there, made with its parents if it was not; those are removed at an error, or if not to be kept."""
    if home.is_symlink() and not home.exists():
        raise OutputError(
            f"{home}: cannot be written: this symbolic link leads nowhere. Remove it, or name another place"
        )
    for place in (home, *home.parents):
        if place.exists() and not place.is_dir():
            raise OutputError(f"{home}: cannot be written: {place} is a file, not a folder. Name another place")
    missing = [place for place in (home, *home.parents) if not place.exists()]
    try:
        home.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        keep = False
        raise
    finally:
        for place in missing if not keep else []:
            with suppress(OSError):
                place.rmdir()


@contextmanager
def _new_stage(home: Path, waiting: Callable[[str], None]) -> Iterator[Path]:
    stage = home / temporary_name()
    with _locked(home, waiting):  # nobody takes it for a leftover before it is locked
        recover(home)
        stage.mkdir(mode=0o700)
        descriptor = os.open(stage, _FOLDER)
        lock(descriptor)
    try:
        for name in (NEW, OLD):
            (stage / name).mkdir()
        yield stage
    finally:
        if not os.path.lexists(stage / CURRENT):  # else names still go through it, and the next writer will see to them
            shutil.rmtree(stage, ignore_errors=True)
        os.close(descriptor)


@contextmanager
def _named_after(home: Path, folder: Path) -> Iterator[None]:
    """Errors name the files by where they belong, not by where they wait."""
    try:
        yield
    except OutputError as error:
        raise OutputError(str(error).replace(str(folder), str(home))) from error


def _change(stage: Path, identity: str, claims: Sequence[str], joining: bool) -> None:
    """Let the new files take the places of the old ones, and write down whose they are."""
    home, earlier = stage.parent, Manifest.of(stage.parent)
    own = Manifest.describe(stage / NEW, identity)
    old = {*earlier.unchanged_in(home), *(name for name in claims if os.path.lexists(home / name))}
    gone = set() if joining else old - set(own.files)
    manifest = own.joining(earlier, home) if joining else own
    if manifest.files:
        manifest.write(stage / NEW)
    try:
        switch(stage, sorted(gone))
    finally:
        settle(stage)


@contextmanager
def _locked(home: Path, waiting: Callable[[str], None]) -> Iterator[None]:
    """No other writer changes names in the folder meanwhile."""
    with opened(home, _FOLDER) as descriptor:
        began = time.monotonic()
        told = False
        while _is_taken(descriptor):
            if time.monotonic() - began > PATIENCE:
                raise OutputError(
                    f"{home}: not written: another casysid has been writing there for {PATIENCE:.0f} s and does not "
                    "end. End it, or name another place"
                )
            if not told:
                waiting(f"{home}: another casysid is writing there; waiting for it")
                told = True
            time.sleep(_POLL)
        yield


def _is_taken(descriptor: int) -> bool:
    """Whether another holds the lock; if not, this process does now, where the file system knows locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno == errno.EWOULDBLOCK
    return False


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Ctrl-C waits until the end of the context."""
    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield
        return
    caught: list[tuple[int, FrameType | None]] = []
    signal.signal(signal.SIGINT, lambda number, frame: caught.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
        if caught:
            previous(*caught[0])

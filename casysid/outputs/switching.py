"""One symbolic link that all names go through while files change: see :mod:`~casysid.outputs.run_folder`.

A stage is a folder ``DIR/.casysid-XXXX`` with ``new``, ``old`` and, while names go through it, the link ``current``.
"""

from __future__ import annotations

import errno
import os
import shutil
import warnings
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from casysid.errors import CasysidWarning
from casysid.outputs.files import lock, opened, own_temporaries, remove_leftovers, require_replaceable, sync_folder
from casysid.outputs.manifest import files_in

CURRENT, NEW, OLD = "current", "new", "old"
_UNSUPPORTED = (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EXDEV)


def switch(stage: Path, gone: Sequence[str]) -> None:
    """Put the files in ``new`` in the places of those in the stage's parent, all at once, and let go those ``gone``.

    Raises:
        OSError: It cannot be done; nothing has changed then.
        OutputError: A name belongs to a folder or a device.
    """
    home, names = stage.parent, sorted({*files_in(stage / NEW), *gone})
    for name in names:
        require_replaceable(home / name)
    _sync(stage / NEW)
    try:
        os.symlink(OLD, stage / CURRENT)
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise
        _replace_one_by_one(stage, names)
        return
    for name in names:
        (home / name).parent.mkdir(parents=True, exist_ok=True)
        (stage / OLD / name).parent.mkdir(parents=True, exist_ok=True)
        _keep(home / name, stage / OLD / name)
    stage.chmod(0o700 | home.stat().st_mode & 0o777)
    for name in names:
        os.symlink(_through(stage, name), stage / "link")
        os.replace(stage / "link", home / name)
    _sync(home, files_in(stage / NEW))
    os.symlink(NEW, stage / "next")
    os.replace(stage / "next", stage / CURRENT)  # the instant at which all files change
    sync_folder(stage)


def settle(stage: Path) -> None:
    """Make ordinary files of the names that go through a stage, in whatever state it was left, and remove it.

    Folders in which nothing is left go too.

    Raises:
        OSError: It cannot be done; the names still go through the stage, and it can be tried again.
    """
    home, names = stage.parent, sorted({*files_in(stage / OLD), *files_in(stage / NEW)})
    for name in names:
        if _leads_through(home / name, stage, name):
            _make_ordinary(stage, name)
    _sync(home, names)
    for folder in {(home / name).parent for name in names if not (home / name).exists()} - {home}:
        with suppress(OSError):  # it was never made, or holds something else
            folder.rmdir()
    shutil.rmtree(stage)


def recover(home: Path) -> None:
    """Put in order what killed writers left in a folder, whose lock must be held."""
    remove_leftovers(home)
    for stage in own_temporaries(home):
        with suppress(OSError), opened(stage) as descriptor:
            if lock(descriptor):
                settle(stage)


def _make_ordinary(stage: Path, name: str) -> None:
    """Put the file that a link leads to in the link's place; nothing, if it leads nowhere."""
    source, place, spare = stage / CURRENT / name, stage.parent / name, stage / "spare"
    if not os.path.lexists(source):
        place.unlink()
        return
    with suppress(OSError):  # a second name, so that a reader who is on the way through the stage still arrives
        spare.unlink(missing_ok=True)
        os.link(source, spare, follow_symlinks=False)
        source = spare
    os.replace(source, place)


def _through(stage: Path, name: str) -> str:
    return "/".join([*[".."] * name.count("/"), stage.name, CURRENT, name])


def _leads_through(place: Path, stage: Path, name: str) -> bool:
    return place.is_symlink() and os.readlink(place) == _through(stage, name)


def _keep(place: Path, copy: Path) -> None:
    """The file at a place a second time, without its content a second time where the file system can do that."""
    if place.is_symlink():
        os.symlink(place.parent.absolute() / os.readlink(place), copy)
    elif place.exists():
        try:
            os.link(place, copy)
        except OSError as error:
            if error.errno not in _UNSUPPORTED:
                raise
            shutil.copy2(place, copy)


def _replace_one_by_one(stage: Path, names: Sequence[str]) -> None:
    for name in names:
        place = stage.parent / name
        place.parent.mkdir(parents=True, exist_ok=True)
        if (stage / NEW / name).exists():
            os.replace(stage / NEW / name, place)
        else:
            place.unlink(missing_ok=True)
    warnings.warn(
        f"{stage.parent}: this file system has no symbolic links; the run's files were replaced one after the other",
        CasysidWarning,
        stacklevel=2,
    )


def _sync(folder: Path, names: Sequence[str] | None = None) -> None:
    """Give files, and the folders that hold them, to the disk; by default all files in the folder."""
    for name in names if names is not None else files_in(folder):
        with suppress(FileNotFoundError), (folder / name).open("rb") as stream:
            os.fsync(stream.fileno())
    for parent in {folder, *((folder / name).parent for name in names or files_in(folder))}:
        sync_folder(parent)

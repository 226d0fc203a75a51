"""Single files, whole or not at all."""

import errno
import os
import signal
from pathlib import Path

import pytest

from casysid.errors import OutputError
from casysid.outputs import check_output_file, whole_file, write_whole
from casysid.outputs.files import TEMPORARY


def half(path, error):
    with whole_file(path) as stream:
        stream.write(b"half")
        raise error


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt(), ValueError()])
def test_an_error_leaves_the_old_file(error, tmp_path):
    path = write_whole(tmp_path / "x", b"old")
    with pytest.raises(OutputError if isinstance(error, OSError) else type(error)):
        half(path, error)
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["x"]


def test_a_killed_writer_leaves_the_old_file_and_its_rest_goes_with_the_next(tmp_path):
    path, note = write_whole(tmp_path / "x", b"old"), tmp_path / ".casysid-0123"
    note.write_text("not named as a temporary")
    child = os.fork()
    if child == 0:
        with whole_file(path) as stream:
            stream.write(b"half")
            stream.flush()
            os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    assert path.read_bytes() == b"old"
    assert sum(bool(TEMPORARY.fullmatch(name)) for name in os.listdir(tmp_path)) == 1
    with whole_file(path) as stream:  # what is being written is no leftover
        stream.write(b"new")
        write_whole(tmp_path / "y", b"other")
    assert path.read_bytes() == b"new"
    assert sorted(os.listdir(tmp_path)) == [note.name, "x", "y"]


def test_what_the_library_closed_is_written(tmp_path):
    with whole_file(tmp_path / "x") as stream:
        stream.write(b"closed")
        stream.close()
    assert (tmp_path / "x").read_bytes() == b"closed"


def test_no_link_is_followed(tmp_path):
    precious = write_whole(tmp_path / "precious", b"precious")
    for name in ("x", "x.part"):
        (tmp_path / name).symlink_to(precious)
    write_whole(tmp_path / "x", b"new")
    assert precious.read_bytes() == b"precious"
    assert not (tmp_path / "x").is_symlink()


def test_the_mode_is_that_of_any_new_file(tmp_path):
    before = os.umask(0o027)
    try:
        path = write_whole(tmp_path / "x", b"")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640


UNUSABLE = {
    "a folder": (lambda home: (home / "d").mkdir() or home / "d", "there is a folder of this name"),
    "no folder": (lambda home: home / "none" / "x", "the folder .*none does not exist; make it first"),
    "below a file": (lambda home: (home / "f").write_text("x") and home / "f" / "x", "is a file, not a folder"),
    "a link to nowhere": (lambda home: (home / "l").symlink_to("none") or home / "l", "leads nowhere"),
    "a name too long": (lambda home: home / ("n" * 300), "File name too long"),
    "a device": (lambda home: Path("/dev/null"), "device or a pipe"),
    "proc": (lambda home: Path("/proc/x"), "No such file or directory"),
}


@pytest.mark.parametrize("case", UNUSABLE)
def test_places_that_cannot_be_used_are_known_beforehand(case, tmp_path):
    make, message = UNUSABLE[case]
    place = make(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(OutputError, match=message):
        check_output_file(place)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_check_leaves_everything_as_it_is(tmp_path):
    path = write_whole(tmp_path / "x", b"old")
    check_output_file(path)
    check_output_file(tmp_path / "y")
    assert os.listdir(tmp_path) == ["x"]
    assert path.read_bytes() == b"old"

"""Files of one run, whenever one looks, whatever is killed."""

import errno
import hashlib
import importlib
import json
import os
import shutil
import signal
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from casysid.errors import CasysidWarning, OutputError
from casysid.outputs import add_to_run, check_run_folder, run_folder, switching
from casysid.outputs.files import TEMPORARY

run = importlib.import_module("casysid.outputs.run_folder")
CALLS = ("mkdir", "open", "link", "symlink", "replace", "rename", "unlink", "rmdir", "chmod", "fsync")


@pytest.fixture(autouse=True)
def no_disk(monkeypatch):
    """Disks take their time; what is given to them, and when, one test looks at."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


def put(home, run, names, **options):
    """A run whose files say its name."""
    with run_folder(home, run, **options) as stage:
        for name in names:
            (stage.folder / name).parent.mkdir(exist_ok=True)
            (stage.folder / name).write_text(f"{run} {name}")


def seen(home):
    """What stands in the files that can be read, but for the list of them."""
    found = {path.relative_to(home).as_posix(): path for path in Path(home).rglob("*")}
    return {
        name: path.read_text() for name, path in found.items() if path.is_file() and not name.startswith(".casysid")
    }


def of(run, names):
    return {name: f"{run} {name}" for name in names}


def dies_at(step, work):
    """Whether a child that does the work ended by itself; else it was killed just before its system call ``step``."""
    child = os.fork()
    if child == 0:
        count = 0

        def counted(call):
            def run(*arguments, **options):
                nonlocal count
                count += 1
                if count > step:
                    os.kill(os.getpid(), signal.SIGKILL)
                return call(*arguments, **options)

            return run

        for name in CALLS:
            setattr(os, name, counted(getattr(os, name)))
        try:
            work()
        finally:
            os._exit(0)
    return os.WIFEXITED(os.waitpid(child, 0)[1])


NAMES = {
    "the same names": (["a", "b", "c"], ["a", "b", "c"]),
    "more names": (["a"], ["a", "b", "sub/c"]),
    "fewer names": (["a", "b", "sub/c"], ["a"]),
    "other names": (["a", "sub/b"], ["c", "other/d"]),
    "nothing before": ([], ["a", "b"]),
}


@pytest.mark.parametrize("case", NAMES)
def test_a_kill_before_any_system_call_leaves_one_run(case, tmp_path):
    before, after = NAMES[case]
    step, states = 0, set()
    while True:
        home = tmp_path / str(step)
        home.mkdir()
        (home / "foreign").write_text("stays")
        if before:
            put(home, "old", before)
        finished = dies_at(step, lambda home=home: put(home, "new", after))
        files = seen(home)
        assert files.pop("foreign") == "stays"
        assert files in (of("old", before), of("new", after)), step
        states.add("new" if files == of("new", after) else "old")
        put(home, "next", ["a"])
        assert seen(home) == {**of("next", ["a"]), "foreign": "stays"}, step
        assert sorted(os.listdir(home)) == [".casysid.json", "a", "foreign"], step
        if finished:
            break
        step += 1
    assert step > 20
    assert states == {"old", "new"}


def test_a_kill_while_order_is_made_leaves_one_run_too(tmp_path):
    origin, names = tmp_path / "origin", ["a", "b"]
    put(origin, "old", names)
    step = 0
    while len(list(origin.glob(".casysid-*/current"))) == 0:  # killed while names go through the stage
        shutil.rmtree(origin)
        put(origin, "old", names)
        assert not dies_at(step, lambda: put(origin, "new", names))
        step += 1
    for step in range(100):
        home = tmp_path / str(step)
        shutil.copytree(origin, home, symlinks=True)
        finished = dies_at(step, lambda home=home: check_run_folder(home))
        assert seen(home) in (of("old", names), of("new", names)), step
        check_run_folder(home)
        assert seen(home) == of("old", names)
        assert sorted(os.listdir(home)) == [".casysid.json", "a", "b"]
        if finished:
            break
    assert finished


@pytest.mark.parametrize("call", ["link", "symlink", "replace", "fsync"])
def test_a_disk_that_fills_at_any_call_leaves_the_old_run(call, tmp_path, monkeypatch):
    names, real = ["a", "b", "sub/c"], getattr(os, call)
    put(tmp_path, "old", names)
    messages = set()
    for step in range(100):
        count = 0

        def full(*arguments, step=step, **options):
            nonlocal count
            count += 1
            if count == step + 1 and "spare" not in str(arguments):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return real(*arguments, **options)

        monkeypatch.setattr(os, call, full)
        try:
            put(tmp_path, "new", names)
        except OutputError as error:
            messages.add(str(error))
            monkeypatch.setattr(os, call, real)
            check_run_folder(tmp_path)
        else:
            break
        finally:
            monkeypatch.setattr(os, call, real)
        assert seen(tmp_path) in (of("old", names), of("new", names)), step
        put(tmp_path, "old", names)
        assert not [name for name in os.listdir(tmp_path) if TEMPORARY.fullmatch(name)]
    assert messages
    assert all("cannot be written: No space left on device. Make room there" in text for text in messages)


def fail(home, error):
    with run_folder(home) as stage:
        (stage.folder / "a").write_text("half")
        raise error


def test_an_error_while_files_are_made_leaves_nothing(tmp_path):
    with pytest.raises(OutputError, match="No space left on device"):
        fail(tmp_path / "a" / "b", OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert not (tmp_path / "a").exists()


def test_what_is_changed_or_foreign_stays(tmp_path):
    put(tmp_path, "old", ["a", "b", "sub/c"])
    (tmp_path / "b").write_text("mine")
    (tmp_path / "sub" / "note").write_text("mine too")
    put(tmp_path, "new", ["a"])
    assert seen(tmp_path) == {"a": "new a", "b": "mine", "sub/note": "mine too"}


def test_claimed_names_go_even_if_nobody_wrote_them_down(tmp_path):
    (tmp_path / "model").write_text("of version 0.1.0")
    put(tmp_path, "new", ["a"], claims=["model", "another"])
    assert seen(tmp_path) == of("new", ["a"])


def test_a_list_of_files_that_was_tampered_with_removes_nothing_outside(tmp_path):
    home, outside = tmp_path / "home", tmp_path / "outside"
    outside.write_text("precious")
    put(home, "old", ["a"])
    listed = json.loads((home / ".casysid.json").read_text())
    digest = hashlib.sha256(b"precious").hexdigest()
    listed["files"] |= {"../outside": digest, str(outside): digest}
    (home / ".casysid.json").write_text(json.dumps(listed))
    put(home, "new", ["a"])
    assert outside.read_text() == "precious"


@pytest.mark.parametrize("nonsense", [b"", b"{", b"[1]", b'{"run": 1, "files": [2]}', b"\xff", b"[" * 100_000])
def test_nonsense_instead_of_the_list_is_no_list(nonsense, tmp_path):
    (tmp_path / ".casysid.json").write_bytes(nonsense)
    put(tmp_path, "new", ["a"])
    assert seen(tmp_path) == of("new", ["a"])


def test_links_are_replaced_not_followed(tmp_path):
    precious, home = tmp_path / "precious", tmp_path / "home"
    precious.write_text("precious")
    home.mkdir()
    for name in ("a", "a.part", ".casysid.json"):
        (home / name).symlink_to("../precious")
    put(home, "new", ["a"])
    assert precious.read_text() == "precious"
    assert (home / "a").read_text() == "new a"
    assert not (home / "a").is_symlink()


def test_further_files_join_their_own_run_only(tmp_path):
    put(tmp_path, "one", ["a", "report"])
    add_to_run(tmp_path / "report", b"one again", "one")
    add_to_run(tmp_path / "note", b"of two", "two")
    with pytest.raises(OutputError, match="report: not written: the folder holds another run's files"):
        add_to_run(tmp_path / "report", b"of two", "two")
    assert seen(tmp_path) == {"a": "one a", "report": "one again", "note": "of two"}
    put(tmp_path, "two", ["a"])
    assert seen(tmp_path) == {"a": "two a", "note": "of two"}


def test_a_file_of_no_run_is_an_ordinary_file(tmp_path):
    add_to_run(tmp_path / "report", b"alone", "one")
    assert os.listdir(tmp_path) == ["report"]


def test_writers_take_turns_and_say_that_they_wait(tmp_path):
    inside, told = threading.Event(), []
    with run_folder(tmp_path, "one") as stage:
        (stage.folder / "a").write_text("one a")
        with run._locked(tmp_path, told.append):
            tell = {"waiting": lambda text: (told.append(text), inside.set())}
            other = threading.Thread(target=put, args=(tmp_path, "two", ["a"]), kwargs=tell)
            other.start()
            assert inside.wait(30)
            assert seen(tmp_path) == {}
        other.join()
        assert seen(tmp_path) == of("two", ["a"])
    assert seen(tmp_path) == of("one", ["a"])
    assert told == [f"{tmp_path}: another casysid is writing there; waiting for it"]


def test_all_is_on_the_disk_before_the_instant_and_after_it(tmp_path, monkeypatch):
    put(tmp_path, "old", ["a", "sub/b"])
    events, replace = [], os.replace
    monkeypatch.setattr(os, "fsync", lambda descriptor: events.append(Path(os.readlink(f"/proc/self/fd/{descriptor}"))))
    monkeypatch.setattr(os, "replace", lambda *paths: events.append(Path(paths[1]).name) or replace(*paths))
    put(tmp_path, "new", ["a", "sub/b"])
    instant = events.index("current")
    for name in ("a", "sub/b", "sub", ""):
        synced = [event for event in events[:instant] if isinstance(event, Path)]
        assert any(event.match(f"*/new/{name}") for event in synced), name
    assert {tmp_path, tmp_path / "sub"} <= set(synced)
    assert {tmp_path, tmp_path / "sub"} <= {event for event in events[instant:] if isinstance(event, Path)}


def test_nobody_waits_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "PATIENCE", 0.0)
    with run._locked(tmp_path, print), pytest.raises(OutputError, match="another casysid has been writing there"):
        put(tmp_path, "two", ["a"], waiting=lambda text: None)
    assert os.listdir(tmp_path) == []


def test_the_files_of_a_writer_at_work_are_no_leftovers(tmp_path):
    with run_folder(tmp_path, "slow") as stage:
        (stage.folder / "a").write_text("slow a")
        put(tmp_path, "quick", ["a"])
        check_run_folder(tmp_path)
        assert seen(tmp_path)["a"] == "quick a"
    assert seen(tmp_path) == of("slow", ["a"])


def test_ctrl_c_waits_until_the_files_have_changed(tmp_path):
    written = []

    def interrupt(home):
        os.kill(os.getpid(), signal.SIGINT)
        written.append(home)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs start with it ignored
    try:
        with pytest.raises(KeyboardInterrupt):
            put(tmp_path, "new", ["a"], written=interrupt)
    finally:
        signal.signal(signal.SIGINT, before)
    assert written == [tmp_path]
    assert seen(tmp_path) == of("new", ["a"])


def test_ctrl_c_before_that_leaves_nothing(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        fail(tmp_path / "out", KeyboardInterrupt())
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("call", ["link", "symlink"])
def test_file_systems_without_links_are_served(call, tmp_path, monkeypatch):
    def refuse(*arguments, **options):
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    put(tmp_path, "old", ["a", "b"])
    monkeypatch.setattr(os, call, refuse)
    if call == "symlink":
        with pytest.warns(CasysidWarning, match="no symbolic links; the run's files were replaced one after the other"):
            put(tmp_path, "new", ["a", "sub/c"])
    else:
        put(tmp_path, "new", ["a", "sub/c"])
    assert seen(tmp_path) == of("new", ["a", "sub/c"])
    assert not [name for name in os.listdir(tmp_path) if TEMPORARY.fullmatch(name)]


def long_name(home):
    return home / ("n" * 300)


UNUSABLE = {
    "a file": (lambda home: (home / "f").write_text("x") and home / "f", "f is a file, not a folder"),
    "below a file": (lambda home: (home / "f").write_text("x") and home / "f" / "x" / "y", "f is a file, not a folder"),
    "a link to nowhere": (lambda home: (home / "l").symlink_to("none") or home / "l", "leads nowhere"),
    "a name too long": (long_name, "File name too long"),
    "proc": (lambda home: Path("/proc/x"), "No such file or directory"),
    "a folder where a file belongs": (lambda home: (home / "a").mkdir() or home, "a: .*there is a folder"),
    "a pipe where a file belongs": (lambda home: os.mkfifo(home / "a") or home, "a: .*this is a device or a pipe"),
}  # fmt: skip


@pytest.mark.parametrize("case", UNUSABLE)
def test_places_that_cannot_be_used_are_known_beforehand(case, tmp_path):
    make, message = UNUSABLE[case]
    place = make(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(OutputError, match=message):
        check_run_folder(place, ["a"])
    assert sorted(tmp_path.rglob("*")) == before


def test_a_check_leaves_nothing(tmp_path):
    check_run_folder(tmp_path / "not" / "there", ["a"], 1000)
    assert os.listdir(tmp_path) == []


@given(
    runs=st.lists(st.frozensets(st.sampled_from(["a", "b", "c/d", "c/e", "f/g"]), min_size=1), max_size=4),
    foreign=st.frozensets(st.sampled_from(["x", "c/x", "y/z"])),
)
def test_after_any_runs_the_folder_holds_the_last_one_and_what_is_foreign(tmp_path_factory, runs, foreign):
    home = tmp_path_factory.mktemp("runs")
    for name in foreign:
        (home / name).parent.mkdir(exist_ok=True)
        (home / name).write_text("foreign")
    for k, names in enumerate(runs):
        put(home, str(k), names)
    wanted = of(str(len(runs) - 1), runs[-1]) if runs else {}
    assert seen(home) == {**dict.fromkeys(foreign, "foreign"), **wanted}
    assert not list(home.rglob(".casysid-*"))
    assert all(any(path.iterdir()) for path in home.rglob("*") if path.is_dir())


def test_the_stage_is_named_as_a_temporary(tmp_path):
    with run_folder(tmp_path) as stage:
        assert TEMPORARY.fullmatch(stage.folder.parent.name)
        assert switching.NEW == stage.folder.name

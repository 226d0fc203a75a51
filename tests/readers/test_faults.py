"""Every broken input is refused, and the message says what, where and what to do."""

import gzip
import os
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from casysid.errors import RecordingError
from casysid.recording import open_recording, read_recording, read_recordings
from casysid.robot import Robot

Columns = dict[str, np.ndarray]
Maker = Callable[[Path, Columns], None]


def text(columns: Columns) -> list[str]:
    rows = zip(*columns.values(), strict=True)
    return [",".join(columns), *(",".join(str(cell) for cell in row) for row in rows)]


def lines(edit: Callable[[list[str]], list[str]]) -> Maker:
    """A file of the log's lines after an edit."""
    return lambda path, columns: path.write_text("\n".join(edit(text(columns))) + "\n") and None


def changed(edit: Callable[[Columns], object]) -> Maker:
    """A file of the columns after an edit in place; what the edit returns is ignored."""

    def make(path: Path, columns: Columns) -> None:
        edit(columns)
        path.write_text("\n".join(text(columns)) + "\n")

    return make


def raw(contents: bytes) -> Maker:
    return lambda path, columns: path.write_bytes(contents) and None


def without(columns: Columns, *prefixes: str) -> None:
    for name in [name for name in columns if name.startswith(prefixes)]:
        del columns[name]


def renamed(columns: Columns, names: dict[str, str]) -> None:
    old = dict(columns)
    columns.clear()
    columns.update({names.get(name, name): values for name, values in old.items()})


def numbered(columns: Columns, joints: int = 4, start: int = 1) -> None:
    old = dict(columns)
    columns.clear()
    columns["time"] = old["time"]
    for letter in ("q", "tau"):
        found = [values for name, values in old.items() if name.startswith(f"{letter}_")]
        columns.update({f"{letter}{k + start}": values for k, values in enumerate(found[:joints])})


def put(name: str, row: int, value: float) -> Maker:
    return changed(lambda columns: columns[name].__setitem__(row, value))


def scaled(prefix: str, factor: float) -> Maker:
    return changed(lambda c: c.update({name: factor * x for name, x in c.items() if name.startswith(prefix)}))


def write_npz(path: Path, columns: Columns) -> None:
    np.savez(path, **columns)


def write_parquet(path: Path, columns: Columns) -> None:
    parquet.write_table(pa.table(columns), path)


def cut(write: Maker, share: float) -> Maker:
    """Only the first part of the file's bytes."""

    def make(path: Path, columns: Columns) -> None:
        write(path, columns)
        path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])

    return make


def write_gzip(path: Path, columns: Columns) -> None:
    path.write_bytes(gzip.compress("\n".join(text(columns)).encode()))


def spoil_gzip(path: Path, columns: Columns) -> None:
    contents = bytearray(gzip.compress("\n".join(text(columns)).encode()))
    contents[-8] ^= 0xFF
    path.write_bytes(contents)


def text_column(path: Path, columns: Columns) -> None:
    parquet.write_table(pa.table(columns | {"tau_elbow": ["a"] * 400}), path)


def stamps(path: Path, columns: Columns) -> None:
    moments = pa.array((columns["time"] * 1e9).astype(np.int64)).cast(pa.timestamp("ns"))
    parquet.write_table(pa.table(columns | {"time": moments}), path)


def matrices(path: Path, columns: Columns, **edits: np.ndarray) -> None:
    stacked = {
        letter: np.column_stack([columns[n] for n in columns if n.startswith(f"{letter}_")]) for letter in ("q", "tau")
    }
    np.savez(path, **({"time": columns["time"]} | stacked | edits))


FAULTS: dict[str, tuple[str, Maker, str]] = {
    # the file
    "no such file": ("log.csv", lambda path, columns: None, "no such file"),
    "a directory": ("log.csv", lambda path, columns: path.mkdir(), "is a directory; name the log files"),
    "an unknown suffix": ("log.xls", raw(b"XL"), r"'\.xls' is no known kind of log; convert it to one of \.csv"),
    "gzip of nothing known": ("log.gz", raw(b"\x1f\x8b"), r"'\.gz' is no known kind"),
    "an empty file": ("log.csv", raw(b""), "the file is empty"),
    "an empty parquet file": ("log.parquet", raw(b""), "the file is empty"),
    "blank lines only": ("log.csv", raw(b"\n\n# remark\n\n"), "no header line"),
    "a header only": ("log.csv", lines(lambda rows: rows[:1]), "a header but no rows"),
    "numbers only": ("log.csv", lines(lambda rows: rows[1:]), "line 1 should name the columns, but holds numbers"),
    "binary garbage": ("log.csv", raw(bytes(range(256)) * 20), "is not text"),
    "binary zeros": ("log.csv", raw(bytes(5000)), "is not text"),
    "one endless line": ("log.csv", raw(b"a" * (1 << 21)), "is not text"),
    "utf-32": ("log.csv", raw("time,q1\n".encode("utf-32")), "is not text.*another encoding than UTF-8"),
    "gzip cut in its header": ("log.csv.gz", cut(write_gzip, 0.001), "gzip stream is broken or cut off"),
    "gzip cut half-way": ("log.csv.gz", cut(write_gzip, 0.5), "gzip stream is broken or cut off"),
    "gzip cut at its end": ("log.csv.gz", cut(write_gzip, 0.9999), "gzip stream is broken or cut off"),
    "gzip with a wrong checksum": ("log.csv.gz", spoil_gzip, "gzip stream is broken or cut off"),
    "parquet cut off": ("log.parquet", cut(write_parquet, 0.7), "not a Parquet file, or cut off"),
    "parquet of garbage": ("log.parquet", raw(b"PAR1" + bytes(100)), "not a Parquet file, or cut off"),
    "npz cut off": ("log.npz", cut(write_npz, 0.7), "not an NPZ file, or cut off"),
    "npz of garbage": ("log.npz", raw(b"PK\x03\x04" + bytes(100)), "not an NPZ file, or cut off"),
    # the rows
    "a short row": (
        "log.csv",
        lines(lambda rows: [*rows[:5], rows[5][:-30], *rows[6:]]),
        "line 6 has 1[0-9] cells where the header",
    ),
    "a long row": (
        "log.csv",
        lines(lambda rows: [*rows[:5], rows[5] + ",1", *rows[6:]]),
        "line 6 has 18 cells where .* 17",
    ),
    "writing cut off": (
        "log.csv",
        lines(lambda rows: [*rows[:-1], rows[-1][:20]]),
        "line 401 has .*writing was cut off: delete",
    ),
    "a comment between rows": (
        "log.csv",
        lines(lambda rows: [*rows[:9], "# stop", *rows[9:]]),
        "line 10 has 1 cells.*# stop",
    ),
    "a word for a number": (
        "log.csv",
        lines(lambda rows: [*rows[:7], re.sub(",[^,]*$", ",off", rows[7]), *rows[8:]]),
        "column 'tau_slide' holds 'off' in line 8: no number",
    ),
    "text in parquet": ("log.parquet", text_column, "column 'tau_elbow' holds string, wanted numbers"),
    "text in npz": (
        "log.npz",
        lambda p, c: write_npz(p, c | {"tau_elbow": np.array(["a"] * 400)}),
        "'tau_elbow' cannot be read",
    ),
    "objects in npz": (
        "log.npz",
        lambda p, c: write_npz(p, c | {"time": np.array([{}] * 400)}),
        "'time' cannot be read as numbers",
    ),
    "arrays of two lengths": (
        "log.npz",
        lambda p, c: write_npz(p, c | {"time": c["time"][:-1]}),
        "equally long; got time 399",
    ),
    "a transposed matrix": (
        "log.npz",
        lambda p, c: matrices(p, c, q=np.zeros((4, 400))),
        "rows are samples, so transpose it",
    ),
    "too few samples": ("log.csv", lines(lambda rows: rows[:12]), "11 rows are too few.*at least 20"),
    "NaN in parquet": (
        "log.parquet",
        lambda p, c: write_parquet(p, c | {"q_elbow": np.where(c["time"] < 1, c["time"], np.nan)}),
        r"'q_elbow' in 300 rows; .* in row 101 \(the first is row 1\)",
    ),
    # the columns
    "no positions": (
        "log.csv",
        changed(lambda c: without(c, "q_")),
        r"no column q_shoulder, q_elbow, .*Found: time, v_shoulder",
    ),
    "no torques": ("log.csv", changed(lambda c: without(c, "tau_")), "no column tau_shoulder.*Wanted for torque"),
    "a joint missing": ("log.csv", changed(lambda c: without(c, "q_elbow")), r"no column q_elbow\. .*lock joints"),
    "a joint misspelled": (
        "log.csv",
        changed(lambda c: renamed(c, {"q_elbow": "q_elbwo"})),
        r"no column q_elbow \(did you mean q_elbwo\?\)",
    ),
    "a torque column missing": ("log.csv", changed(lambda c: without(c, "tau_wheel")), "no column tau_wheel"),
    "part of the velocities": ("log.csv", changed(lambda c: without(c, "v_slide")), "no column v_slide.*velocity"),
    "part of the accelerations": (
        "log.csv",
        changed(lambda c: without(c, "a_elbow", "a_slide")),
        "no column a_elbow, a_slide",
    ),
    "a torque named twice": (
        "log.csv",
        lines(
            lambda rows: [
                rows[0].replace("q_elbow,", "q_elbow,tau_elbow,"),
                *(r.replace(",", ",0,", 1) for r in rows[1:]),
            ]
        ),
        "columns named twice: tau_elbow; rename or remove",
    ),
    "too few numbers": (
        "log.csv",
        changed(lambda c: numbered(c, 3)),
        "3 numbered columns of position .q1, q2, q3., but the robot has 4",
    ),
    "a number left out": ("log.csv", changed(lambda c: numbered(c, start=2)), "q2, q3, q4, q5.*run from 1"),
    "names and numbers": (
        "log.csv",
        changed(
            lambda c: renamed(
                c, {f"tau_{n}": f"tau{k + 1}" for k, n in enumerate(("shoulder", "elbow", "wheel", "slide"))}
            )
        ),
        r"some columns are named by joint and some numbered \(q_shoulder, tau1\)",
    ),
    "numbers and names": (
        "log.csv",
        changed(
            lambda c: renamed(c, {f"q_{n}": f"q{k + 1}" for k, n in enumerate(("shoulder", "elbow", "wheel", "slide"))})
        ),
        "some columns are named by joint and some numbered",
    ),
    "positions by name and by number": (
        "log.csv",
        changed(lambda c: c.update({f"q{k + 1}": c["time"] for k in range(4)})),
        r"\(q_shoulder, q1\)",
    ),
    "no time and no velocity": (
        "log.csv",
        changed(lambda c: without(c, "time", "v_")),
        "no column time.*but velocity is missing",
    ),
    "no time under its name": (
        "log.csv",
        changed(lambda c: (renamed(c, {"time": "runtime"}), without(c, "v_", "a_"))),
        r"no column time \[s\] \(did you mean runtime\?\).*velocity and acceleration is missing",
    ),
    # time
    "time backwards": (
        "log.csv",
        changed(lambda c: c.update({"time": c["time"][::-1].copy()})),
        r"'time' runs backwards 399 times, first in line 3 .*3\.99 then 3\.98",
    ),
    "two logs joined": (
        "log.csv",
        changed(lambda c: c.update({"time": np.tile(c["time"][:200], 2)})),
        "runs backwards 1 times, first in line 202 .*separate files",
    ),
    "time at rest": ("log.csv", changed(lambda c: c["time"].fill(1.0)), "repeats the stamp before it in 399 rows"),
    "poses held for seconds": (
        "log.csv",
        changed(lambda c: c.update({"time": np.arange(400.0) * 2, "q_elbow": 2.0 * np.cos(np.arange(400.0))})),
        "time looks like ms, but then shoulder is faster than its limit .*Poses held at rest",
    ),
    "days": ("log.csv", scaled("time", 1 / 86400), "is time in hours or days"),
    # what was measured
    "no motion": ("log.csv", scaled("q_", 0.0), "no position ever changes .*record it moving"),
    "no torque": ("log.csv", scaled("tau_", 0.0), "no torque ever changes .*were the drives on"),
    "degrees beside rad/s": (
        "log.csv",
        scaled("q_", 57.29578),
        "q looks like degrees for shoulder, elbow, wheel: .*times pi/180",
    ),
    "degrees per second": ("log.csv", scaled("v_", 57.29578), "v looks like degrees for shoulder, elbow, wheel"),
    "degrees alone": (
        "log.csv",
        changed(
            lambda c: (without(c, "v_", "a_"), c.update({n: 57.3 * c[n] for n in c if n in ("q_shoulder", "q_elbow")}))
        ),
        r"q looks like degrees: shoulder \(-57\.3 to 57\.3, limits -2\.5 to 2\.5 rad\)",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_broken_input_is_refused_with_a_reason(fault: str, arm: Robot, columns: Columns, tmp_path: Path) -> None:
    name, make, message = FAULTS[fault]
    path = tmp_path / name
    make(path, columns)
    for read in (read_recording, open_recording):
        with pytest.raises(RecordingError, match=message) as caught:
            read(path, arm)
        assert str(caught.value).startswith(f"{path}: ")


def test_a_quaternion_must_have_unit_length(columns: Columns, tmp_path: Path) -> None:
    urdf = tmp_path / "body.urdf"
    inertia = '<inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/>'
    urdf.write_text(f'<robot name="b"><link name="b"><inertial><mass value="2"/>{inertia}</inertial></link></robot>')
    body = Robot.from_urdf(urdf, floating_base=True)
    wave = columns["q_shoulder"]
    log = (
        {"time": columns["time"]}
        | {f"q_{c}": 0.7 + 0.1 * wave for c in body.channels}
        | {f"tau_{d}": wave for d in body.dofs}
    )
    write_parquet(tmp_path / "log.parquet", log)
    with pytest.raises(RecordingError, match=r"quaternion of 'root_joint' \(root_joint_qx, .*wanted 1.*w comes last"):
        read_recording(tmp_path / "log.parquet", body)


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read everything")
def test_a_file_that_may_not_be_read_is_named(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(text(columns)))
    path.chmod(0)
    with pytest.raises(RecordingError, match="may not be read"):
        read_recording(path, arm)


def test_an_archive_member_that_is_no_array_is_left_aside(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    write_npz(path, columns)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("README.txt", "made on Monday")
    assert len(read_recording(path, arm)) == 400


def test_several_files_are_given_as_a_list_and_each_once(arm: Robot, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="put it in a list"):
        read_recordings("log.csv", arm)  # type: ignore[arg-type]
    assert read_recordings([], arm) == ()
    with pytest.raises(RecordingError, match="given 2 times"):
        read_recordings([tmp_path / "log.csv", tmp_path / "." / "log.csv"], arm)

"""Files that were made to harm, or look like it: one message each, and no memory asked for that they claim."""

import gzip
import io
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from casysid import archives
from casysid.archives import Unpackable, array_headers, check_ratio, read_arrays
from casysid.errors import RecordingError
from casysid.readers import streams
from casysid.recording import open_recording, read_recording
from casysid.robot import Robot

Columns = dict[str, np.ndarray]


def text(columns: Columns) -> str:
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(str(cell) for cell in row) for row in rows)]) + "\n"


def npy(shape: tuple[int, ...], kind: str = "<f8", held: bytes = b"") -> bytes:
    """An array's file whose header claims a shape that what follows need not have."""
    stream = io.BytesIO()
    header = {"descr": kind, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)  # type: ignore[arg-type]
    return stream.getvalue() + held


def archive(**members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in members.items():
            packed.writestr(f"{name}.npy", content)
    return stream.getvalue()


def parquet_with_latin_name(columns: Columns) -> bytes:
    stream = io.BytesIO()
    parquet.write_table(pa.table(columns | {"qQQ": columns["time"]}), stream, store_schema=False)
    return stream.getvalue().replace(b"qQQ", b"q\xe9Q")


def saved(columns: Columns) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **columns)
    return stream.getvalue()


CASES: dict[str, tuple[str, Callable[[Columns], bytes], str]] = {
    "a terabyte claimed": (
        "a.npz",
        lambda c: archive(time=npy((10**12,))),
        r"'time' says it has shape .* holds 0 bytes",
    ),
    "a wide matrix": ("a.npz", lambda c: archive(q=npy((0, 10**9))), "1000000000 columns, at most 10000"),
    "a negative shape": ("a.npz", lambda c: archive(q=npy((-1, -1), held=bytes(8))), "says it has shape"),
    "an unfinished header": (
        "a.npz",
        lambda c: archive(q=b"\x93NUMPY\x01\x00\x10\x00{'descr': '<f8',"),
        "not an NPZ file, or cut off",
    ),
    "nothing in an array": ("a.npz", lambda c: archive(q=b""), "not an NPZ file, or cut off"),
    "complex numbers": ("a.npz", lambda c: saved(c | {"q_elbow": c["q_elbow"] + 1j}), "holds complex128, wanted real"),
    "a matrix and its column": (
        "a.npz",
        lambda c: saved(c | {"q": np.zeros((400, 4)), "q2": np.zeros(400)}),
        "both hold q2",
    ),
    "a name in Latin-1": ("a.parquet", parquet_with_latin_name, "the name of a column is not UTF-8"),
    "a cell of a header without end": ("a.csv", lambda c: b"time," + b"x" * 140_000 + b"\n1\n", "quote left open"),
    "a quote left open": ("a.csv", lambda c: b'time,"' + b"x," * 70_000 + b"\n1\n", "quote left open"),
    "a row without end": ("a.csv", lambda c: text(c).encode() + b"1," * (3 << 20), "a row is longer"),
    "a preface without end": ("a.csv", lambda c: b"#\n" * (1 << 20) + text(c).encode(), "no header line"),
    "two columns of one number": (
        "a.csv",
        lambda c: b"time,q1,q01,tau1\n" + b"0,1,2,3\n" * 30,
        "columns 'q01' and 'q1' are both number 1 of position",
    ),
    "a number of 5000 digits": ("a.csv", lambda c: b"time,q" + b"1" * 5000 + b",tau1\n" + b"0,1,2\n" * 30, "no column"),
    "many columns": ("a.csv", lambda c: b"time" + b",a" * 20_000 + b"\n", "20001 columns, at most 10000"),
    "torques beyond any machine": (
        "a.csv",
        lambda c: text(c | {"tau_elbow": np.where(c["time"] > 1.0, 1e308, c["tau_elbow"])}).encode(),
        r"'tau_elbow' is 1e\+308 in line 103 .* beyond 1e\+09.*\(299 rows\)",
    ),
    "positions beyond any speed": (
        "a.npz",
        lambda c: saved(c | {"q_slide": np.where((c["time"] > 0.07) & (c["time"] < 0.1), 1e6, c["q_slide"])}),
        r"'q_slide' leaps from .* to 1e\+06 in 0.01 s before row 9 .*\(2 steps\)",
    ),
    "one stamp beyond any life": (
        "a.npz",
        lambda c: saved(c | {"time": np.where(c["time"] == 3.99, 1e300, c["time"])}),
        r"time spans 1e\+300 s, its largest step before row 400",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_hostile_files_are_refused_with_a_reason(case: str, arm: Robot, columns: Columns, tmp_path: Path) -> None:
    name, make, message = CASES[case]
    (tmp_path / name).write_bytes(make(columns))
    for read in (read_recording, open_recording):
        with pytest.raises(RecordingError, match=message) as caught:
            read(tmp_path / name, arm)
        assert str(caught.value).startswith(f"{tmp_path / name}: ")
        assert len(str(caught.value)) < 2000


def test_a_name_longer_than_the_file_system_allows_is_no_file(arm: Robot) -> None:
    with pytest.raises(RecordingError, match="cannot be opened: File name too long"):
        read_recording(f"{'a' * 300}.csv", arm)


def test_a_pipe_is_not_waited_for(arm: Robot, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(RecordingError, match="no regular file"):
        read_recording(tmp_path / "pipe.csv", arm)


@given(st.integers(0, 1 << 40), st.integers(0, 1 << 50))
def test_honest_sizes_pass_and_others_do_not(packed: int, unpacked: int) -> None:
    if unpacked <= archives.UNQUESTIONED or unpacked <= archives.LARGEST_RATIO * packed:
        check_ratio(packed, unpacked)
    else:
        with pytest.raises(Unpackable, match="would unpack to"):
            check_ratio(packed, unpacked)


@pytest.mark.parametrize("suffix", [".csv.gz", ".npz", ".parquet"])
def test_a_bomb_is_seen_before_it_has_unpacked(
    suffix: str, arm: Robot, columns: Columns, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bombs are small ones; so is what passes unquestioned."""
    monkeypatch.setattr(archives, "UNQUESTIONED", 1 << 16)
    monkeypatch.setattr(streams, "BUFFER", 1 << 13)
    path, still = tmp_path / f"bomb{suffix}", dict.fromkeys(columns, np.zeros(1_000_000))
    if suffix == ".csv.gz":
        row = ",".join("0" for _ in columns) + "\n"
        path.write_bytes(gzip.compress((",".join(columns) + "\n" + row * 200_000).encode()))
    elif suffix == ".npz":
        np.savez_compressed(path, **still)  # type: ignore[arg-type]
    else:
        parquet.write_table(pa.table(still), path)
    with pytest.raises(RecordingError, match=r"would unpack to .* over 200 times as much"):
        read_recording(path, arm)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=4))
def test_arrays_come_out_of_an_archive_as_they_went_in(shapes: list[tuple[int, int]]) -> None:
    import tempfile

    arrays = {f"x{k}": np.random.default_rng(k).normal(size=shape) for k, shape in enumerate(shapes)}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.npz"
        np.savez_compressed(path, **arrays)  # type: ignore[arg-type]
        assert {name: header.shape for name, header in array_headers(path).items()} == dict(
            zip(arrays, shapes, strict=True)
        )
        for name, array in read_arrays(path, arrays).items():
            np.testing.assert_array_equal(array, arrays[name])

"""The same samples in whatever dress they come."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from casysid.readers.columns import match_columns
from casysid.recording import Recording, read_recording
from casysid.robot import Robot

Columns = dict[str, np.ndarray]
NAMES = ("shoulder", "elbow", "wheel", "slide")


def text(columns: Columns, delimiter: str = ",", decimal: str = ".") -> str:
    rows = [delimiter.join(columns)]
    rows += [
        delimiter.join(str(cell).replace(".", decimal) for cell in row) for row in zip(*columns.values(), strict=True)
    ]
    return "\n".join(rows) + "\n"


def assert_holds(recording: Recording, columns: Columns) -> None:
    """All samples are those of the columns, each in its place."""
    assert recording.time is not None
    np.testing.assert_array_equal(recording.time, columns["time"])
    for letter, values in (("q", recording.position), ("tau", recording.torque), ("v", recording.velocity)):
        assert values is not None
        np.testing.assert_array_equal(values, np.column_stack([columns[f"{letter}_{name}"] for name in NAMES]))


def numbered(columns: Columns, start: int = 1, mark: str = "") -> Columns:
    letters = {"q": "q", "v": "dq", "a": "ddq", "tau": "tau"}
    return {"time": columns["time"]} | {
        f"{new}{mark}{k + start}": columns[f"{old}_{name}"]
        for old, new in letters.items()
        for k, name in enumerate(NAMES)
    }


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("log.csv", lambda c: text(c).encode()),
        ("log.CSV", lambda c: text(c).encode()),
        ("log.txt", lambda c: text(c, " ").encode()),
        ("log.tsv", lambda c: text(c, "\t").encode()),
        ("log.csv.gz", lambda c: gzip.compress(text(c).encode())),
        ("plain inside.csv.gz", lambda c: text(c).encode()),
        ("semicolons.csv", lambda c: text(c, ";").encode()),
        ("commas.csv", lambda c: text(c, ";", ",").encode()),
        ("spaces.csv", lambda c: text(c).replace(",", " , ").encode()),
        ("carriage.csv", lambda c: text(c).replace("\n", "\r\n").encode()),
        ("mark.csv", lambda c: text(c).encode("utf-8-sig")),
        ("comments.csv", lambda c: b"# robot: arm\n\n# run 7\n" + text(c).encode() + b"\n\n"),
        ("savetxt.csv", lambda c: b"# " + text(c).encode()),
        ("quotes.csv", lambda c: text({f'"{n}"': x for n, x in c.items()}).encode()),
        ("index.csv", lambda c: text({"": np.arange(400)} | c).encode()),
        ("words.csv", lambda c: text(c | {"mode": np.array(["auto"] * 400)}).encode()),
    ],
)
def test_text_is_read_in_every_common_dress(
    name: str, write: object, arm: Robot, columns: Columns, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_bytes(write(columns))  # type: ignore[operator]
    assert_holds(read_recording(path, arm), columns)


@pytest.mark.parametrize(("start", "mark"), [(1, ""), (0, ""), (1, "_"), (0, "_")])
def test_columns_may_be_numbered_from_one_or_zero(
    start: int, mark: str, arm: Robot, columns: Columns, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(numbered(columns, start, mark)))
    assert_holds(read_recording(path, arm), columns)


def test_named_columns_may_come_in_any_order_with_others_between(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(dict(reversed((columns | {"q_gripper": columns["time"], "tau1": columns["time"]}).items()))))
    recording = read_recording(path, arm)
    assert_holds(recording, columns)
    assert recording.unused_columns == ("tau1", "q_gripper")


def test_matrices_of_an_archive_are_numbered_columns(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    stacked = {
        new: np.column_stack([columns[f"{old}_{n}"] for n in NAMES])
        for old, new in (("q", "q"), ("v", "dq"), ("tau", "tau"))
    }
    np.savez(
        tmp_path / "log.npz", time=columns["time"], rate=100.0, note="a run", frames=np.zeros((2, 2, 2)), **stacked
    )
    assert_holds(read_recording(tmp_path / "log.npz", arm), columns)


@pytest.mark.parametrize(
    ("found", "position", "torque"),
    [
        (("t", "q", "tau"), ("q",), ("tau",)),
        (("time", "position_axle", "effort_axle"), ("position_axle",), ("effort_axle",)),
        (("Time", "pos_1", "torque_1"), ("pos_1",), ("torque_1",)),
        (("timestamp", "q_1", "q1", "tau_0"), ("q1",), ("tau_0",)),
        (("time", "q_axle", "tau_axle", "effort_axle", "a1"), ("q_axle",), ("tau_axle",)),
    ],
)
def test_other_spellings_stand_in_for_the_usual_ones(
    found: tuple[str, ...], position: tuple[str, ...], torque: tuple[str, ...]
) -> None:
    layout = match_columns(found, ("axle",), ("axle",), "log")
    assert (layout.time, layout.position, layout.torque) == (found[0], position, torque)
    assert layout.velocity is layout.acceleration is None


def test_of_two_spellings_the_first_in_the_table_counts() -> None:
    layout = match_columns(("time", "q1", "v1", "dq1", "tau1", "effort1"), ("axle",), ("axle",), "log")
    assert (layout.velocity, layout.torque) == (("dq1",), ("tau1",))


def test_a_joint_named_by_a_number_is_found_by_name() -> None:
    layout = match_columns(("time", "q_2", "q_1", "tau_1", "tau_2"), ("2", "1"), ("2", "1"), "log")
    assert (layout.position, layout.torque) == (("q_2", "q_1"), ("tau_2", "tau_1"))

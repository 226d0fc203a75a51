"""What is doubtful but usable is said in a warning, and a clean log earns none."""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from casysid.errors import CasysidWarning
from casysid.recording import Recording, open_recording, read_recording, read_recordings
from casysid.robot import Robot

Columns = dict[str, np.ndarray]


def read(path: Path, columns: Columns, robot: Robot) -> tuple[Recording, list[str]]:
    """The recording of these columns and the warnings on reading it."""
    parquet.write_table(pa.table(columns), path / "log.parquet")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        recording = read_recording(path / "log.parquet", robot)
        said = len(caught)
        open_recording(path / "log.parquet", robot)
    assert all(issubclass(w.category, CasysidWarning) and w.filename == __file__ for w in caught)
    sentences = [str(w.message).removeprefix(f"{path / 'log.parquet'}: ") for w in caught]
    assert sentences[:said] == sentences[said:]
    return recording, sentences[:said]


def slow(columns: Columns, *names: str) -> None:
    """Without the derivatives, so that a change of q is no contradiction to them."""
    for name in [name for name in columns if name.startswith(("v_", "a_"))]:
        del columns[name]


def jitter(columns: Columns) -> None:
    columns["time"] += 0.003 * (-1.0) ** np.arange(400)
    slow(columns)


def milliseconds_at_5_khz(columns: Columns) -> None:
    columns["time"] = 0.2 * np.arange(400)
    slow(columns)


def still(columns: Columns) -> None:
    for letter in "qva":
        columns[f"{letter}_elbow"] *= 1e-4


def shifted(columns: Columns) -> None:
    columns["q_slide"] += 0.4


def many_turns(columns: Columns) -> None:
    columns["q_wheel"] *= 15.0
    slow(columns)


def leap(columns: Columns) -> None:
    columns["q_elbow"][250:252] += 1.0


def flipped(columns: Columns) -> None:
    columns["v_elbow"] *= -1.0


def swapped(columns: Columns) -> None:
    columns["v_elbow"], columns["v_shoulder"] = columns["v_shoulder"], columns["v_elbow"]


def clipped(columns: Columns) -> None:
    columns["tau_elbow"] = np.clip(60.0 * columns["tau_elbow"], -50.0, 50.0)


def stuck(columns: Columns) -> None:
    columns["tau_elbow"][:] = 3.25


def repeated(columns: Columns) -> None:
    rows = np.random.default_rng(5).choice(np.arange(1, 399), 120, replace=False)
    for name in columns.keys() - {"time"}:
        for row in np.sort(rows):
            columns[name][row] = columns[name][row - 1]


WEAKNESSES: dict[str, tuple[Callable[[Columns], object], str]] = {
    "uneven sampling": (jitter, "sampling is uneven: nine steps in ten last 0.004 to 0.016 s"),
    "slow sampling": (milliseconds_at_5_khz, "only 5 samples a second"),
    "a joint at rest": (still, "never moving (less than 0.005 rad or m): elbow; friction and much of the inertia"),
    "outside the limits": (shifted, "positions outside the model's limits: slide 0.1 to 0.7 (limits -0.5 to 0.5)"),
    "turns or degrees": (many_turns, "wheel (up to 30): many turns in radians, or degrees?"),
    "a leap of two samples": (
        leap,
        "positions jump, faster than ten times the velocity limit: elbow in 2 of 399 steps, first at 2.5 s",
    ),
    "velocity of the wrong sign": (
        flipped,
        "the logged v is not the rate of change of q for elbow (ratio -1, correlation -1)",
    ),
    "velocities in another order": (swapped, "the logged v is not the rate of change of q for shoulder (ratio"),
    "saturation": (clipped, "torque at or beyond the model's effort limit: elbow in "),
    "a torque that is not measured": (stuck, "torque of elbow is the same in every row"),
    "repeated rows": (repeated, "30% of the rows repeat the one before; the log is faster"),
}


@pytest.mark.parametrize("weakness", WEAKNESSES)
def test_doubtful_recordings_are_read_with_a_warning(
    weakness: str, arm: Robot, columns: Columns, tmp_path: Path
) -> None:
    spoil, message = WEAKNESSES[weakness]
    spoil(columns)
    recording, said = read(tmp_path, columns, arm)
    assert len(said) == 1
    assert said[0].startswith(message)
    assert len(recording) == 400


def test_a_clean_log_is_read_in_silence(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    assert read(tmp_path, columns, arm)[1] == []


def test_gaps_are_counted_and_cut_the_recording_into_segments(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    kept = {name: np.concatenate([x[:100], x[150:200], x[280:]]) for name, x in columns.items()}
    recording, said = read(tmp_path, kept, arm)
    assert said == [
        "2 gaps in time, the largest 0.81 s after 1.99 s (the usual step is 0.01 s); "
        "what one parts that is long beside the low-pass is smoothed piece by piece"
    ]
    assert [(s.start, s.stop) for s in recording.segments] == [(0, 100), (100, 150), (150, 270)]
    assert recording.rate == pytest.approx(100.0)


def test_wrapped_angles_are_unwrapped_and_told(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    columns["q_wheel"] = 3.0 * columns["time"]
    columns["v_wheel"] = np.full(400, 3.0)
    columns["a_wheel"] = np.zeros(400)
    straight = columns["q_wheel"]
    recording, said = read(tmp_path, columns | {"q_wheel": (straight + np.pi) % (2 * np.pi) - np.pi}, arm)
    assert said == ["angles jump by a whole turn: wheel (2 times); taken as wrapped and unwrapped"]
    np.testing.assert_allclose(recording.position[:, 2], straight, atol=1e-12)


def test_a_wheel_within_its_speed_may_turn_as_often_as_it_likes(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    columns["time"] *= 5.0
    columns["q_wheel"] = 2.0 * columns["time"]
    slow(columns)
    assert read(tmp_path, columns, arm)[1] == []


def test_unordered_samples_are_not_judged_by_their_order(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    order = np.random.default_rng(2).permutation(400)
    shuffled = {name: x[order] for name, x in columns.items() if name != "time"}
    recording, said = read(tmp_path, shuffled, arm)
    assert said == []
    assert recording.time is None
    assert recording.segments == ()


def test_every_file_of_several_warns_for_itself(arm: Robot, columns: Columns, tmp_path: Path) -> None:
    stuck(columns)
    paths = [tmp_path / "one.parquet", tmp_path / "two.parquet"]
    for path in paths:
        parquet.write_table(pa.table(columns), path)
    with pytest.warns(CasysidWarning) as caught:
        recordings = read_recordings(paths, arm)
    assert [str(w.message).split(":")[0] for w in caught] == [str(path) for path in paths]
    assert [recording.sources for recording in recordings] == [(str(path),) for path in paths]

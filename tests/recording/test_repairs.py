"""Everyday faults of a log are mended with a remark that says what was done; however the rows come in batches."""

import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import CasysidWarning, RecordingError
from casysid.readers.repairs import ROW, Columns, Glitches, Repairs, together
from casysid.recording import Recording, open_recording, read_recording
from casysid.robot import Robot
from casysid.signals.admission import check_recordings

NAMES = ("turn", "lift")
LAWS = settings(max_examples=40, deadline=None)


def make_robot() -> Robot:
    """Two joints that turn, at most 4 rad/s and 50 N m."""
    import pinocchio as pin

    model = pin.Model()
    for k, name in enumerate(NAMES):
        joint = model.addJoint(
            k, pin.JointModelRX(), pin.SE3.Identity(), name, np.array([50.0]), np.array([4.0]),
            np.array([-3.0]), np.array([3.0]),
        )  # fmt: skip
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return Robot.from_pin(model)


def clean(samples: int = 400) -> dict[str, np.ndarray]:
    """A log by the convention at 100 Hz, on an epoch's clock."""
    time = np.arange(samples) / 100.0
    noise = np.random.default_rng(1)
    log = {"time": 1.7e9 + time, "q_turn": np.sin(2.0 * time), "q_lift": np.cos(3.0 * time)}
    return log | {f"tau_{name}": noise.normal(size=samples) for name in NAMES}


def read(log: dict[str, np.ndarray], folder: Path) -> tuple[Recording, list[str]]:
    """The recording, which is the same left in the file, and what was said of it."""
    path = folder / "log.csv"
    rows = zip(*log.values(), strict=True)
    path.write_text("\n".join([",".join(log), *(",".join(repr(float(x)) for x in row) for row in rows)]) + "\n")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        recording = read_recording(path, make_robot())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CasysidWarning)
        opened = open_recording(path, make_robot())
    for rows_of_batch in (7, 1 << 16):
        parts = list(opened.batches(rows_of_batch))
        np.testing.assert_array_equal(np.concatenate([part.position for part in parts]), recording.position)
        np.testing.assert_array_equal(np.concatenate([part.time for part in parts]), recording.time)
    assert opened.row_of(float(recording.time[100])) == 100
    return recording, [str(one.message) for one in caught]


def assert_rows(recording: Recording, log: dict[str, np.ndarray], rows: np.ndarray) -> None:
    np.testing.assert_array_equal(recording.time, log["time"][rows])
    for k, name in enumerate(NAMES):
        np.testing.assert_array_equal(recording.position[:, k], log[f"q_{name}"][rows])
        np.testing.assert_array_equal(recording.torque[:, k], log[f"tau_{name}"][rows])


def test_a_clean_log_is_read_as_it_is(tmp_path: Path) -> None:
    recording, said = read(clean(), tmp_path)
    assert said == []
    assert_rows(recording, clean(), np.arange(400))


def test_rows_that_came_twice_count_once(tmp_path: Path) -> None:
    twice = np.sort(np.concatenate([np.arange(400), [0, 17, 17, 399]]))
    recording, said = read({name: values[twice] for name, values in clean().items()}, tmp_path)
    assert_rows(recording, clean(), np.arange(400))
    assert len(said) == 1
    assert "4 rows repeat the time stamp before (first in line 3 (the header is line 1)" in said[0]


def test_rows_that_came_late_are_put_in_their_place(tmp_path: Path) -> None:
    order = np.arange(400)
    order[[30, 31, 200, 203]] = order[[31, 30, 203, 200]]
    recording, said = read({name: values[order] for name, values in clean().items()}, tmp_path)
    assert_rows(recording, clean(), np.arange(400))
    assert len(said) == 1
    assert "out of order 3 times, first in line 33" in said[0]


def test_a_stamp_that_is_wrong_takes_its_row_with_it(tmp_path: Path) -> None:
    for wrong in (0.0, 1.7e9 + 1.0, 2e9):
        log = clean()
        log["time"][200] = wrong
        recording, said = read(log, tmp_path)
        assert_rows(recording, clean(), np.delete(np.arange(400), 200))
        assert len(said) == 1


def test_a_clock_coarser_than_the_rows_is_shared_out(tmp_path: Path) -> None:
    log = clean()
    log["time"] = np.floor(log["time"] * 20.0) / 20.0  # five rows a stamp
    recording, said = read(log, tmp_path)
    np.testing.assert_allclose(recording.time, clean()["time"], atol=1e-6)
    assert len(said) == 1
    assert "320 of 400 time stamps repeat the one before" in said[0]


def test_holes_are_left_out_and_nothing_is_filled_in(tmp_path: Path) -> None:
    log = clean()
    log["tau_turn"][[3, 4, 5, 90]] = np.nan
    log["q_lift"][200] = np.inf
    log["tau_lift"][300] = 1e12
    recording, said = read(log, tmp_path)
    assert_rows(recording, clean(), np.delete(np.arange(400), [3, 4, 5, 90, 200, 300]))
    assert len(said) == 1
    assert "6 of 400 rows are incomplete or hold impossible numbers and are left out: q_lift 1, tau_turn 4" in said[0]
    assert "first is line 202" in said[0]


def test_mostly_holes_is_refused(tmp_path: Path) -> None:
    log = clean()
    log["tau_turn"][::3] = np.nan
    assert len(read(log, tmp_path)[0]) == 266
    log["tau_turn"][1::3] = np.nan
    with pytest.raises(RecordingError, match="'tau_turn' in 267 rows"):
        read(log, tmp_path)


def test_a_torque_that_was_never_measured_is_named(tmp_path: Path) -> None:
    log = clean()
    log["tau_lift"][:] = np.nan
    recording, said = read(log, tmp_path)
    assert recording.unmeasured == ("lift",)
    assert not recording.torque[:, 1].any()
    assert len(said) == 1
    assert "tau_lift is empty throughout: no torque is measured at lift" in said[0]
    assert "--lock lift=VALUE" in said[0]
    with pytest.raises(RecordingError, match=r"no torque was measured at lift.* --lock lift=VALUE"):
        check_recordings([recording])
    log["tau_turn"][:] = np.nan
    with pytest.raises(RecordingError, match="not finite numbers"):
        read(log, tmp_path)


def test_velocities_with_holes_are_left_aside(tmp_path: Path) -> None:
    log = clean()
    log |= {"v_turn": 2.0 * np.cos(2.0 * (log["time"] - 1.7e9)), "v_lift": np.full(400, np.nan)}
    recording, said = read(log, tmp_path)
    assert recording.velocity is None
    assert len(recording) == 400
    assert len(said) == 1


@pytest.mark.parametrize("held", [2, 10])
def test_held_samples_count_once(held: int, tmp_path: Path) -> None:
    log = {name: np.repeat(values, held) for name, values in clean().items()}
    log["time"] = 1.7e9 + np.arange(400 * held) * 0.01 / held
    recording, said = read(log, tmp_path)
    assert len(recording) == 400
    np.testing.assert_array_equal(recording.position[:, 0], clean()["q_turn"])
    np.testing.assert_allclose(recording.time, clean()["time"], atol=1e-6)
    assert len(said) == 1
    assert f"in runs of {held}" in said[0]


def test_a_robot_that_rests_without_noise_is_not_thinned_out(tmp_path: Path) -> None:
    log = clean()
    for name in log.keys() - {"time"}:
        log[name][100:200] = log[name][100]
    assert len(read(log, tmp_path)[0]) == 400


def test_glitches_of_one_sample_are_left_out(tmp_path: Path) -> None:
    log = clean()
    log["q_turn"][50], log["tau_lift"][300], log["q_lift"][120] = 0.0, -3000.0, 1e7
    recording, said = read(log, tmp_path)
    assert_rows(recording, clean(), np.delete(np.arange(400), [50, 120, 300]))
    assert len(said) == 1
    assert "3 single samples" in said[0]


def test_a_first_row_of_zeros_is_left_out(tmp_path: Path) -> None:
    log = clean()
    for name in log.keys() - {"time"}:
        log[name][0] = 0.0
    recording, said = read(log, tmp_path)
    assert_rows(recording, clean(), np.arange(1, 400))
    assert len(said) == 1
    assert "1 single samples" in said[0]


def test_counts_of_a_clock_are_read_as_what_they_must_be(tmp_path: Path) -> None:
    for scale, unit in ((1e3, "ms"), (1e6, "us"), (1e9, "ns")):
        log = clean()
        log["time"] = np.round((log["time"] - 1.7e9) * scale)
        recording, said = read(log, tmp_path)
        np.testing.assert_allclose(recording.time, clean()["time"] - 1.7e9, atol=1e-6)
        assert len(said) == 1
        assert f"time is taken as {unit}" in said[0]


def test_all_digits_of_a_stamp_are_told(tmp_path: Path) -> None:
    log = clean()
    log["time"][200:] -= 2.5
    with pytest.raises(RecordingError, match=r"\(1700000001\.99 then 1699999999\.5\)"):
        read(log, tmp_path)


@st.composite
def faulty(draw: st.DrawFn) -> Columns:
    """Rows with repeated and late stamps, holes and runs of equal values."""
    rows = draw(st.integers(1, 60))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    time = np.arange(rows) + rng.integers(-2, 3, rows) * (rng.random(rows) < 0.3)
    values = np.round(rng.normal(size=rows))
    values[rng.random(rows) < 0.2] = np.nan
    return {"t": time.astype(float), "q": values, ROW: np.arange(float(rows))}


REPAIRS = st.builds(
    Repairs,
    complete=st.sampled_from([(), ("t", "q")]),
    stray_stamps=st.sampled_from([None, 0.0, 1.0]),
    sort=st.booleans(),
    repeats=st.sampled_from([None, "first"]),
    held=st.integers(1, 4),
    glitches=st.sampled_from([None, Glitches(speed={"q": 0.5}, step=0.5, turns=(), torque={})]),
)


@LAWS
@given(faulty(), REPAIRS, st.lists(st.integers(0, 59), max_size=6))
def test_repairs_do_not_depend_on_the_batches(log: Columns, repairs: Repairs, cuts: list[int]) -> None:
    rows = len(log["t"])
    edges = [0, *sorted(cut for cut in cuts if cut < rows), rows]
    parts = [{k: v[a:b] for k, v in log.items()} for a, b in pairwise(edges)]
    whole = together(list(repairs.apply(iter([log]), "t")) or [log])
    found = together(list(repairs.apply(iter(parts), "t")) or [log])
    for name, values in whole.items():
        np.testing.assert_array_equal(found[name], values)


@LAWS
@given(st.lists(st.integers(1, 4), min_size=2, max_size=20), st.lists(st.integers(0, 80), max_size=5))
def test_shared_time_increases_and_keeps_to_its_stamps(counts: list[int], cuts: list[int]) -> None:
    time = np.repeat(np.arange(float(len(counts))), counts)
    log = {"t": time, ROW: np.arange(float(len(time)))}
    edges = [0, *sorted(cut for cut in cuts if cut < len(time)), len(time)]
    parts = [{k: v[a:b] for k, v in log.items()} for a, b in pairwise(edges)]
    found = together(list(Repairs(repeats="spread", spacing=1.0).apply(iter(parts), "t")))["t"]
    assert (np.diff(found) > 0.0).all()
    np.testing.assert_array_equal(np.floor(found), time)
    steps = np.diff(found)
    np.testing.assert_allclose(steps, np.repeat(1.0 / np.array(counts), counts)[:-1])


def test_a_short_log_that_comes_in_parts_is_one_excerpt(tmp_path, monkeypatch):
    time = np.arange(200) * 0.02
    rows = np.stack([time, 0.8 + 0.1 * np.sin(time), 0.3 * np.cos(time), np.sin(3 * time), np.cos(2 * time)], 1)
    path = tmp_path / "log.csv"
    np.savetxt(path, rows, delimiter=",", header="time,q1,q2,tau1,tau2", comments="", fmt="%.9f")
    recording = open_recording(path, Robot.from_file(find_model("two_link.urdf")))
    (whole,) = recording.batches(200)
    parts = whole.selected(slice(0, 199)), whole.selected(slice(199, None))
    monkeypatch.setattr(type(recording), "batches", lambda *_: iter(parts))
    (one,) = recording.excerpts()
    np.testing.assert_array_equal(one.position, whole.position)

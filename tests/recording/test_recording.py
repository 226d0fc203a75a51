"""Laws of recordings: what is cut can be put together again, and what is written can be read."""

import dataclasses
import math
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from casysid.errors import ParameterError, RecordingError
from casysid.readers.writing import write_columns
from casysid.recording import Recording, read_recording
from casysid.robot import Robot

FIELDS = ("time", "position", "velocity", "acceleration", "torque")
LAWS = settings(max_examples=30, deadline=None)
SUFFIXES = (".csv", ".csv.gz", ".tsv", ".txt", ".parquet", ".pq", ".npz")


@st.composite
def recordings(draw: st.DrawFn, least: int = 2, timed: bool | None = None) -> Recording:
    """Recordings of one to three joints with any finite numbers, with or without time, v and a."""
    samples, dofs = draw(st.integers(least, 60)), draw(st.integers(1, 3))
    names = tuple(f"joint {k}, left" for k in range(dofs))
    has_time = draw(st.booleans()) if timed is None else timed
    finite = st.floats(allow_nan=False, allow_infinity=False)
    values = hnp.arrays(np.float64, (samples, dofs), elements=finite)
    steps = draw(hnp.arrays(np.float64, samples, elements=st.floats(1e-4, 1e-1)))
    return Recording(
        channels=names,
        dofs=names,
        time=draw(st.floats(-100.0, 1e6)) + np.cumsum(steps) if has_time else None,
        position=draw(values),
        velocity=draw(values) if not has_time or draw(st.booleans()) else None,
        acceleration=draw(values) if not has_time or draw(st.booleans()) else None,
        torque=draw(values),
    )


def joined(parts: tuple[Recording, ...]) -> dict[str, np.ndarray | None]:
    return {
        name: None if getattr(parts[0], name) is None else np.concatenate([getattr(part, name) for part in parts])
        for name in FIELDS
    }


def assert_same(found: dict[str, np.ndarray | None], recording: Recording) -> None:
    for name, values in found.items():
        wanted = getattr(recording, name)
        assert (values is None) == (wanted is None), name
        if values is not None:
            np.testing.assert_array_equal(values, wanted, err_msg=name)
            assert not np.any(np.signbit(values) != np.signbit(wanted)), name


def simple(samples: int = 50, step: float = 0.01) -> Recording:
    time = np.arange(samples) * step
    wave = np.sin(3.0 * time)[:, None]
    return Recording(
        channels=("axle",), dofs=("axle",), time=time, position=wave, torque=2.0 * wave, sources=("log.csv",)
    )


@LAWS
@given(recordings(), st.floats(0.01, 0.99))
def test_a_split_keeps_every_sample_once_and_in_order(recording: Recording, fraction: float) -> None:
    try:
        train, test = recording.split(fraction)
    except ParameterError:
        assert fraction * len(recording) < 1.0 or recording.time is not None
        return
    assert_same(joined((train, test)), recording)
    if recording.time is not None and train.time is not None and test.time is not None:
        assert train.time[-1] - recording.time[0] < fraction * recording.duration <= test.time[0] - recording.time[0]


@LAWS
@given(recordings(timed=True), st.floats(0.0, 1.0))
def test_trimming_before_and_from_a_moment_parts_the_recording(recording: Recording, where: float) -> None:
    assert recording.time is not None
    moment = recording.time[1] + where * (recording.time[-1] - recording.time[1])
    before, after = recording.trimmed(stop=moment), recording.trimmed(start=moment)
    assert_same(joined((before, after)), recording)
    assert_same(joined((recording.trimmed(),)), recording)
    assert before.time is not None
    assert before.time[-1] < moment


@LAWS
@given(recordings(), st.integers(1, 5), st.integers(1, 5))
def test_decimating_twice_is_decimating_by_the_product(recording: Recording, first: int, second: int) -> None:
    assert_same(joined((recording.decimated(first).decimated(second),)), recording.decimated(first * second))
    assert_same(joined((recording.decimated(1),)), recording)
    assert len(recording.decimated(first)) == -(-len(recording) // first)


@LAWS
@given(recordings(timed=True))
def test_segments_part_the_samples_at_the_gaps(recording: Recording) -> None:
    assert [k for s in recording.segments for k in range(s.start, s.stop)] == list(range(len(recording)))
    assert recording.time is not None
    steps = np.diff(recording.time)
    cuts = {s.start for s in recording.segments} - {0}
    assert cuts == {k + 1 for k in range(len(steps)) if steps[k] > 5.0 * np.median(steps)}


@LAWS
@given(recordings())
def test_arrays_are_copies_that_cannot_be_changed(recording: Recording) -> None:
    for part in (recording, recording.decimated(2)):
        for name in FIELDS:
            values = getattr(part, name)
            if values is not None:
                with pytest.raises(ValueError, match="read-only"):
                    values[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        recording.time = None  # type: ignore[misc]


def robot_of(names: tuple[str, ...]) -> Robot:
    """Revolute joints in a row, without limits."""
    import pinocchio as pin

    model = pin.Model()
    for k, name in enumerate(names):
        joint = model.addJoint(k, pin.JointModelRX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return Robot.from_pin(model)


@settings(max_examples=25, deadline=None)
@given(recordings(least=20), st.sampled_from(SUFFIXES))
def test_what_is_written_is_read_back_exactly(recording: Recording, suffix: str) -> None:
    wave = np.sin(np.arange(len(recording)))[:, None] * np.ones(len(recording.dofs))
    plausible = dataclasses.replace(
        recording,
        position=np.clip(recording.position, -2.0, 2.0) + 1e-3 * wave,
        velocity=None if recording.velocity is None else 0.0 * wave - np.clip(recording.velocity, -1e9, 1e9),
        acceleration=None if recording.acceleration is None else np.clip(recording.acceleration, -1e9, 1e9),
        torque=np.clip(recording.torque, -1e3, 1e3) + wave,
    )
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = plausible.write(Path(folder) / f"log{suffix}")
        read = read_recording(path, robot_of(recording.dofs))
        assert [file.name for file in Path(folder).iterdir()] == [f"log{suffix}"]
    assert_same(joined((plausible,)), read)
    assert read.channels == recording.channels


@LAWS
@given(hnp.arrays(np.float64, 20, elements=st.floats(allow_nan=False, allow_infinity=False)), st.sampled_from(SUFFIXES))
def test_every_finite_number_survives_writing(values: np.ndarray, suffix: str) -> None:
    from casysid.readers.batches import all_rows
    from casysid.readers.table import open_table

    with tempfile.TemporaryDirectory() as folder:
        path = write_columns(Path(folder) / f"log{suffix}", {"x": values, 'tau_a "b", c': values})
        names = ["x", 'tau_a "b", c']
        read = all_rows(names, open_table(path).batches(names))
    for column in read.values():
        assert column.tobytes() == values.tobytes()


def test_a_file_is_replaced_only_by_a_complete_one(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("the old one")
    with pytest.raises(Exception, match="length"):
        write_columns(path, {"x": np.zeros(3), "y": np.zeros(4)})
    assert path.read_text() == "the old one"
    assert list(tmp_path.iterdir()) == [path]


def test_writing_needs_a_known_suffix_and_a_directory(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"cannot write a recording as '\.mat'; use one of \.csv"):
        simple().write(tmp_path / "log.mat")
    with pytest.raises(RecordingError, match=r"no directory .*make it first"):
        simple().write(tmp_path / "missing" / "log.csv")


def test_rate_and_duration_come_from_the_stamps() -> None:
    recording = simple(samples=101, step=0.02)
    assert recording.rate == pytest.approx(50.0)
    assert recording.duration == pytest.approx(2.0)
    assert recording.decimated(2).rate == pytest.approx(25.0)


def test_unordered_samples_have_no_rate_no_duration_and_no_segments() -> None:
    wave = np.sin(np.arange(30.0))[:, None]
    recording = Recording(channels=("a",), dofs=("a",), position=wave, velocity=wave, acceleration=wave, torque=wave)
    assert math.isnan(recording.rate)
    assert math.isnan(recording.duration)
    assert recording.segments == ()
    assert [len(part) for part in recording.split(0.5)] == [15, 15]
    assert "unordered" in str(recording.summary())
    with pytest.raises(RecordingError, match="cannot be trimmed by time"):
        recording.trimmed(0.0, 1.0)


def test_the_summary_gives_the_figures() -> None:
    recording = dataclasses.replace(simple(), unused_columns=("temperature",))
    summary = recording.summary()
    assert (summary.samples, summary.segments, summary.logged) == (50, 1, ("q", "tau"))
    assert summary.torque_peak["axle"] == pytest.approx(2.0 * max(map(abs, summary.position_range["axle"])))
    assert str(summary).splitlines()[:2] == ["log.csv", "50 samples, 0.49 s at 100 Hz, 1 segment(s); logged: q, tau"]
    assert str(summary).endswith("not used: temperature")


def test_every_value_is_checked_once_at_the_door() -> None:
    wave = np.ones((30, 1))
    time = np.arange(30.0)
    cases = [
        ({"torque": np.ones((30, 2))}, r"torque must have shape \(30, 1\); got \(30, 2\)"),
        ({"time": time[:-1]}, r"time must have shape \(30,\); got \(29,\)"),
        ({"position": np.where(time < 4, 1.0, np.nan)[:, None]}, "position must be finite; got nan in sample 4"),
        ({"time": time[::-1]}, "time must increase"),
        ({"time": None}, "unordered and nothing can be differentiated"),
    ]
    for change, message in cases:
        values = {"time": time, "position": wave, "torque": wave} | change
        with pytest.raises(RecordingError, match=message):
            Recording(channels=("a",), dofs=("a",), **values)  # type: ignore[arg-type]


@pytest.mark.parametrize("fraction", [0.0, 1.0, -0.2, 1.5, math.nan, 1e-9])
def test_a_split_needs_something_on_both_sides(fraction: float) -> None:
    with pytest.raises(ParameterError, match="split: fraction"):
        simple().decimated(2 if fraction > 1e-6 else 50).split(fraction)


@pytest.mark.parametrize("factor", [0, -1, 1.5])
def test_a_decimation_factor_is_a_positive_whole_number(factor: float) -> None:
    with pytest.raises(ParameterError, match="positive whole number"):
        simple().decimated(factor)  # type: ignore[arg-type]


def test_trimming_to_nothing_says_where_the_samples_are() -> None:
    with pytest.raises(
        RecordingError, match=r"no samples from 2\.0 s to 3\.0 s; the recording runs from 0 s to 0\.49 s"
    ):
        simple().trimmed(2.0, 3.0)


@LAWS
@given(recordings())
def test_signs_turned_twice_are_as_before(recording):
    first = recording.dofs[0]
    for columns in (["tau"], [f"tau_{first}"], [f"q_{first}"], [first], ["tau", first]):
        assert_same({name: getattr(recording.flipped(columns).flipped(columns), name) for name in FIELDS}, recording)
    both = recording.flipped([first])
    assert_same({name: getattr(recording.flipped([f"q_{first}", f"tau_{first}"]), name) for name in FIELDS}, both)
    np.testing.assert_array_equal(both.torque[:, 0], -recording.torque[:, 0])
    np.testing.assert_array_equal(both.position[:, 1:], recording.position[:, 1:])
    with pytest.raises(ParameterError, match=r"no column v_nobody to turn; known are tau, tau_joint 0"):
        recording.flipped(["v_nobody"])

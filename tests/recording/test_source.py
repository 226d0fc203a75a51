"""A recording on disk is the recording in memory: the same samples, parts, pieces, figures and messages."""

import dataclasses
import math
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import CasysidWarning, ParameterError, RecordingError
from casysid.readers.writing import write_columns
from casysid.recording import Recording, RecordingFile, Source, open_recording, open_recordings, read_recording
from casysid.recording.pieces import pieces
from casysid.robot import Robot

FIELDS = ("time", "position", "velocity", "acceleration", "torque")
SUFFIXES = (".csv", ".csv.gz", ".tsv", ".parquet", ".npz")
NAMES = ("turn", "lift")
LAWS = settings(max_examples=25, deadline=None)


@pytest.fixture(scope="session")
def robot() -> Robot:
    """Two revolute joints without limits."""
    return make_robot()


def make_robot() -> Robot:
    import pinocchio as pin

    model = pin.Model()
    for k, name in enumerate(NAMES):
        joint = model.addJoint(k, pin.JointModelRX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return Robot.from_pin(model)


@st.composite
def recordings(draw: st.DrawFn, least: int = 30, most: int = 400) -> Recording:
    """Two joints in motion at uneven steps, with holes, with or without velocity and acceleration."""
    samples = draw(st.integers(least, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    steps = 0.01 * rng.uniform(0.7, 1.3, samples)
    for _ in range(draw(st.integers(0, 4))):
        steps[draw(st.integers(1, samples - 1))] = draw(st.floats(0.02, 3.0))
    time = draw(st.sampled_from([0.0, 1e6])) + np.cumsum(steps)
    phase = np.array([2.0, 3.0]) * (time - time[0])[:, None] + rng.uniform(0.0, 6.0, 2)
    logged = draw(st.booleans())
    return Recording(
        channels=NAMES,
        dofs=NAMES,
        time=time,
        position=np.sin(phase),
        velocity=np.array([2.0, 3.0]) * np.cos(phase) if logged else None,
        acceleration=-np.array([4.0, 9.0]) * np.sin(phase) if logged else None,
        torque=rng.normal(size=(samples, 2)),
    )


def on_disk(recording: Recording, folder: str | Path, suffix: str) -> RecordingFile:
    path = recording.write(Path(folder) / f"log{suffix}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return open_recording(path, make_robot())


def samples(source: Source, rows: int = 1 << 16) -> dict[str, np.ndarray | None]:
    parts = list(source.batches(rows))
    assert all(0 < len(part) <= rows for part in parts)
    return {
        name: None if getattr(parts[0], name) is None else np.concatenate([getattr(part, name) for part in parts])
        for name in FIELDS
    }


def assert_same(found: Source, wanted: Source, rows: int = 1 << 16) -> None:
    assert len(found) == len(wanted)
    assert (found.start, found.stop) == (wanted.start, wanted.stop)
    for (name, values), other in zip(samples(found, rows).items(), samples(wanted).values(), strict=True):
        assert (values is None) == (other is None), name
        if values is not None and other is not None:
            np.testing.assert_array_equal(values, other, err_msg=name)


@LAWS
@given(recordings(), st.sampled_from(SUFFIXES), st.integers(1, 90), st.floats(0.05, 0.95), st.floats(0.5, 2.0))
def test_a_file_gives_what_memory_gives(
    recording: Recording, suffix: str, rows: int, fraction: float, scale: float
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = on_disk(recording, folder, suffix)
        assert_same(file, recording, rows)
        assert (file.rate, file.step) == pytest.approx((recording.rate, recording.step))
        for part, other in zip(file.split(fraction), recording.split(fraction), strict=True):
            assert_same(part, other, rows)
            assert_same(part.with_time_scaled(scale), other.with_time_scaled(scale), rows)
        last = file.split(fraction)[1]
        assert_same(last.trimmed(stop=last.stop), recording.split(fraction)[1].trimmed(stop=last.stop), rows)
        turned = ["tau", "q_turn", "lift"]
        assert_same(file.flipped(turned).flipped(["tau_lift"]), recording.flipped(turned).flipped(["tau_lift"]))
        assert file.with_torque_delay(0.1).torque_delay == 0.1
        assert file.logged == recording.logged
        assert_same(file.in_memory(), recording)


@LAWS
@given(recordings(), st.floats(0.02, 2.0), st.floats(0.1, 0.9))
def test_stretches_of_a_file_are_those_in_memory(recording: Recording, gap: float, fraction: float) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = on_disk(recording, folder, ".npz")
        longest = max(gap, 3.0 * recording.step)  # shorter steps are not kept as holes
        for found, wanted in ((file, recording), *zip(file.split(fraction), recording.split(fraction), strict=True)):
            assert found.stretches(longest) == wanted.stretches(longest)
            if wanted is recording:
                assert found.stretches() == wanted.stretches()


@LAWS
@given(recordings(), st.integers(1, 120), st.floats(0.0, 0.6), st.floats(0.05, 1.0), st.integers(1, 7), st.booleans())
def test_pieces_tile_the_recording_and_overlap_enough(
    recording: Recording, rows: int, overlap: float, gap: float, multiple: int, stored: bool
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        source: Source = on_disk(recording, folder, ".parquet") if stored else recording
        gap = max(gap, 3.0 * recording.step)
        assert recording.time is not None
        row, fewest = 0, math.ceil(overlap * source.rate)
        for piece in pieces(source, overlap, rows=rows, gap=gap, multiple=multiple):
            core, stretch, time = piece.core, piece.stretch, piece.recording.time
            assert time is not None
            assert piece.first == row
            own = piece.recording.selected(core)
            row += len(own)
            np.testing.assert_array_equal(own.position, recording.position[piece.first : row])
            assert len(own) % multiple == 0 or row == stretch.rows.stop
            assert (np.diff(time) <= gap).all()
            before, after = core.start, len(time) - core.stop
            assert piece.first - before >= stretch.rows.start
            assert row + after <= stretch.rows.stop
            if piece.first - before > stretch.rows.start:
                assert before >= fewest
                assert time[core.start] - time[0] >= overlap - 1e-9
            if row + after < stretch.rows.stop:
                assert after >= fewest
                assert time[-1] - time[core.stop - 1] >= overlap - 1e-9
        assert row == len(recording)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_excerpts_are_spread_over_a_long_recording(suffix: str, tmp_path: Path) -> None:
    time = np.arange(5000) * 0.01
    wave = np.sin(np.outer(time, [2.0, 3.0]))
    recording = Recording(channels=NAMES, dofs=NAMES, time=time, position=wave, torque=wave)
    file = on_disk(recording, tmp_path, suffix)
    for source in (recording, file):
        parts = source.excerpts(4, 100)
        assert [(part.start, len(part)) for part in parts] == [
            (time[start], 100) for start in np.linspace(0, 4900, 4).astype(int)
        ]
        assert len(source.excerpts(50, 100)) == 1
        assert len(source.excerpts(50, 100)[0]) == 5000


def test_a_file_that_changes_after_the_scan_is_refused(tmp_path: Path, robot: Robot) -> None:
    time = np.arange(50) * 0.01
    wave = np.sin(np.outer(time, [2.0, 3.0]))
    recording = Recording(channels=NAMES, dofs=NAMES, time=time, position=wave, torque=wave)
    file = on_disk(recording, tmp_path, ".csv")
    recording.decimated(2).write(tmp_path / "log.csv")
    with pytest.raises(RecordingError, match="changed while it was in use"):
        next(file.batches())


def test_wrapped_angles_are_unwrapped_in_every_part(tmp_path: Path, robot: Robot) -> None:
    time = np.arange(3000) * 0.01
    straight = np.stack([0.41 * time, np.sin(time)], axis=1)
    wrapped = (straight + np.pi) % (2.0 * np.pi) - np.pi
    logged = Recording(channels=NAMES, dofs=NAMES, time=time, position=wrapped, torque=np.sin(straight))
    with pytest.warns(CasysidWarning, match=r"turn \(2 times\); taken as wrapped and unwrapped"):
        file = open_recording(logged.write(tmp_path / "log.parquet"), robot)
    np.testing.assert_allclose(file.in_memory().position, straight, atol=1e-9)
    late = file.trimmed(21.0, 27.0).in_memory()
    np.testing.assert_allclose(late.position, straight[2100:2700], atol=1e-9)
    assert file.summary().position_range["turn"] == pytest.approx((0.0, straight[-1, 0]))


def test_several_files_are_opened_in_their_order_and_each_once(tmp_path: Path, robot: Robot) -> None:
    time = np.arange(50) * 0.01
    wave = np.sin(np.outer(time, [2.0, 3.0]))
    recording = Recording(channels=NAMES, dofs=NAMES, time=time, position=wave, torque=wave)
    paths = [recording.write(tmp_path / name) for name in ("b.csv", "a.npz")]
    assert [file.label for file in open_recordings(paths, robot)] == [str(path) for path in paths]
    with pytest.raises(RecordingError, match="given 2 times"):
        open_recordings([paths[0], paths[0]], robot)
    with pytest.raises(ParameterError, match="no column tau_nobody to turn"):
        open_recording(paths[0], robot).flipped(["tau_nobody"])


@pytest.mark.parametrize("suffix", [*SUFFIXES, "compressed", "fortran"])
def test_figures_and_warnings_are_those_of_reading(suffix: str, tmp_path: Path, robot: Robot) -> None:
    rng = np.random.default_rng(3)
    time = np.arange(70_000) * 0.001 + 3e-4 * rng.uniform(size=70_000)
    time[30_000:] += 4.0
    wave = np.round(np.sin(np.outer(time, [2.0, 3.0])), 4)
    torque = np.stack([rng.normal(size=len(time)), np.full(len(time), 2.0)], axis=1)
    recording = Recording(channels=NAMES, dofs=NAMES, time=time, position=wave, torque=torque)
    path = tmp_path / f"log{suffix if suffix.startswith('.') else '.npz'}"
    if suffix == "compressed":
        np.savez_compressed(path, **recording.columns())  # type: ignore[arg-type]
    elif suffix == "fortran":
        np.savez(path, time=time, q=np.asfortranarray(wave), tau=torque)
    else:
        write_columns(path, recording.columns())
    said = []
    for read in (read_recording, open_recording):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            source: Source = read(path, robot)  # type: ignore[operator]
        said.append([str(warning.message) for warning in caught])
        assert_same(source, recording, 10_000)
        assert str(source.summary()) == str(dataclasses.replace(recording, sources=(str(path),)).summary())
    assert said[0] == said[1]
    assert [sentence.split(": ")[1][:20] for sentence in said[0]] == [
        "1 gaps in time, the ",
        "sampling is uneven",
        "torque of lift is th",
    ]

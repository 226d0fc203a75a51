"""Many recordings: one map and one reduction give the answer of one machine; machines of a fleet are told apart."""

from __future__ import annotations

import builtins
import contextlib
import csv
import dataclasses
import json
import logging
import os
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest

from casysid.cli import main
from casysid.dynamics import build_regressor
from casysid.errors import CasysidWarning, MissingExtraError, ParameterError, RecordingError
from casysid.identification import Settings, identify, passes
from casysid.identification.many import identify_fleet, identify_many, open_workers
from casysid.identification.many.compact import flattened
from casysid.identification.many.differences import difference, drift
from casysid.identification.many.logs import find_logs
from casysid.identification.many.quantities import quantities_of
from casysid.identification.tuning.band import motion_band
from casysid.readers.constants import constant_of
from casysid.readers.writing import write_columns
from casysid.recording import open_recordings
from casysid.signals import cutoff_of, noise_of, spectrum_of
from casysid.signals.noise import band_of, speed_of
from casysid.simulation import design_sinusoids
from tests.simulated import bundled_robot

ROBOT, RATE, ROWS = "two_link.urdf", 200.0, 2000
SETTINGS = Settings(choose_friction=False, delay=0.0, time_scale=1.0)
EXCERPT = 400


def write_log(path: Path, seed: int, *, viscous: float = 1.0, machine: float = 0.0, rows: int = ROWS) -> Path:
    """A log of the robot moving along its sinusoids, its viscous friction so many times the usual one."""
    robot = bundled_robot(ROBOT)
    regressor, random = build_regressor(robot), np.random.default_rng(seed)
    time = np.arange(rows) / RATE
    motion = design_sinusoids(robot, duration=rows / RATE, seed=seed).sample(time)
    usual = {"viscous": 0.4 * viscous, "coulomb": 0.3, "armature": 0.01}
    truth = np.array(
        [
            value if one.kind not in usual else usual[one.kind]
            for one, value in zip(regressor.parameters, regressor.prior, strict=True)
        ]
    )
    tau = regressor.predict(truth, motion.q, motion.v, motion.a, time=time)
    tau += 0.02 * np.std(tau, axis=0) * random.standard_normal(tau.shape)
    columns = {"time": time, "machine": np.full(rows, machine)}
    columns |= {
        f"q_{name}": motion.q[:, k] + 1e-4 * random.standard_normal(rows) for k, name in enumerate(robot.channels)
    }
    columns |= {f"tau_{name}": tau[:, k] for k, name in enumerate(robot.dofs)}
    return write_columns(path, columns)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Four recordings of machine 1 and four of machine 2, which is stiffer."""
    home = tmp_path_factory.mktemp("fleet")
    for k in range(8):
        write_log(home / f"run{k}.parquet", k, viscous=1.0 + 0.5 * (k % 2), machine=1.0 + k % 2)
    return home


@pytest.fixture
def small_excerpts(monkeypatch):
    """Recordings count as long, though they are short."""
    monkeypatch.setattr(passes, "EXCERPTS", 8)
    monkeypatch.setattr(passes, "EXCERPT_ROWS", EXCERPT)


@pytest.mark.parametrize("long", [True, False])
def test_the_answer_is_that_of_one_machine(logs, long, request):
    if long:
        request.getfixturevalue("small_excerpts")
    robot = bundled_robot(ROBOT)
    opened = open_recordings(sorted(logs.iterdir()), robot)
    halves = [one.split(0.7) for one in opened]
    alone = identify(robot, [one for one, _ in halves], SETTINGS, held_out=[rest for _, rest in halves])
    many = identify_many(robot, logs, SETTINGS, split=0.7, scheduler="synchronous")
    assert passes.is_long([one for one, _ in halves]) is long
    np.testing.assert_allclose(many.parameters, alone.parameters, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(many.uncertainty.covariance, alone.uncertainty.covariance, rtol=1e-9, atol=1e-16)
    for one, other in ((many.train, alone.train), (many.held_out, alone.held_out), (many.file, alone.file)):
        assert one.samples == other.samples
        assert one.relative == pytest.approx(other.relative, rel=1e-10)
        assert one.relative_unfiltered == pytest.approx(other.relative_unfiltered, rel=1e-10)
        np.testing.assert_allclose(one.rmse, other.rmse, rtol=1e-10)


@pytest.mark.parametrize("level", [0.0, 1e-5, 1e-2])
@pytest.mark.parametrize("rows", [999, 1000, 1002, 70_000])
def test_a_flattened_spectrum_says_the_same(level, rows):
    random, time = np.random.default_rng(rows), np.arange(rows) / RATE
    waves = np.column_stack([np.sin(2.0 * time), np.sin(9.0 * time) + 0.1 * np.sin(200.0 * time), 0.0 * time])
    whole = spectrum_of(time, waves + level * random.standard_normal(waves.shape))
    flat = flattened(whole)
    for scale in (1.0, 0.3):
        one, other = (
            dataclasses.replace(spectrum, segments=max(scale * spectrum.segments, 1.0)) for spectrum in (whole, flat)
        )
        assert motion_band(other) == motion_band(one)
        assert cutoff_of(other, 30.0) == cutoff_of(one, 30.0)
        np.testing.assert_array_equal(noise_of(other), noise_of(one))
        np.testing.assert_array_equal(speed_of(other), speed_of(one))
        np.testing.assert_array_equal(band_of(other), band_of(one))
    there = pickle.loads(pickle.dumps(flat))
    np.testing.assert_array_equal(there.frequency, whole.frequency)
    np.testing.assert_array_equal(there.power, flat.power)
    assert level == 0.0 or len(pickle.dumps(flat)) < 0.9 * len(pickle.dumps(whole))


def test_errors_summed_by_recording_are_those_of_all_samples(logs, small_excerpts):
    robot = bundled_robot(ROBOT)
    result = identify_many(robot, logs, SETTINGS, scheduler="synchronous")
    band = result.cutoff
    motions = passes.Passes(robot, open_recordings(sorted(logs.iterdir()), robot), band).all_motions()
    missed = felt = 0.0
    for motion in motions:
        left = motion.tau - result.regressor.predict(result.parameters, motion.q, motion.v, motion.a, time=motion.time)
        missed += np.sum(left[motion.settled] ** 2)
        felt += np.sum(motion.tau[motion.settled] ** 2)
    assert result.train.relative_unfiltered == pytest.approx(np.sqrt(missed / felt), rel=1e-10)


def test_samples_stay_with_the_workers(tmp_path, small_excerpts):
    """A further recording costs a fiftieth of its samples and less, beside the excerpts that all of them share."""
    moved, rows = [], 40_000
    for count in (2, 4):
        folder = tmp_path / str(count)
        folder.mkdir()
        for k in range(count):
            write_log(folder / f"{k}.npz", k, rows=rows)
        with open_workers("synchronous") as workers:
            identify_many(bundled_robot(ROBOT), folder, SETTINGS, scheduler=workers)
        assert workers.traffic.tasks >= 3 * count
        moved.append(workers.traffic.sent + workers.traffic.received)
    assert moved[0] < moved[1]
    assert (moved[1] - moved[0]) / 2 < rows * 6 * 8 / 50


def test_machines_of_a_fleet_are_told_apart(logs, small_excerpts):
    robot = bundled_robot(ROBOT)
    fleet = identify_fleet(robot, logs, "machine", SETTINGS, scheduler="synchronous")
    assert [one.name for one in fleet.machines] == ["1", "2"]
    assert [one.recordings for one in fleet.machines] == [(0, 2, 4, 6), (1, 3, 5, 7)]
    for dof in robot.dofs:
        k = fleet.quantities.index(f"viscous of {dof}")
        weak, stiff = (one.answer for one in fleet.machines)
        assert weak.high[k] < stiff.low[k]
        assert weak.low[k] < 0.4 < weak.high[k] or abs(weak.values[k] - 0.4) < 0.02
        assert fleet.differences[k].chance < 1e-6
        assert fleet.differences[k].between == pytest.approx(0.2 / np.sqrt(2.0), rel=0.2)


def test_all_dry_friction_is_one_quantity_and_first_moments_carry_what_no_mass_tells(logs, small_excerpts):
    robot = bundled_robot(ROBOT)
    fleet = identify_fleet(robot, logs, "machine", Settings(delay=0.0, time_scale=1.0), scheduler="synchronous")
    kinds = {one.kind for one in fleet.pooled.regressor.parameters}
    assert "sharp_coulomb" in kinds
    compared = quantities_of(fleet.pooled.regressor, fleet.pooled.structural)
    pooled = dict(zip(compared.names, compared.weights @ fleet.pooled.parameters, strict=True))
    for dof, found in fleet.pooled.dry_friction().items():
        k = fleet.quantities.index(f"dry friction of {dof}")
        assert pooled[f"dry friction of {dof}"] == pytest.approx(found, rel=1e-12)
        for machine in fleet.machines:
            assert machine.answer.values[k] == pytest.approx(0.3, rel=0.1)
    truth = build_regressor(robot)
    ends = compared.weights[:, : len(truth.prior)] @ truth.prior
    for machine in fleet.machines:
        told = np.isfinite(machine.answer.std)
        moments = [k for k, name in enumerate(fleet.quantities) if ".mc" in name]
        assert told[moments].any()
        for k in moments:
            assert not told[k] or machine.answer.values[k] == pytest.approx(ends[k], abs=0.02)


@pytest.mark.parametrize("long", [True, False])
def test_a_machine_has_the_model_that_its_own_recordings_give(logs, long, request):
    if long:
        request.getfixturevalue("small_excerpts")
    robot = bundled_robot(ROBOT)
    fleet = identify_fleet(robot, logs / "run*.parquet", "machine", SETTINGS, scheduler="synchronous")
    assert len({one.answer.parameters.tobytes() for one in fleet.machines}) == 2
    both = identify_fleet(robot, logs, "recording", SETTINGS, scheduler="synchronous")
    assert len(both.machines) == 8
    assert both.pooled.parameters == pytest.approx(fleet.pooled.parameters, rel=1e-12)
    for one in both.machines:
        assert one.answer.status == "converged"
        assert one.answer.relative_error < 0.2


def test_a_bearing_that_stiffens_is_seen_to_drift(tmp_path, small_excerpts):
    for k in range(6):
        write_log(tmp_path / f"day{k}.npz", 0, viscous=1.0 + 0.1 * k, machine=7.0)
    fleet = identify_fleet(bundled_robot(ROBOT), tmp_path, "machine", SETTINGS, scheduler="synchronous")
    k = fleet.quantities.index(f"viscous of {bundled_robot(ROBOT).dofs[0]}")
    found = fleet.machines[0].drifts[k]
    assert found.slope == pytest.approx(0.04, rel=0.2)
    assert found.low > 0.0


def test_equal_machines_scatter_by_their_errors_and_a_trend_is_covered():
    random, chances, covered = np.random.default_rng(0), [], 0
    for _ in range(400):
        std = random.uniform(0.5, 2.0, 12)
        values = 3.0 + std * random.standard_normal(12)
        chances.append(difference(values, std).chance)
        found = drift(values + 0.3 * np.arange(12), std)
        covered += found.low < 0.3 < found.high
    assert np.mean(np.array(chances) < 0.1) == pytest.approx(0.1, abs=0.04)
    assert covered / 400 > 0.93
    assert difference(np.ones(3), np.array([1.0, np.inf, np.nan])) is None


def test_logs_are_found_in_order_and_once(tmp_path):
    for name in ("b=2/part-0.parquet", "b=1/part-0.parquet", "_metadata.parquet", ".hidden.csv", "notes.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("x")
    names = [str(path.relative_to(tmp_path.resolve())) for path in find_logs(tmp_path)]
    assert names == ["b=1/part-0.parquet", "b=2/part-0.parquet"]
    with pytest.raises(RecordingError, match="more than once"):
        find_logs([tmp_path, tmp_path / "b=1/part-0.parquet"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="no log in this folder"):
        find_logs(tmp_path / "empty")
    with pytest.raises(RecordingError, match="no file has such a name"):
        find_logs(str(tmp_path / "*.npz"))


def test_a_machine_may_be_a_word_or_a_number(tmp_path):
    (tmp_path / "a.csv").write_text("time,arm\n0,r07\n1,r07\n")
    (tmp_path / "b.csv").write_text("time,arm\n0,r07\n1,r08\n")
    (tmp_path / "c.csv").write_text("time,arm\n0,\n")
    assert constant_of(tmp_path / "a.csv", "arm") == "r07"
    assert constant_of(write_columns(tmp_path / "d.npz", {"arm": np.full(3, 4.0)}), "arm") == "4"
    for name, words in (("b", "changes within"), ("c", "is empty")):
        with pytest.raises(RecordingError, match=words):
            constant_of(tmp_path / f"{name}.csv", "arm")
    with pytest.raises(RecordingError, match="no column 'robot'"):
        constant_of(tmp_path / "a.csv", "robot")


def test_without_dask_one_process_works_and_a_message_says_what_to_install(monkeypatch):
    true_import = builtins.__import__

    def without(name, *rest):
        if name.split(".")[0] in ("dask", "distributed"):
            raise ImportError(name)
        return true_import(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.warns(CasysidWarning, match=r"pip install 'casysid\[cluster\]'"), open_workers(workers=2) as workers:
        assert workers(abs, [-1, 2]) == [1, 2]
    with (
        pytest.raises(MissingExtraError, match=r"pip install 'casysid\[cluster\]'"),
        open_workers("local", workers=2),
    ):
        pass


def test_a_wrong_address_is_one_message():
    pytest.importorskip("distributed")
    with pytest.raises(ParameterError, match="none answers"), open_workers("nonsense"):
        pass


def test_the_command_writes_the_fleet(logs, tmp_path, monkeypatch, small_excerpts, capsys):
    out = tmp_path / "out"
    words = ["identify", ROBOT, str(logs), "--scheduler", "synchronous", "--by", "machine", "--friction", "plain"]
    monkeypatch.setattr(sys, "argv", ["casysid", *words, "--delay", "0", "--time-scale", "1", "--out", str(out)])
    with contextlib.suppress(SystemExit):
        main()
    assert "Differences between machines" in capsys.readouterr().err
    fleet = json.loads((out / "fleet.json").read_text())
    assert list(fleet["machines"]) == ["1", "2"]
    with (out / "fleet.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 2 * len(fleet["units"])
    assert (out / "result.json").exists()


def test_a_bad_log_is_one_message(logs):
    with pytest.raises(RecordingError, match="no column 'arm' to tell machines apart by"):
        identify_fleet(bundled_robot(ROBOT), logs, "arm", SETTINGS, scheduler="synchronous")


@pytest.fixture(scope="module")
def cluster():
    """Two processes that a scheduler hands work to."""
    distributed, before = pytest.importorskip("distributed"), dict(os.environ)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, dashboard_address=":0", silence_logs=logging.CRITICAL
    ) as running:
        os.environ.clear()
        os.environ.update(before)  # without what Dask has set for its workers
        yield running


@pytest.mark.slow
def test_processes_at_an_address_give_the_same(cluster, logs, small_excerpts):
    robot = bundled_robot(ROBOT)
    here = identify_many(robot, logs, SETTINGS, scheduler="synchronous")
    there = identify_many(robot, logs, SETTINGS, scheduler=cluster.scheduler_address)
    np.testing.assert_allclose(there.parameters, here.parameters, rtol=1e-10, atol=1e-12)


@pytest.mark.slow
def test_what_goes_wrong_at_workers_is_one_message(cluster, logs, monkeypatch):
    address = cluster.scheduler_address
    with pytest.raises(RecordingError, match="no column 'arm' to tell machines apart by"):
        identify_fleet(bundled_robot(ROBOT), logs, "arm", SETTINGS, scheduler=address)
    with monkeypatch.context() as other:
        other.setattr("casysid.__version__", "0.0.9")
        with (
            pytest.raises(ParameterError, match=r"wanted casysid 0\.0\.9 on every worker; got "),
            open_workers(address),
        ):
            pass
    with pytest.raises(ParameterError, match="workers were lost"), open_workers(address) as workers:
        workers(os._exit, [1, 1])


@pytest.mark.slow
def test_processes_of_this_machine_are_started_for_the_work():
    pytest.importorskip("distributed")
    before = dict(os.environ)
    with open_workers("local", workers=2) as workers:
        assert workers(abs, [-1, 2, -3]) == [1, 2, 3]
    assert dict(os.environ) == before

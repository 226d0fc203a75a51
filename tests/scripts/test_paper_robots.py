"""The paper's robots: what its methods are given is what its authors had."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
RATE = 420.0


@pytest.fixture(scope="module")
def robots():
    """The module of the experiments."""
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module("paper_robots")
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def recorded(robots, tmp_path_factory):
    """A few seconds of the head."""
    experiment = robots.Experiment("head", RATE, 16_000, 1, 0, noise=0.1)
    folder = tmp_path_factory.mktemp("head")
    pieces = [robots.record_piece(experiment, piece, folder) for piece in range(2)]
    return robots.Recorded(experiment, experiment.build_plant(), pieces)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.1, 2.0), st.floats(0.0, 6.0))
def test_slow_motion_is_differentiated_in_phase_with_torque(robots, frequency, phase):
    time, w = np.arange(0, 6, 1 / RATE), 2 * np.pi * frequency
    wave = np.sin(w * time + phase)[:, None]
    signals = robots.differentiate(wave, -w * w * wave, RATE)
    settled = time > 0.5
    late = np.abs(signals["acceleration"] - signals["torque"])[settled].max()
    assert late < 1.5 * w / RATE * w * w  # differences look back by half a sample each
    energy = (signals["velocity"] ** 2 + (w * signals["position"]) ** 2)[settled]
    assert np.ptp(energy) < 3.0 * w / RATE * energy.max()


def test_the_gain_is_the_noise_of_a_standing_joints_velocity(robots):
    noise = np.random.default_rng(0).normal(size=(100_000, 1))
    velocity = robots.differentiate(noise, noise, RATE)["velocity"]
    assert robots.filter_gain(RATE) == pytest.approx(velocity[1000:].std(), rel=0.02)


def test_noise_that_is_taken_out_is_the_encoders(robots, recorded):
    moments = recorded.paper.moments
    names = recorded.paper.regressor.names
    share = moments.pooled_noise().diagonal() / np.maximum(moments.gram.sum(axis=(0, 1)).diagonal(), 1e-300)
    armature = [share[k] for k, name in enumerate(names) if name.endswith(".armature")]
    viscous = [share[k] for k, name in enumerate(names) if name.endswith(".viscous")]
    assert min(armature) > 10.0 * max(viscous) > 0.0
    assert max(armature) < 1.0


def test_structured_noise_removal_beats_ridge_where_columns_are_noisy(robots, recorded):
    run = recorded.tuning
    error = {}
    for name in ("ridge (cross-validated)", "errors in variables"):
        model, _ = robots.METHODS[name](recorded)
        error[name] = np.sqrt(np.mean((model.inverse_dynamics(run.q, run.v, run.a) - run.tau) ** 2))
    assert error["errors in variables"] < error["ridge (cross-validated)"]


def test_no_two_long_experiments_are_evaluated_at_once(robots):
    tables = importlib.import_module("reproduce_tables")
    long, other = (robots.Experiment("arm", 480.0, 500_000, 2, seed) for seed in (0, 1))
    short = robots.Experiment("arm", 480.0, 50_000, 1, 3)
    assert tables._next_to_evaluate([long, short], [other]) is short
    assert tables._next_to_evaluate([long], [other]) is None
    assert tables._next_to_evaluate([long, short], [short]) is long

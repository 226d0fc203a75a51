"""The trials on which errors in variables are measured have the truth and the noise that they claim."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture(scope="module")
def trials():
    """The module of the scripts' folder."""
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module("noisy_trials")
    sys.path.remove(str(SCRIPTS))


def test_the_truth_has_no_error_and_the_file_has_one(trials):
    trial = trials.make_trial("two_link", 0, 1e-3, 2.0, duration=5.0)
    assert trial.error(trial.truth) < 1e-12
    assert trial.error(trial.regressor.prior) > 0.01
    noise = trial.recording.position - trial.clean.channels
    assert noise.std(axis=0) == pytest.approx(1e-3, rel=0.1)


def test_samples_without_order_carry_the_noise_they_name(trials):
    trial, levels = trials.unordered_trial("two_link", 0, 1e-3, 0.1, samples=2000)
    assert trial.recording.time is None
    for name in ("velocity", "acceleration"):
        true = getattr(trial.clean, name[0])
        grown = np.var(getattr(trial.recording, name), axis=0) - np.var(true, axis=0)
        assert np.sqrt(grown) == pytest.approx(getattr(levels, name), rel=0.15)

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
METHODS = ("ols", "stepwise", "ard", "tls")


@pytest.fixture(scope="module")
def scripts():
    """Modules of the scripts' folder by name."""
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module
    sys.path.remove(str(SCRIPTS))


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), redundant=st.sampled_from([0, 30, 90]), snr=st.sampled_from([2.0, 5.0]))
def test_problems_are_drawn_as_the_paper_says(scripts, seed: int, redundant: int, snr: float) -> None:
    problem = scripts("synthetic_regression").draw_problem(np.random.default_rng(seed), 4000, snr, 5.0, redundant)
    train, clean = problem.train, problem.clean_test
    assert train.x.shape == clean.x.shape == (4000, 100)
    np.testing.assert_allclose(clean.y, clean.x @ problem.truth)
    np.testing.assert_allclose(train.x[:, :10].var(axis=0) / clean.x[:, :10].var(axis=0), 1.0 + 1.0 / snr, rtol=0.15)
    assert train.y.var() / clean.y.var() == pytest.approx(1.2, rel=0.15)
    weights, residual, *_ = np.linalg.lstsq(train.x[:, :10], train.x[:, 10 : 10 + redundant])
    np.testing.assert_allclose(weights.sum(axis=0), 1.0)
    assert (weights > -1e-9).all()
    assert (residual < 1e-9).all()
    np.testing.assert_allclose(train.x[:, 10 + redundant :].var(axis=0), 1.0, rtol=0.15)


def test_the_picture_and_the_numbers_are_written_whole(scripts, tmp_path: Path) -> None:
    figure = scripts("reproduce_figure_2")
    errors = {name: (0.1, 0.4) for name in METHODS} | {"tls": (7.0, 9.0)}
    cell = figure.summarise([errors, errors])
    table = {str(snr): {str(r): cell for r in figure.REDUNDANT} for snr in figure.INPUT_SNRS}
    figure.write_json(table, tmp_path / "figure_2.json")
    figure.draw_figure(table, tmp_path / "figure_2.png", 2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["figure_2.json", "figure_2.png"]
    assert (tmp_path / "figure_2.png").read_bytes().startswith(b"\x89PNG")
    assert cell["ols"] == {"clean": 0.1, "noisy": 0.4, "clean_std": 0.0, "noisy_std": 0.0}


def test_a_trial_can_be_run_again_and_selection_beats_least_squares_among_irrelevant_inputs(scripts) -> None:
    run = scripts("reproduce_figure_2").run_cell
    errors = run(2, 0, 0, 1000, 0, METHODS)
    assert tuple(errors) == METHODS
    assert errors == run(2, 0, 0, 1000, 0, METHODS)
    assert errors["stepwise"][0] < errors["ols"][0]


def test_the_sensitivity_to_starts_is_measured_on_the_same_problems(scripts) -> None:
    sensitivity = scripts("measure_start_sensitivity")
    errors = sensitivity.measure(200, 5, 90, 1, 0)
    assert list(errors) == ["default", "1%", "5%", "10%", "20%", "40%", "80%"]
    rows = list(sensitivity.cells([200, 1000]))
    assert len(rows) == 16
    assert rows[0] == (200, 2, 0)
    assert max(errors.values()) < 2.0 * errors["default"]

"""Least squares and ridge on moments against the rows themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.estimation import OrdinaryLeastSquares, Ridge, WeightedLeastSquares
from casysid.moments import Moments

seeds = st.integers(0, 2**32 - 1)
METHODS = [OrdinaryLeastSquares(), WeightedLeastSquares(), Ridge(), Ridge(strength=0.1)]


def draw_problem(seed: int, *, noise: float = 0.1, joints: int = 2, rows: int = 300, blocks: int = 10):
    """Two joints of very different noise that share four parameters."""
    rng = np.random.default_rng(seed)
    truth, grams, problems = rng.normal(size=4), [], []
    for joint in range(joints):
        x = rng.normal(size=(rows, 4)) * [1.0, 10.0, 0.1, 1.0]
        y = x @ truth + noise * 10.0**joint * rng.normal(size=rows)
        problems.append((x, y))
        grams.append(Moments.from_rows(x, y, blocks=blocks))
    moments = Moments.from_dense(
        np.concatenate([part.gram for part in grams], axis=1),
        np.concatenate([part.count for part in grams], axis=1),
        grams[0].columns,
        tuple(f"j{k}" for k in range(joints)),
    )
    return moments, truth, problems


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_ordinary_least_squares_is_lstsq_on_the_rows(seed):
    moments, _, problems = draw_problem(seed)
    x, y = (np.concatenate([problem[k] for problem in problems]) for k in range(2))
    assert OrdinaryLeastSquares().estimate(moments).parameters == pytest.approx(np.linalg.lstsq(x, y)[0], abs=1e-9)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_weights_settle_at_each_joints_noise(seed):
    moments, _, _ = draw_problem(seed)
    assert WeightedLeastSquares().estimate(moments).noise_std == pytest.approx([0.1, 1.0], rel=0.25)


@pytest.mark.parametrize("method", METHODS[:3], ids=lambda method: method.name)
def test_noise_free_data_give_the_exact_answer(method):
    moments, truth, _ = draw_problem(3, noise=0.0)
    assert method.estimate(moments).parameters == pytest.approx(truth, abs=1e-5)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: f"{method.name}")
def test_unseen_directions_stay_at_the_prior_and_have_infinite_variance(method):
    rng = np.random.default_rng(0)
    x = rng.normal(size=(200, 3))
    x = np.column_stack([x[:, 0], x[:, 1], x[:, 1], np.zeros(200)])  # columns 1 and 2 only as a sum, 3 not at all
    moments = Moments.from_rows(x, x @ [1.0, 2.0, 3.0, 9.0] + 1e-3 * rng.normal(size=200), blocks=8)
    prior = np.array([0.9, 2.5, 2.4, 7.0])
    estimate = method.estimate(moments, prior)
    assert estimate.parameters[3] == 7.0
    assert estimate.parameters[1] - estimate.parameters[2] == pytest.approx(0.1, abs=1e-9)
    assert np.isinf(estimate.std[[1, 2, 3]]).all()
    assert np.isfinite(estimate.std[0])
    assert estimate.rank == 2


@pytest.mark.parametrize("method", METHODS, ids=lambda method: f"{method.name}")
def test_permuting_and_rescaling_columns_does_the_same_to_the_answer(method):
    moments, _, problems = draw_problem(5, joints=1)
    (x, y) = problems[0]
    order, scale = np.array([2, 0, 3, 1]), np.array([1e3, 1.0, 1e-3, 7.0])
    changed = method.estimate(Moments.from_rows((x * scale)[:, order], y, blocks=10))
    assert changed.parameters * scale[order] == pytest.approx(method.estimate(moments).parameters[order], abs=1e-7)


def test_a_stronger_ridge_stays_closer_to_the_prior():
    moments, truth, _ = draw_problem(1)
    prior = truth + 1.0
    distance = [
        np.linalg.norm(Ridge(strength=s).estimate(moments, prior).parameters - prior) for s in (1e-6, 1e-1, 1e3)
    ]
    assert distance[0] > distance[1] > distance[2]
    assert distance[2] < 0.05 * distance[0]


def test_cross_validation_leans_on_a_good_prior_where_data_are_poor():
    rng = np.random.default_rng(2)
    direction = rng.normal(size=6)
    x = rng.normal(size=(240, 1)) * direction + 0.02 * rng.normal(size=(240, 6))  # nearly one direction
    truth = rng.normal(size=6)
    moments = Moments.from_rows(x, x @ truth + 0.5 * rng.normal(size=240), blocks=12)
    prior = truth + 0.05 * rng.normal(size=6)
    wls, ridge = WeightedLeastSquares().estimate(moments, prior), Ridge().estimate(moments, prior)
    assert np.linalg.norm(ridge.parameters - truth) < 0.5 * np.linalg.norm(wls.parameters - truth)
    assert ridge.diagnostics["effective_parameters"] < 4


def test_standard_errors_of_white_residuals_are_the_textbook_ones():
    rng = np.random.default_rng(4)
    x = rng.normal(size=(4000, 5))
    moments = Moments.from_rows(x, x @ np.arange(5.0) + 0.3 * rng.normal(size=4000), blocks=20)
    std = WeightedLeastSquares().estimate(moments).std
    assert std == pytest.approx(0.3 * np.sqrt(np.diag(np.linalg.inv(x.T @ x))), rel=0.2)


def test_standard_errors_cover_the_truth_under_coloured_residuals():
    truth, hits, white_hits = np.array([1.0, -2.0, 0.5]), 0, 0
    for seed in range(120):
        rng = np.random.default_rng(seed)
        slow = np.convolve(rng.normal(size=(2100,)), np.ones(50) / np.sqrt(50), mode="valid")[:2000]
        x = np.stack([np.convolve(rng.normal(size=2100), np.ones(50), mode="valid")[:2000] for _ in range(3)], axis=1)
        moments = Moments.from_rows(x, x @ truth + slow, blocks=20)
        estimate = WeightedLeastSquares().estimate(moments)
        hits += int((np.abs(estimate.parameters - truth) < 1.96 * estimate.std).sum())
        white = np.sqrt(np.diag(np.linalg.inv(x.T @ x)))
        white_hits += int((np.abs(estimate.parameters - truth) < 1.96 * white).sum())
    assert 0.88 < hits / 360 < 0.99
    assert white_hits / 360 < 0.5  # the textbook formula is far too sure


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Ridge(strength=-1.0), "strength must be a finite number >= 0"),
        (lambda: Ridge(folds=1), "at least 2 folds"),
        (lambda: Ridge().estimate(Moments.from_rows(np.eye(3), np.ones(3))), "at least 2 blocks"),
        (lambda: Ridge().estimate(draw_problem(0)[0], np.zeros(3)), "wanted 4 finite numbers"),
    ],
)
def test_bad_requests_are_named(make, message):
    with pytest.raises(ParameterError, match=message):
        make()

"""Laws of the two estimators, from moments to parameters."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.estimation.base import Estimator
from casysid.estimation.bayesian import BayesianDenoising, effective_rows
from casysid.estimation.denoising import Start
from casysid.estimation.joint_factor_analysis import JointFactorAnalysis
from casysid.estimation.least_squares import OrdinaryLeastSquares, WeightedLeastSquares
from casysid.estimation.standardise import seen_directions, solve_least_squares, standardise
from casysid.estimation.stepwise import StepwiseRegression
from casysid.moments import Moments
from tests.estimation.draws import draw_moments, with_columns

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
LAW = settings(max_examples=8, deadline=None)
seeds = st.integers(0, 2**32 - 1)
ONE_START = (Start(0.1),)
ESTIMATORS: list[Estimator] = [
    BayesianDenoising(starts=ONE_START),
    BayesianDenoising(starts=ONE_START, vector="noisy"),
    JointFactorAnalysis(),
    JointFactorAnalysis(vector="noiseless"),
]
every_estimator = pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: f"{e.name}-{e.vector}")


@every_estimator
@LAW
@given(seed=seeds)
def test_directions_that_the_data_do_not_see_stay_at_the_prior(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments, prior = draw_moments(rng), rng.standard_normal(8)
    mixing = np.column_stack([np.eye(6), 2.0 * np.eye(6)[1], np.eye(6)[2] - np.eye(6)[4]])
    dependent = with_columns(moments, mixing)
    estimate = estimator.estimate(dependent, prior)
    scale = np.sqrt(np.diag(dependent.pooled(estimate.noise_std**-2.0).xx))
    xx = dependent.pooled(estimate.noise_std**-2.0).xx / np.outer(scale, scale)
    _, seen = seen_directions(xx)
    step = (estimate.parameters - prior) * scale
    np.testing.assert_allclose(step, seen @ (seen.T @ step), atol=1e-8 * np.abs(step).max())
    assert np.isinf(estimate.std).tolist() == [False, True, True, False, True, False, True, True]
    assert estimate.rank == 6


@every_estimator
@LAW
@given(seed=seeds)
def test_moments_that_are_added_count_like_the_data_together(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((120, 4))
    y = x @ np.array([1.0, 0.0, -2.0, 0.5]) + 0.3 * rng.standard_normal(120)
    together = estimator.estimate(Moments.from_rows(x, y, blocks=2))
    added = estimator.estimate(Moments.from_rows(x[:60], y[:60]) + Moments.from_rows(x[60:], y[60:]))
    np.testing.assert_array_equal(added.parameters, together.parameters)
    np.testing.assert_array_equal(added.covariance, together.covariance)


@every_estimator
def test_fewer_rows_than_columns_are_no_trouble(estimator: Estimator) -> None:
    rng = np.random.default_rng(0)
    estimate = estimator.estimate(Moments.from_rows(rng.standard_normal((8, 20)), rng.standard_normal(8), blocks=2))
    assert np.isfinite(estimate.parameters).all()
    assert estimate.rank == 8


def test_joints_are_weighted_by_the_noise_of_the_fit() -> None:
    moments = draw_moments(np.random.default_rng(5), n=2000)
    estimate = BayesianDenoising(vector="noisy").estimate(moments)
    rms = np.sqrt(moments.residual_energy(estimate.parameters).sum(axis=0) / moments.count.sum(axis=0))
    np.testing.assert_allclose(estimate.noise_std, rms, rtol=0.02)
    assert estimate.noise_std[1] > 2.0 * estimate.noise_std[0]


def test_the_noisy_vector_of_joint_factor_analysis_is_weighted_least_squares() -> None:
    moments = draw_moments(np.random.default_rng(2))
    expected = WeightedLeastSquares().estimate(moments)
    found = JointFactorAnalysis().estimate(moments)
    np.testing.assert_allclose(found.parameters, expected.parameters, atol=2e-3)


def test_the_metric_is_that_of_equation_8() -> None:
    x = np.random.default_rng(0).standard_normal((400, 2))
    y = x @ np.array([1.0, 2.0]) + np.random.default_rng(1).standard_normal(400)
    moments = Moments.from_rows(x, y)
    estimate = BayesianDenoising().estimate(moments)
    noise = np.diag(estimate.metric) / np.diag(moments.pooled(estimate.noise_std**-2.0).xx) - 1.0
    assert ((noise > 0.0) & (noise < 0.4)).all()
    off_diagonal = moments.pooled(estimate.noise_std**-2.0).xx[0, 1]
    assert estimate.metric[0, 1] == pytest.approx(off_diagonal)


def test_what_is_left_out_is_not_taken_for_known_to_be_zero() -> None:
    rng = np.random.default_rng(3)
    x = rng.standard_normal((500, 3))
    moments = Moments.from_rows(x, 2.0 * x[:, 0] + rng.standard_normal(500), blocks=5)
    std = BayesianDenoising(vector="noisy").estimate(moments).std
    np.testing.assert_allclose(std, OrdinaryLeastSquares().estimate(moments).std, rtol=0.4)


def test_coloured_residuals_are_worth_fewer_rows() -> None:
    rng = np.random.default_rng(0)
    x = np.repeat(rng.standard_normal((1000, 4)), 10, axis=0)
    white = Moments.from_rows(x, x.sum(axis=1) + rng.standard_normal(10_000), blocks=20)
    coloured = Moments.from_rows(x, x.sum(axis=1) + np.repeat(rng.standard_normal(1000), 10), blocks=20)
    rows = []
    for moments in (white, coloured):
        problem = standardise(moments)
        rows.append(effective_rows(problem, *solve_least_squares(problem.normal.xx, problem.normal.xy)))
    assert rows[0] == 10_000
    assert 900 < rows[1] < 3000


@pytest.fixture(scope="module", params=[0, 30, 90], ids=lambda r: f"{r} redundant")
def problems(request: pytest.FixtureRequest) -> list[Any]:
    """The paper's synthetic problems."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SCRIPTS))
        draw_problem = importlib.import_module("synthetic_regression").draw_problem
    return [draw_problem(np.random.default_rng([0, request.param, k]), 1000, 2.0, 5.0, request.param) for k in range(3)]


def test_noisy_inputs_are_predicted_from_and_clean_ones_far_better_than_by_the_rivals(problems: list[Any]) -> None:
    clean, noisy = np.zeros((4, 3)), np.zeros((4, 3))
    methods = (BayesianDenoising(), BayesianDenoising(vector="noisy"), OrdinaryLeastSquares(), StepwiseRegression())
    for trial, problem in enumerate(problems):
        moments = Moments.from_rows(problem.train.x, problem.train.y, blocks=10)
        for k, method in enumerate(methods):
            theta = method.estimate(moments).parameters
            for errors, test in ((clean, problem.clean_test), (noisy, problem.noisy_test)):
                errors[k, trial] = np.mean((test.y - test.x @ theta) ** 2) / np.var(test.y)
    noiseless, _, *rivals = clean.mean(axis=1)
    assert noiseless < 0.6 * min(rivals)
    _, predicted, *rivals = noisy.mean(axis=1)
    assert predicted < 1.03 * min(rivals)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: BayesianDenoising(vector="true"), "'noiseless' or 'noisy'; got 'true'"),
        (lambda: JointFactorAnalysis(starts=()), "0 starts"),
        (lambda: BayesianDenoising(starts=(Start(0.1),), tolerance=0.0), "tolerance < 1"),
        (lambda: BayesianDenoising(weight_error=-1.0), "weight_error must be positive"),
    ],
)
def test_settings_that_make_no_sense_are_refused(build, message) -> None:
    with pytest.raises(ParameterError, match=message):
        build()

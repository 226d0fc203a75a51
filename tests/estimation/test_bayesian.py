"""Laws of the two estimators, from moments to parameters."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.estimation.base import Estimator, Status
from casysid.estimation.bayesian import BayesianDenoising, effective_rows
from casysid.estimation.denoising import Start
from casysid.estimation.joint_factor_analysis import JointFactorAnalysis
from casysid.estimation.least_squares import OrdinaryLeastSquares, WeightedLeastSquares
from casysid.estimation.standardise import seen_directions, solve_least_squares, standardise
from casysid.estimation.stepwise import StepwiseRegression
from casysid.moments import Moments

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


def draw_moments(rng: np.random.Generator, joints: int = 2, blocks: int = 4, n: int = 60, p: int = 6) -> Moments:
    """Half the columns relevant, some noise in all of them, joints of unlike size and noise."""
    truth = np.where(np.arange(p) % 2 == 0, rng.uniform(0.5, 2.0, p) * rng.choice([-1.0, 1.0], p), 0.0)
    gram = np.empty((blocks, joints, p + 1, p + 1))
    for b, j in np.ndindex(blocks, joints):
        t = (j + 1.0) * rng.standard_normal((n, p))
        x = t + 0.1 * rng.standard_normal((n, p))
        rows = np.column_stack([x, t @ truth + 0.3 * (3.0 * j + 1.0) * rng.standard_normal(n)])
        gram[b, j] = rows.T @ rows
    columns, names = (tuple(f"{letter}{k}" for k in range(m)) for letter, m in (("x", p), ("joint_", joints)))
    return Moments(gram, np.full((blocks, joints), float(n)), columns, names)


def transformed(moments: Moments, transform: np.ndarray, columns: tuple[str, ...]) -> Moments:
    """Moments of the rows ``r`` multiplied by ``transform``."""
    return Moments(transform.T @ moments.gram @ transform, moments.count, columns, moments.joints)


def with_columns(moments: Moments, mixing: np.ndarray) -> Moments:
    """Moments of the columns multiplied by ``mixing``, the output as it is."""
    transform = np.zeros((mixing.shape[0] + 1, mixing.shape[1] + 1))
    transform[:-1, :-1], transform[-1, -1] = mixing, 1.0
    return transformed(moments, transform, tuple(f"x{k}" for k in range(mixing.shape[1])))


@every_estimator
@LAW
@given(seed=seeds)
def test_the_order_of_columns_does_not_matter(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments, order = draw_moments(rng), rng.permutation(6)
    expected = estimator.estimate(moments)
    found = estimator.estimate(with_columns(moments, np.eye(6)[:, order]))
    np.testing.assert_allclose(found.parameters, expected.parameters[order], atol=5e-4)
    np.testing.assert_allclose(found.std, expected.std[order], rtol=1e-2)


@every_estimator
@LAW
@given(seed=seeds)
def test_parameters_follow_the_units_of_columns_and_target(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments, units = draw_moments(rng), 10.0 ** rng.uniform(-4, 4, 7)
    expected = estimator.estimate(moments)
    found = estimator.estimate(transformed(moments, np.diag(units), moments.columns))
    factor = units[-1] / units[:-1]
    np.testing.assert_allclose(found.parameters / factor, expected.parameters, atol=5e-4)
    np.testing.assert_allclose(found.std / factor, expected.std, rtol=1e-2)
    np.testing.assert_allclose(found.noise_std / units[-1], expected.noise_std, rtol=1e-3)
    metric = found.metric * np.outer(factor, factor)
    np.testing.assert_allclose(metric, expected.metric, atol=1e-3 * np.abs(expected.metric).max())


@every_estimator
@LAW
@given(seed=seeds)
def test_an_empty_column_changes_nothing_and_stays_at_the_prior(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments, prior = draw_moments(rng), 0.1 * rng.standard_normal(7)
    widened = with_columns(moments, np.insert(np.eye(6), 3, 0.0, axis=1))
    found = estimator.estimate(widened, prior)
    expected = estimator.estimate(moments, np.delete(prior, 3))
    np.testing.assert_allclose(np.delete(found.parameters, 3), expected.parameters, atol=5e-4)
    np.testing.assert_allclose(np.delete(found.std, 3), expected.std, rtol=1e-2)
    assert found.parameters[3] == prior[3]
    assert np.isinf(found.std[3])
    assert not found.metric[3].any()
    assert found.rank == expected.rank == 6


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
@LAW
@given(seed=seeds)
def test_the_scale_of_a_joints_rows_does_not_matter(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments = draw_moments(rng)
    scale = np.array([1.0, 10.0 ** rng.uniform(-2, 2)])
    louder = Moments(moments.gram * scale[:, None, None] ** 2, moments.count, moments.columns, moments.joints)
    found, expected = estimator.estimate(louder), estimator.estimate(moments)
    np.testing.assert_allclose(found.parameters, expected.parameters, atol=5e-4)
    np.testing.assert_allclose(found.noise_std / scale, expected.noise_std, rtol=1e-3)


@every_estimator
@pytest.mark.parametrize("truth", [np.array([3.0, 0.0, -2.0, 0.5, 0.0]), np.array([1.0, -2.0, 3.0, -4.0, 5.0])])
def test_without_noise_the_truth_is_found(estimator: Estimator, truth: np.ndarray) -> None:
    x = np.random.default_rng(0).standard_normal((200, 5))
    estimate = estimator.estimate(Moments.from_rows(x, x @ truth, blocks=5))
    np.testing.assert_allclose(estimate.parameters, truth, atol=1e-7)


@every_estimator
def test_moments_that_say_nothing_return_the_prior(estimator: Estimator) -> None:
    estimate = estimator.estimate(Moments.from_rows(np.zeros((10, 3)), np.zeros(10), blocks=2), np.arange(3.0))
    assert estimate.status is Status.DEGENERATE
    assert estimate.parameters.tolist() == [0.0, 1.0, 2.0]
    assert np.isinf(estimate.std).all()
    assert estimate.noise_std.shape == (1,)


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

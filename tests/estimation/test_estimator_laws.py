"""Laws that hold for every estimator that selects, shrinks, corrects or de-noises columns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.estimation.base import Estimator, Status
from casysid.estimation.bayesian import BayesianDenoising
from casysid.estimation.denoising import Start
from casysid.estimation.empirical_bayes import EmpiricalBayes
from casysid.estimation.joint_factor_analysis import JointFactorAnalysis
from casysid.estimation.lasso import LassoRegression
from casysid.estimation.partial_least_squares import PartialLeastSquares
from casysid.estimation.relevance import RelevanceRegression
from casysid.estimation.stepwise import StepwiseRegression
from casysid.estimation.total_least_squares import TotalLeastSquares
from casysid.moments import Moments
from tests.estimation.draws import draw_moments, transformed, with_columns

LAW = settings(max_examples=10, deadline=None)
RIVALS: list[Estimator] = [
    StepwiseRegression(),
    LassoRegression(tolerance=1e-13, strengths=12, smallest_strength=1e-2),
    LassoRegression(strength=0.1, tolerance=1e-13),
    PartialLeastSquares(),
    PartialLeastSquares(components=2),
    RelevanceRegression(tolerance=1e-9),
    TotalLeastSquares(),
    EmpiricalBayes(tolerance=1e-9, iterations=400),
]
BAYESIAN: list[Estimator] = [
    BayesianDenoising(starts=(Start(0.1),)),
    BayesianDenoising(starts=(Start(0.1),), vector="noisy"),
    JointFactorAnalysis(),
    JointFactorAnalysis(vector="noiseless"),
]
BY_DEFAULT = [kind() for kind in dict.fromkeys(type(rival) for rival in RIVALS)]
CLOSE, ITERATED = 1e-5, 5e-4
pytestmark = pytest.mark.filterwarnings("ignore:tls")  # noise of the same fraction everywhere is not what is drawn
named = {f"{estimator.name}{k}": estimator for k, estimator in enumerate([*RIVALS, *BAYESIAN])}
every_estimator = pytest.mark.parametrize("estimator", named.values(), ids=named)
every_rival = pytest.mark.parametrize("estimator", RIVALS, ids=list(named)[: len(RIVALS)])
seeds = st.integers(0, 2**32 - 1)


def tolerance(estimator: Estimator) -> float:
    """How near two answers of an estimator are to be that would be the same without rounding."""
    return ITERATED if estimator in BAYESIAN else CLOSE


@every_estimator
@LAW
@given(seed=seeds)
def test_the_order_of_columns_does_not_matter(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments, order = draw_moments(rng), rng.permutation(6)
    expected = estimator.estimate(moments)
    found = estimator.estimate(with_columns(moments, np.eye(6)[:, order]))
    np.testing.assert_allclose(found.parameters, expected.parameters[order], atol=tolerance(estimator))
    np.testing.assert_allclose(found.std, expected.std[order], rtol=20 * tolerance(estimator))


@every_estimator
@LAW
@given(seed=seeds)
def test_parameters_follow_the_units_of_columns_and_target(estimator: Estimator, seed: int) -> None:
    rng, slack = np.random.default_rng(seed), tolerance(estimator)
    moments, units = draw_moments(rng), 10.0 ** rng.uniform(-4, 4, 7)
    expected = estimator.estimate(moments)
    found = estimator.estimate(transformed(moments, np.diag(units), moments.columns))
    factor = units[-1] / units[:-1]
    np.testing.assert_allclose(found.parameters / factor, expected.parameters, atol=slack)
    np.testing.assert_allclose(found.std / factor, expected.std, rtol=20 * slack)
    np.testing.assert_allclose(found.noise_std / units[-1], expected.noise_std, rtol=2 * slack)
    metric = found.metric * np.outer(factor, factor)
    np.testing.assert_allclose(metric, expected.metric, atol=2 * slack * np.abs(expected.metric).max())


@every_estimator
@LAW
@given(seed=seeds)
def test_the_scale_of_a_joints_rows_does_not_matter(estimator: Estimator, seed: int) -> None:
    rng, slack = np.random.default_rng(seed), tolerance(estimator)
    moments = draw_moments(rng)
    scale = np.array([1.0, 10.0 ** rng.uniform(-2, 2)])
    louder = Moments.from_dense(
        moments.gram * scale[:, None, None] ** 2, moments.count, moments.columns, moments.joints
    )
    found, expected = estimator.estimate(louder), estimator.estimate(moments)
    np.testing.assert_allclose(found.parameters, expected.parameters, atol=slack)
    np.testing.assert_allclose(found.noise_std / scale, expected.noise_std, rtol=2 * slack)


@every_estimator
@LAW
@given(seed=seeds)
def test_an_empty_column_changes_nothing_and_stays_at_the_prior(estimator: Estimator, seed: int) -> None:
    rng, slack = np.random.default_rng(seed), tolerance(estimator)
    moments, prior = draw_moments(rng), 0.1 * rng.standard_normal(7)
    found = estimator.estimate(with_columns(moments, np.insert(np.eye(6), 3, 0.0, axis=1)), prior)
    expected = estimator.estimate(moments, np.delete(prior, 3))
    np.testing.assert_allclose(np.delete(found.parameters, 3), expected.parameters, atol=slack)
    np.testing.assert_allclose(np.delete(found.std, 3), expected.std, rtol=20 * slack)
    assert found.parameters[3] == prior[3]
    assert np.isinf(found.std[3])
    assert not found.metric[3].any()
    assert found.rank == expected.rank == 6


@every_rival
@LAW
@given(seed=seeds)
def test_twin_columns_have_no_standard_error_of_their_own(estimator: Estimator, seed: int) -> None:
    moments = draw_moments(np.random.default_rng(seed))
    doubled = with_columns(moments, np.column_stack([np.eye(6), 2.0 * np.eye(6)[1]]))
    estimate = estimator.estimate(doubled)
    assert np.isinf(estimate.std).tolist() == [False, True, False, False, False, False, True]
    assert estimate.rank == 6
    assert np.isfinite(estimate.parameters).all()


@pytest.mark.parametrize(
    "estimator", [e() for e in {type(e): type(e) for e in RIVALS}] + BAYESIAN, ids=lambda e: e.name
)
@pytest.mark.parametrize("truth", [np.array([3.0, 0.0, -2.0, 0.5, 0.0]), np.array([1.0, -2.0, 3.0, -4.0, 5.0])])
def test_without_noise_the_truth_is_found(estimator: Estimator, truth: np.ndarray) -> None:
    x = np.random.default_rng(0).standard_normal((200, 5))
    estimate = estimator.estimate(Moments.from_rows(x, x @ truth, blocks=5))
    np.testing.assert_allclose(estimate.parameters, truth, atol=0.08 if estimator.name == "lasso" else 1e-5)


@every_estimator
def test_moments_that_say_nothing_return_the_prior(estimator: Estimator) -> None:
    estimate = estimator.estimate(Moments.from_rows(np.zeros((10, 3)), np.zeros(10), blocks=2), np.arange(3.0))
    assert estimate.status is Status.DEGENERATE
    assert estimate.parameters.tolist() == [0.0, 1.0, 2.0]
    assert np.isinf(estimate.std).all()
    assert estimate.noise_std.shape == (1,)
    assert estimate.method == estimator.name


@pytest.mark.parametrize("estimator", [LassoRegression(), PartialLeastSquares()], ids=lambda e: e.name)
def test_a_single_block_cannot_choose_a_strength(estimator: Estimator) -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ParameterError, match="at least 2 blocks of time; got 1"):
        estimator.estimate(Moments.from_rows(rng.standard_normal((20, 3)), rng.standard_normal(20)))


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: StepwiseRegression(f_to_enter=2.0, f_to_remove=3.0), "enter and leave for ever"),
        (lambda: StepwiseRegression(tolerance=0.0), "tolerance in"),
        (lambda: LassoRegression(strength=2.0), r"must lie in \[0, 1\]"),
        (lambda: LassoRegression(folds=1), "2 folds"),
        (lambda: PartialLeastSquares(components=0), "components >= 1"),
        (lambda: RelevanceRegression(tolerance=-1.0), "tolerance > 0"),
        (lambda: TotalLeastSquares(noise_covariance=np.ones(3)), "got shape"),
        (lambda: TotalLeastSquares(noise_covariance=-np.eye(3)), "positive semidefinite"),
    ],
)
def test_settings_that_make_no_sense_are_refused(build, message) -> None:
    with pytest.raises(ParameterError, match=message):
        build()

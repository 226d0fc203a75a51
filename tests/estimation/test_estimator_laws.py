"""Laws that hold for every estimator that selects, shrinks or corrects columns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.estimation.base import Estimator, Status
from casysid.estimation.lasso import LassoRegression
from casysid.estimation.partial_least_squares import PartialLeastSquares
from casysid.estimation.relevance import RelevanceRegression
from casysid.estimation.stepwise import StepwiseRegression
from casysid.estimation.total_least_squares import TotalLeastSquares
from casysid.moments import Moments

LAW = settings(max_examples=15, deadline=None)
ESTIMATORS: list[Estimator] = [
    StepwiseRegression(),
    LassoRegression(tolerance=1e-13, strengths=12, smallest_strength=1e-2),
    LassoRegression(strength=0.1, tolerance=1e-13),
    PartialLeastSquares(),
    PartialLeastSquares(components=2),
    RelevanceRegression(tolerance=1e-9),
    TotalLeastSquares(),
]
pytestmark = pytest.mark.filterwarnings("ignore:tls")  # noise of the same fraction everywhere is not what is drawn
every_estimator = pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: f"{e.name}{ESTIMATORS.index(e)}")
seeds = st.integers(0, 2**32 - 1)


def draw_moments(rng: np.random.Generator, joints: int = 2, blocks: int = 4, n: int = 40, p: int = 6) -> Moments:
    """Half the columns relevant, some noise in all of them."""
    truth = np.where(np.arange(p) % 2 == 0, rng.uniform(0.5, 2.0, p) * rng.choice([-1.0, 1.0], p), 0.0)
    gram = np.empty((blocks, joints, p + 1, p + 1))
    for b, j in np.ndindex(blocks, joints):
        t = rng.standard_normal((n, p))
        rows = np.column_stack([t + 0.1 * rng.standard_normal((n, p)), t @ truth + 0.5 * rng.standard_normal(n)])
        gram[b, j] = rows.T @ rows
    columns, names = (tuple(f"{letter}{k}" for k in range(m)) for letter, m in (("x", p), ("joint_", joints)))
    return Moments(gram, np.full((blocks, joints), float(n)), columns, names)


def transformed(moments: Moments, transform: np.ndarray) -> Moments:
    """Moments of the rows ``r`` multiplied by ``transform``."""
    return Moments(transform.T @ moments.gram @ transform, moments.count, moments.columns, moments.joints)


@every_estimator
@LAW
@given(seed=seeds)
def test_the_order_of_columns_does_not_matter(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments = draw_moments(rng)
    order = rng.permutation(6)
    shuffle = np.append(order, 6)
    shuffled = Moments(moments.gram[:, :, shuffle[:, None], shuffle], moments.count, moments.columns, moments.joints)
    expected = estimator.estimate(moments)
    found = estimator.estimate(shuffled)
    np.testing.assert_allclose(found.parameters, expected.parameters[order], atol=1e-5)
    np.testing.assert_allclose(found.std, expected.std[order], rtol=1e-3)


@every_estimator
@LAW
@given(seed=seeds)
def test_parameters_follow_the_units_of_columns_and_target(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments = draw_moments(rng)
    units = 10.0 ** rng.uniform(-4, 4, 7)
    expected = estimator.estimate(moments)
    found = estimator.estimate(transformed(moments, np.diag(units)))
    factor = units[-1] / units[:-1]
    np.testing.assert_allclose(found.parameters / factor, expected.parameters, atol=1e-6)
    np.testing.assert_allclose(found.std / factor, expected.std, rtol=1e-5)
    np.testing.assert_allclose(found.noise_std / units[-1], expected.noise_std, rtol=1e-8)


@every_estimator
@LAW
@given(seed=seeds)
def test_the_scale_of_a_joints_rows_does_not_matter(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments = draw_moments(rng)
    scale = np.array([1.0, 10.0 ** rng.uniform(-2, 2)])
    louder = Moments(moments.gram * scale[:, None, None] ** 2, moments.count, moments.columns, moments.joints)
    np.testing.assert_allclose(estimator.estimate(louder).parameters, estimator.estimate(moments).parameters, atol=1e-6)


@every_estimator
@LAW
@given(seed=seeds)
def test_an_empty_column_changes_nothing_and_stays_at_the_prior(estimator: Estimator, seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments = draw_moments(rng)
    prior = 0.1 * rng.standard_normal(7)
    wider = np.zeros((6 + 1, 7 + 1))
    wider[np.arange(6), [0, 1, 2, 4, 5, 6]] = wider[6, 7] = 1.0
    widened = Moments(wider.T @ moments.gram @ wider, moments.count, (*moments.columns, "empty"), moments.joints)
    found = estimator.estimate(widened, prior)
    expected = estimator.estimate(moments, np.delete(prior, 3))
    np.testing.assert_allclose(np.delete(found.parameters, 3), expected.parameters, atol=1e-8)
    np.testing.assert_allclose(np.delete(found.std, 3), expected.std, rtol=1e-6)
    assert found.parameters[3] == prior[3]
    assert np.isinf(found.std[3])
    assert found.rank == expected.rank == 6


@every_estimator
@LAW
@given(seed=seeds)
def test_twin_columns_have_no_standard_error_of_their_own(estimator: Estimator, seed: int) -> None:
    moments = draw_moments(np.random.default_rng(seed))
    twin = np.eye(7, 8)
    twin[1, 6], twin[:, 7], twin[6, 6] = 2.0, np.eye(7)[6], 0.0
    doubled = Moments(twin.T @ moments.gram @ twin, moments.count, (*moments.columns, "twin"), moments.joints)
    estimate = estimator.estimate(doubled)
    assert np.isinf(estimate.std).tolist() == [False, True, False, False, False, False, True]
    assert estimate.rank == 6
    assert np.isfinite(estimate.parameters).all()


@pytest.mark.parametrize("estimator", [e() for e in {type(e): type(e) for e in ESTIMATORS}], ids=lambda e: e.name)
def test_without_noise_the_truth_is_found(estimator: Estimator) -> None:
    rng = np.random.default_rng(0)
    x, truth = rng.standard_normal((200, 5)), np.array([3.0, 0.0, -2.0, 0.5, 0.0])
    estimate = estimator.estimate(Moments.from_rows(x, x @ truth, blocks=5))
    np.testing.assert_allclose(estimate.parameters, truth, atol=0.08 if estimator.name == "lasso" else 1e-5)


@every_estimator
def test_moments_that_say_nothing_return_the_prior(estimator: Estimator) -> None:
    estimate = estimator.estimate(Moments.from_rows(np.zeros((10, 3)), np.zeros(10), blocks=2), np.arange(3.0))
    assert estimate.status is Status.DEGENERATE
    assert estimate.parameters.tolist() == [0.0, 1.0, 2.0]
    assert np.isinf(estimate.std).all()
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

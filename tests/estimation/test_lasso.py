import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.linear_model import Lasso

from casysid.estimation.base import Status
from casysid.estimation.cross_validation import contiguous_folds
from casysid.estimation.lasso import LassoRegression, pseudo_sample
from casysid.estimation.standardise import standardise
from casysid.moments import Moments

LAW = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def draw_rows(seed: int, n: int = 60, p: int = 8) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, p)) @ rng.standard_normal((p, p))
    return x, x @ np.where(rng.random(p) < 0.5, rng.standard_normal(p), 0.0) + 2.0 * rng.standard_normal(n)


def scaled(x: np.ndarray) -> np.ndarray:
    return x / np.sqrt((x**2).mean(axis=0))


@LAW
@given(seeds, st.floats(0.001, 0.9))
def test_a_given_strength_agrees_with_the_library_on_rows(seed: int, strength: float) -> None:
    x, y = draw_rows(seed)
    strongest = np.abs(scaled(x).T @ scaled(y)).max() / len(y)
    reference = Lasso(alpha=strength * strongest, fit_intercept=False, tol=1e-12, max_iter=100_000)
    reference.fit(scaled(x), scaled(y))
    expected = reference.coef_ * np.sqrt((y**2).mean()) / np.sqrt((x**2).mean(axis=0))
    found = LassoRegression(strength=strength, tolerance=1e-13).estimate(Moments.from_rows(x, y))
    np.testing.assert_allclose(found.parameters, expected, atol=1e-5)


@LAW
@given(seeds, st.floats(0.01, 0.9))
def test_no_column_pulls_harder_than_the_penalty(seed: int, strength: float) -> None:
    x, y = draw_rows(seed)
    problem = standardise(Moments.from_rows(x, y))
    normal = problem.normal
    estimate = LassoRegression(strength=strength, tolerance=1e-13).estimate(Moments.from_rows(x, y))
    beta = estimate.parameters / problem.scale
    penalty = strength * np.abs(normal.xy).max()
    pull = normal.xy - normal.xx @ beta
    assert (np.abs(pull) <= penalty + 1e-5).all()
    np.testing.assert_allclose(pull[beta != 0.0], penalty * np.sign(beta[beta != 0.0]), atol=1e-5)


@LAW
@given(seeds)
def test_the_chosen_strength_is_the_best_of_rows_held_out(seed: int) -> None:
    x, y = draw_rows(seed)
    method = LassoRegression(strengths=6, smallest_strength=0.01, tolerance=1e-12, folds=4)
    z, target, errors = scaled(x), scaled(y), []
    strongest = np.abs(z.T @ target).max() / len(y)
    for fraction in np.geomspace(1.0, 0.01, 6):
        error = 0.0
        for fold in contiguous_folds(12, 4):
            held_out = np.isin(np.repeat(np.arange(12), 5), fold)
            model = Lasso(alpha=fraction * strongest, fit_intercept=False, tol=1e-12, max_iter=100_000)
            model.fit(z[~held_out], target[~held_out])
            error += ((target[held_out] - model.predict(z[held_out])) ** 2).sum()
        errors.append(error)
    estimate = method.estimate(Moments.from_rows(x, y, blocks=12))
    np.testing.assert_allclose(estimate.diagnostics["strength"], np.geomspace(1.0, 0.01, 6)[np.argmin(errors)])


def test_the_largest_strength_leaves_everything_at_the_prior() -> None:
    x, y = draw_rows(1)
    prior = np.arange(8.0)
    estimate = LassoRegression(strength=1.0).estimate(Moments.from_rows(x, y), prior)
    np.testing.assert_allclose(estimate.parameters, prior, atol=1e-12)


def test_no_strength_is_least_squares() -> None:
    x, y = draw_rows(2)
    estimate = LassoRegression(strength=0.0, tolerance=1e-14).estimate(Moments.from_rows(x, y))
    np.testing.assert_allclose(estimate.parameters, np.linalg.lstsq(x, y)[0], atol=1e-4)


def test_running_out_of_iterations_is_said_so() -> None:
    x, y = draw_rows(4)
    estimate = LassoRegression(strength=1e-4, tolerance=1e-14, max_iterations=1).estimate(Moments.from_rows(x, y))
    assert estimate.status is Status.MAX_ITERATIONS


def test_the_pseudo_sample_has_the_moments_of_the_data() -> None:
    x, y = draw_rows(5)
    x[:, 2] = x[:, 0]
    normal = Moments.from_rows(x, y).pooled()
    rows = pseudo_sample(normal)
    assert rows.shape == (9, 9)
    np.testing.assert_allclose(rows[:, :-1].T @ rows[:, :-1], x.T @ x, atol=1e-9)
    np.testing.assert_allclose(rows[:, :-1].T @ rows[:, -1], x.T @ y, atol=1e-9)

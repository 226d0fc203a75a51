import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.linear_model import ARDRegression

from casysid.estimation.base import Status
from casysid.estimation.relevance import RelevanceRegression, maximise_evidence
from casysid.estimation.standardise import standardise
from casysid.moments import Moments, NormalEquations

LAW = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def draw_rows(seed: int, n: int = 100, p: int = 6) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, p)) @ (np.eye(p) + 0.2 * rng.standard_normal((p, p)))
    return x, x @ np.array([2.0, 0.0, -1.0, 0.0, 3.0, 0.0]) + 1.5 * rng.standard_normal(n)


def fit_library(x: np.ndarray, y: np.ndarray) -> ARDRegression:
    flat = {"alpha_1": 0.0, "alpha_2": 0.0, "lambda_1": 0.0, "lambda_2": 1e-14}
    model = ARDRegression(fit_intercept=False, threshold_lambda=1e3, max_iter=3000, tol=1e-9, **flat)
    return model.fit(x, y)


@LAW
@given(seeds)
def test_the_fixed_point_is_the_librarys_on_rows(seed: int) -> None:
    x, y = draw_rows(seed)
    z, target = x / np.sqrt((x**2).mean(axis=0)), y / np.sqrt((y**2).mean())
    library = fit_library(z, target)
    estimate = RelevanceRegression(largest_precision=1e3, tolerance=1e-9, max_iterations=3000).estimate(
        Moments.from_rows(x, y)
    )
    found = estimate.parameters * np.sqrt((x**2).mean(axis=0)) / np.sqrt((y**2).mean())
    np.testing.assert_allclose(found, library.coef_, atol=1e-4)


def test_rows_that_merely_share_the_gram_matrix_would_mislead_the_library() -> None:
    x, y = draw_rows(0, n=2000)
    normal = Moments.from_rows(x, y).pooled()
    gram = np.block([[normal.xx, normal.xy[:, None]], [normal.xy, normal.yy]])
    few = np.linalg.cholesky(gram).T  # 7 rows
    rows, pseudo = fit_library(x, y), fit_library(few[:, :-1], few[:, -1])
    assert rows.alpha_ > 100.0 * pseudo.alpha_  # noise of 2000 rows taken for that of 7
    ours = RelevanceRegression().estimate(Moments.from_rows(x, y))
    np.testing.assert_allclose(1.0 / ours.noise_std[0] ** 2, rows.alpha_, rtol=0.01)


@LAW
@given(seeds)
def test_irrelevant_columns_are_switched_off(seed: int) -> None:
    x, y = draw_rows(seed, n=2000)
    estimate = RelevanceRegression().estimate(Moments.from_rows(x, y))
    assert estimate.status is Status.CONVERGED
    np.testing.assert_allclose(estimate.parameters, [2.0, 0.0, -1.0, 0.0, 3.0, 0.0], atol=0.25)
    assert (estimate.parameters[[0, 2, 4]] != 0.0).all()


@LAW
@given(seeds)
def test_only_the_number_of_rows_and_their_mean_moments_matter(seed: int) -> None:
    x, y = draw_rows(seed)
    normal = standardise(Moments.from_rows(x, y)).normal
    same = standardise(Moments.from_rows(np.concatenate([x, x]), np.concatenate([y, y]))).normal
    once = maximise_evidence(normal, 1e6, 1e-8, 1000)
    counted = maximise_evidence(NormalEquations(same.xx, same.xy, same.yy, normal.count), 1e6, 1e-8, 1000)
    np.testing.assert_allclose(once.coefficients, counted.coefficients, atol=1e-6)


def test_running_out_of_iterations_is_said_so() -> None:
    x, y = draw_rows(1)
    estimate = RelevanceRegression(max_iterations=2).estimate(Moments.from_rows(x, y))
    assert estimate.status is Status.MAX_ITERATIONS
    assert estimate.diagnostics["iterations"] == 2.0

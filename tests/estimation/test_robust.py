import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.special import huber

from casysid.errors import ParameterError
from casysid.estimation.robust import clip_outliers

LAW = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def draw_rows(seed: int, n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, 3))
    y = x @ np.array([1.0, -2.0, 0.5]) + 0.1 * rng.standard_normal(n)
    y[:: n // 15] += rng.choice([-1.0, 1.0]) * rng.uniform(5.0, 50.0)
    return x, y


def fit(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(x, y)[0]


@LAW
@given(seeds)
def test_passes_lead_to_hubers_estimate(seed: int) -> None:
    x, y = draw_rows(seed)
    theta = fit(x, y)
    for _ in range(60):
        theta = fit(x, clip_outliers(y, x @ theta))
    limit = 1.345 * 1.4826 * np.median(np.abs(y - x @ theta))
    reference = minimize(lambda b: huber(limit, y - x @ b).sum(), fit(x, y), method="BFGS", options={"gtol": 1e-8}).x
    np.testing.assert_allclose(theta, reference, atol=1e-4)


@LAW
@given(seeds)
def test_three_passes_take_out_most_of_the_outliers_pull(seed: int) -> None:
    x, y = draw_rows(seed)
    first = theta = fit(x, y)
    for _ in range(3):
        theta = fit(x, clip_outliers(y, x @ theta))
    truth = np.array([1.0, -2.0, 0.5])
    assert np.linalg.norm(theta - truth) < max(0.5 * np.linalg.norm(first - truth), 0.05)


def test_small_residuals_are_left_exactly_as_measured() -> None:
    rng = np.random.default_rng(0)
    tau, predicted = rng.standard_normal((2, 100, 3))
    clipped = clip_outliers(tau, predicted)
    near = np.abs(tau - predicted) <= 1.345 * 1.4826 * np.median(np.abs(tau - predicted), axis=0)
    assert (clipped[near] == tau[near]).all()
    assert (np.abs(clipped - predicted)[~near] < np.abs(tau - predicted)[~near]).all()


def test_each_joint_has_its_own_scale() -> None:
    rng = np.random.default_rng(1)
    tau, predicted = rng.standard_normal((2, 100, 2))
    unit = np.array([1.0, 1e3])
    np.testing.assert_allclose(clip_outliers(tau * unit, predicted * unit), clip_outliers(tau, predicted) * unit)


def test_shapes_that_differ_are_refused() -> None:
    with pytest.raises(ParameterError, match="must match"):
        clip_outliers(np.zeros((3, 2)), np.zeros((2, 2)))
    with pytest.raises(ParameterError, match="positive"):
        clip_outliers(np.zeros(3), np.zeros(3), threshold=0.0)

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.estimation.base import Status
from casysid.estimation.standardise import (
    estimate_noise_std,
    solve_least_squares,
    standardise,
    unseen_coordinates,
)
from casysid.moments import Moments

LAW = settings(max_examples=25, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def draw_rows(seed: int, n: int = 80, p: int = 5) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, p)) * 10.0 ** rng.uniform(-3, 3, p)
    y = x @ (rng.standard_normal(p) / np.std(x, axis=0)) + 0.3 * rng.standard_normal(n)
    return x, y


@LAW
@given(seeds)
def test_the_standardised_gram_is_that_of_standardised_rows(seed: int) -> None:
    x, y = draw_rows(seed)
    problem = standardise(Moments.from_rows(x, y, blocks=4))
    rows = np.column_stack([x, y])
    rows = rows / np.sqrt((rows**2).mean(axis=0))
    blocks = list(problem.moments.by_block())
    np.testing.assert_allclose(sum(blocks), rows.T @ rows / len(rows), atol=1e-12)
    np.testing.assert_allclose(np.diag(sum(blocks)), 1.0)
    np.testing.assert_allclose(blocks[1], rows[20:40].T @ rows[20:40] / len(rows), atol=1e-12)


@LAW
@given(seeds)
def test_restoring_the_standardised_solution_gives_least_squares_whatever_the_prior(seed: int) -> None:
    x, y = draw_rows(seed)
    prior = np.random.default_rng(seed).standard_normal(5) / np.std(x, axis=0)
    problem = standardise(Moments.from_rows(x, y), prior)
    theta = problem.restore(np.linalg.solve(problem.normal.xx, problem.normal.xy))
    np.testing.assert_allclose(theta * np.std(x, axis=0), np.linalg.lstsq(x, y)[0] * np.std(x, axis=0), atol=1e-9)


@LAW
@given(seeds)
def test_restored_covariance_is_that_of_least_squares(seed: int) -> None:
    x, y = draw_rows(seed)
    problem = standardise(Moments.from_rows(x, y))
    restored = problem.restore_covariance(np.linalg.inv(problem.normal.xx))
    expected = problem.target_rms**2 * problem.noise_std[0] ** 2 * len(x) * np.linalg.inv(x.T @ x)
    np.testing.assert_allclose(restored / expected, np.ones((5, 5)), rtol=1e-6)


def test_columns_without_energy_stay_at_the_prior_with_infinite_variance() -> None:
    x, y = draw_rows(0)
    x[:, 2] = 0.0
    prior = np.arange(5.0)
    problem = standardise(Moments.from_rows(x, y), prior)
    estimate = problem.to_estimate("law", np.ones(4), np.eye(4))
    assert estimate.parameters[2] == 2.0
    assert np.isinf(estimate.std[2])
    assert np.isfinite(np.delete(estimate.std, 2)).all()
    assert estimate.rank == 4


def test_twin_columns_have_infinite_variance_and_the_others_do_not() -> None:
    x, y = draw_rows(1)
    x[:, 4] = -3.0 * x[:, 1]
    problem = standardise(Moments.from_rows(x, y))
    assert unseen_coordinates(problem.normal.xx).tolist() == [False, True, False, False, True]


def test_noise_of_each_joint_is_found() -> None:
    rng = np.random.default_rng(3)
    truth, noise = rng.standard_normal(4), np.array([0.01, 10.0])
    parts = []
    for std in noise:
        x = rng.standard_normal((4000, 4))
        rows = np.column_stack([x, x @ truth + std * rng.standard_normal(4000)])
        parts.append(rows.T @ rows)
    moments = Moments.from_dense(np.stack(parts)[None], np.full((1, 2), 4000.0), tuple("abcd"), ("first", "second"))
    np.testing.assert_allclose(estimate_noise_std(moments), noise, rtol=0.05)


def test_least_squares_on_moments_is_the_smallest_solution_in_scaled_columns() -> None:
    x, y = draw_rows(5)
    x[:, 3] = 2.0 * x[:, 0]
    rms = np.sqrt((x**2).mean(axis=0))
    theta, rank = solve_least_squares(x.T @ x, x.T @ y)
    assert rank == 4
    np.testing.assert_allclose(theta * rms, np.linalg.lstsq(x / rms, y, rcond=1e-10)[0], atol=1e-8)


@pytest.mark.parametrize("y", [np.zeros(10), np.ones(10)])
def test_nothing_to_estimate_is_said_so(y: np.ndarray) -> None:
    problem = standardise(Moments.from_rows(np.zeros((10, 3)), y), np.ones(3))
    assert problem.is_degenerate
    estimate = problem.degenerate_estimate("law")
    assert estimate.status is Status.DEGENERATE
    assert estimate.parameters.tolist() == [1.0, 1.0, 1.0]
    assert np.isinf(estimate.std).all()


def test_a_prior_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(ParameterError, match="wanted 3 finite numbers"):
        standardise(Moments.from_rows(np.eye(3), np.ones(3)), np.ones(2))

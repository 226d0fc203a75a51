import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import CasysidWarning, ParameterError
from casysid.estimation.total_least_squares import TotalLeastSquares
from casysid.moments import Moments

LAW = settings(max_examples=25, deadline=None)
seeds = st.integers(0, 2**32 - 1)
TRUTH = np.array([1.0, -2.0, 0.5, 3.0])


def draw_noise(rng: np.random.Generator) -> np.ndarray:
    root = 0.3 * rng.standard_normal((5, 5))
    return root @ root.T + 0.02 * np.eye(5)


def draw_rows(rng: np.random.Generator, noise: np.ndarray, n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    t = rng.standard_normal((n, 4)) @ (np.eye(4) + 0.2 * rng.standard_normal((4, 4)))
    rows = np.column_stack([t, t @ TRUTH]) + rng.multivariate_normal(np.zeros(5), noise, n)
    return rows[:, :-1], rows[:, -1]


@pytest.mark.filterwarnings("ignore:tls")
@LAW
@given(seeds)
def test_it_is_the_smallest_singular_vector_of_standardised_rows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = draw_rows(rng, draw_noise(rng))
    rows = np.column_stack([x, y])
    rms = np.sqrt((rows**2).mean(axis=0))
    v = np.linalg.svd(rows / rms)[2][-1] / rms
    np.testing.assert_allclose(
        TotalLeastSquares().estimate(Moments.from_rows(x, y)).parameters, -v[:-1] / v[-1], rtol=1e-6
    )


@LAW
@given(seeds)
def test_no_other_parameters_have_a_smaller_weighted_distance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise = draw_noise(rng)
    x, y = draw_rows(rng, noise)
    gram = np.column_stack([x, y]).T @ np.column_stack([x, y])

    def distance(theta: np.ndarray) -> float:
        v = np.append(-theta, 1.0)
        return float(v @ gram @ v / (v @ noise @ v))

    found = (
        TotalLeastSquares(noise_covariance=noise).estimate(Moments.from_rows(x, y), rng.standard_normal(4)).parameters
    )
    assert all(distance(found) <= distance(found + 1e-3 * rng.standard_normal(4)) for _ in range(20))


@LAW
@given(seeds, st.floats(1e-3, 1e3))
def test_only_the_shape_of_the_noise_covariance_matters_and_its_factor_is_found(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    noise = draw_noise(rng)
    moments = Moments.from_rows(*draw_rows(rng, noise, n=5000))
    plain = TotalLeastSquares(noise_covariance=noise).estimate(moments)
    scaled = TotalLeastSquares(noise_covariance=factor * noise).estimate(moments)
    np.testing.assert_allclose(scaled.parameters, plain.parameters, rtol=1e-6)
    np.testing.assert_allclose(scaled.std, plain.std, rtol=1e-6)
    assert plain.diagnostics["noise_factor"] == pytest.approx(1.0, abs=0.15)
    assert scaled.diagnostics["noise_factor"] == pytest.approx(plain.diagnostics["noise_factor"] / factor)


@LAW
@given(seeds)
def test_with_noise_in_the_target_alone_it_is_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = draw_rows(rng, draw_noise(rng))
    estimate = TotalLeastSquares(noise_covariance=np.diag([0.0, 0.0, 0.0, 0.0, 1.0])).estimate(Moments.from_rows(x, y))
    np.testing.assert_allclose(estimate.parameters, np.linalg.lstsq(x, y)[0], rtol=1e-6)
    expected = np.diag(np.linalg.inv(x.T @ x)) * ((y - x @ estimate.parameters) ** 2).sum() / (len(y) - 4)
    np.testing.assert_allclose(estimate.std**2, expected, rtol=1e-6)


def test_standard_errors_cover_the_truth_and_attenuation_is_gone() -> None:
    rng = np.random.default_rng(0)
    noise = draw_noise(rng)
    method = TotalLeastSquares(noise_covariance=noise)
    estimates = [method.estimate(Moments.from_rows(*draw_rows(rng, noise, n=2000))) for _ in range(100)]
    error = np.array([(e.parameters - TRUTH) / e.std for e in estimates])
    assert (np.abs(error.mean(axis=0)) < 0.3).all()
    np.testing.assert_allclose(error.std(axis=0), 1.0, atol=0.25)


def test_joints_may_have_noise_of_their_own() -> None:
    rng = np.random.default_rng(1)
    noise = np.stack([draw_noise(rng), 0.01 * draw_noise(rng)])
    rows = [np.column_stack(draw_rows(rng, each, n=20_000)) for each in noise]
    gram = np.stack([part.T @ part for part in rows])[None]
    moments = Moments.from_dense(gram, np.full((1, 2), 20_000.0), tuple("abcd"), ("first", "second"))
    estimate = TotalLeastSquares(noise_covariance=noise).estimate(moments)
    np.testing.assert_allclose(estimate.parameters, TRUTH, atol=0.05)


def test_a_singular_problem_is_solved_where_the_data_see_something() -> None:
    rng = np.random.default_rng(2)
    x, y = draw_rows(rng, draw_noise(rng))
    twice = np.column_stack([x, x[:, 0]])
    estimate = TotalLeastSquares().estimate(Moments.from_rows(twice, y), np.zeros(5))
    assert np.isinf(estimate.std).tolist() == [True, False, False, False, True]
    assert estimate.parameters[0] == pytest.approx(estimate.parameters[4])  # as far from the prior as each other


def test_a_fit_that_is_worse_than_none_is_warned_of() -> None:
    rng = np.random.default_rng(4)
    x, y = rng.standard_normal((50, 2)), rng.standard_normal(50)
    x[:, 1] = x[:, 0] + 0.01 * x[:, 1]
    with pytest.warns(CasysidWarning, match="times the target itself"):
        TotalLeastSquares().estimate(Moments.from_rows(x, y))


def test_a_noise_covariance_of_the_wrong_size_is_refused() -> None:
    rng = np.random.default_rng(3)
    moments = Moments.from_rows(*draw_rows(rng, draw_noise(rng)))
    with pytest.raises(ParameterError, match=r"must be \(5, 5\) or \(1, 5, 5\)"):
        TotalLeastSquares(noise_covariance=np.eye(4)).estimate(moments)

"""One regression problem: the climb, the two vectors, what start and prior decide."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.estimation.base import Status
from casysid.estimation.denoising import Start, denoise, state_from
from casysid.estimation.denoising_em import DenoisingModel, GammaPrior
from casysid.moments import Moments, NormalEquations

LAW = settings(max_examples=15, deadline=None)
seeds = st.integers(0, 2**32 - 1)
PRIORS = pytest.mark.parametrize("prior", [GammaPrior(), None], ids=["bayes", "jfa"])


def draw_normal(seed: int, n: int = 400, d: int = 8, output: float = 100.0) -> NormalEquations:
    """Columns that share a few sources, half of them relevant, noise in all; the output in small units."""
    rng = np.random.default_rng(seed)
    t = rng.standard_normal((n, d)) @ (np.eye(d) + 0.3 * rng.standard_normal((d, d)))
    x = t + 0.4 * rng.standard_normal((n, d))
    y = t @ np.where(np.arange(d) % 2 == 0, rng.uniform(0.5, 2.0, d), 0.0) + rng.standard_normal(n)
    return Moments.from_rows(x / x.std(axis=0), output * y / y.std()).pooled()


@PRIORS
@LAW
@given(seed=seeds)
def test_the_bound_never_falls_and_ends_where_em_rests(prior: GammaPrior | None, seed: int) -> None:
    normal = draw_normal(seed)
    posterior = denoise(normal, prior=prior)
    rounding = 1e-11 * abs(posterior.bound)
    assert posterior.status is Status.CONVERGED
    assert np.diff(posterior.bounds).min() >= -rounding
    assert posterior.bound == pytest.approx(posterior.bound_of(normal), rel=1e-11)
    assert -rounding <= posterior.gain_of_one_more_iteration(normal) < 0.02
    assert posterior.bound == posterior.start_bounds.max()


@LAW
@given(seed=seeds)
def test_acceleration_gets_at_least_as_far_as_many_iterations_of_em(seed: int) -> None:
    normal = draw_normal(seed)
    model, start = DenoisingModel(normal, GammaPrior()), Start(0.2)
    state = start.state(model)
    for _ in range(1500):
        state = model.maximise(state, model.expect(state))
    assert denoise(normal, starts=[start]).bound > model.expect(state).bound - 2.0


@LAW
@given(seed=seeds)
def test_without_the_bayesian_layer_the_noisy_vector_is_least_squares(seed: int) -> None:
    normal = draw_normal(seed)
    posterior = denoise(normal, prior=None)
    expected = np.linalg.solve(normal.xx, normal.xy)
    np.testing.assert_allclose(posterior.noisy_regression, expected, atol=1e-4 * np.abs(expected).max())
    residual = normal.residual_energy(expected) / normal.count
    assert posterior.conditional_variance == pytest.approx(residual, rel=1e-5)
    np.testing.assert_allclose(posterior.mean_square, np.diag(normal.xx) / normal.count, rtol=1e-6)


@LAW
@given(seed=seeds)
def test_the_vectors_are_what_the_papers_equations_collapse_to(seed: int) -> None:
    posterior = denoise(draw_normal(seed, d=5), prior=None)
    wz, wx = posterior.output_weight, posterior.input_weight
    psi_x, psi_z, psi_y = posterior.input_noise, posterior.hidden_noise, posterior.output_noise
    ones = np.ones(5)
    A = np.diag(1.0 + wx**2 / psi_x + wz**2 / psi_z)
    B = np.linalg.inv(np.outer(ones, ones) / psi_y + np.diag(1.0 / psi_z - wz**2 / psi_z**2 / np.diag(A)))
    factor = psi_y * ones @ B / (psi_y - ones @ B @ ones)
    noisy = factor @ np.diag(wz / psi_z) @ np.linalg.inv(A) @ np.diag(wx / psi_x)  # Eq. (3)
    np.testing.assert_allclose(posterior.noisy_regression, noisy, rtol=1e-6, atol=1e-9)
    C = np.linalg.inv(np.outer(ones, ones) / psi_y + np.diag(1.0 / psi_z))
    noiseless = psi_y * ones @ C / (psi_y - ones @ C @ ones) @ np.diag(wz / psi_z / wx)  # Eq. (4)
    np.testing.assert_allclose(posterior.noiseless_regression, noiseless, rtol=1e-6, atol=1e-9)


def test_irrelevant_columns_are_switched_off_and_their_vectors_stay_finite() -> None:
    rng = np.random.default_rng(1)
    t, relevant = rng.standard_normal((4000, 8)), np.arange(8) % 2 == 0
    y = t @ np.where(relevant, 1.0, 0.0) + rng.standard_normal(4000)
    posterior = denoise(Moments.from_rows(t + 0.4 * rng.standard_normal((4000, 8)), 100.0 * y).pooled())
    assert posterior.is_relevant.tolist() == relevant.tolist()
    assert np.abs(posterior.noiseless_regression[1::2]).max() < 1e-3 * np.abs(posterior.noiseless_regression).max()
    assert (posterior.noise_fraction[1::2] > 0.99).all()


@pytest.mark.parametrize("n", [200, 1000, 10_000])
def test_the_start_hardly_matters(n: int) -> None:
    normal = draw_normal(3, n=n)
    first = denoise(normal, starts=[Start(0.2)]).noiseless_regression
    for fraction in (0.01, 0.05, 0.5, 0.8):
        change = denoise(normal, starts=[Start(fraction)]).noiseless_regression - first
        assert change @ normal.xx @ change < 0.01 * normal.yy


def test_the_prior_takes_about_a_quarter_for_noise_where_the_data_leave_it_open() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal((10_000, 3))
    y = x @ np.array([0.3, 0.2, -0.2]) + rng.standard_normal(10_000)
    fraction = denoise(Moments.from_rows(x, 1000.0 * y).pooled()).noise_fraction
    np.testing.assert_allclose(
        fraction, 1.0 / (3.0 + 2.0 * GammaPrior().shape), atol=0.03
    )  # ½ log f + (1 + a0) log(1 - f)


@pytest.mark.parametrize("size", [1.0, 100.0])
def test_a_state_has_the_vector_asked_for_and_as_much_noise_as_the_residual_allows(size: float) -> None:
    normal = draw_normal(0)
    coefficients, fraction = size * np.linspace(-1.0, 1.0, 8), np.linspace(0.1, 0.8, 8)
    state = state_from(DenoisingModel(normal, GammaPrior()), coefficients, fraction)
    mean_square = state.wx**2 + state.psi_x
    np.testing.assert_allclose(state.wz * state.wx / mean_square, coefficients)
    np.testing.assert_allclose(mean_square, np.diag(normal.xx) / normal.count)
    odds, asked = state.psi_x / state.wx**2, fraction / (1.0 - fraction)
    made = coefficients**2 @ (mean_square * asked)  # of the output's variance
    allowed = normal.residual_energy(coefficients) / normal.count
    np.testing.assert_allclose(odds, asked * min(1.0, allowed / made))


def test_running_out_of_iterations_is_said() -> None:
    posterior = denoise(draw_normal(0), max_iterations=5)
    assert posterior.status is Status.MAX_ITERATIONS
    assert len(posterior.bounds) == 6


def test_there_must_be_a_start() -> None:
    with pytest.raises(ParameterError, match="at least one start"):
        denoise(draw_normal(0), starts=[])


@pytest.mark.parametrize("values", [(0.0, 0.1), (1.0, 0.1), (0.2, 0.0), (np.nan, 0.1)])
def test_a_start_that_makes_no_sense_is_refused(values: tuple[float, float]) -> None:
    with pytest.raises(ParameterError, match="0 < noise_fraction < 1"):
        Start(*values)

"""The model against itself written per row, with dense matrices and no thought of speed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import digamma
from scipy.stats import gamma, multivariate_normal

from casysid.errors import ParameterError
from casysid.estimation.denoising_coordinates import CoordinatePoint, to_vector
from casysid.estimation.denoising_em import DenoisingModel, GammaPrior, State
from casysid.moments import Moments, NormalEquations

LAW = settings(max_examples=15, deadline=None)
seeds = st.integers(0, 2**32 - 1)
priors = st.sampled_from([GammaPrior(), GammaPrior(0.3, 0.2), None])
PRIORS = pytest.mark.parametrize("prior", [GammaPrior(0.3, 0.2), None], ids=["bayes", "jfa"])


def draw_rows(rng: np.random.Generator, n: int = 25, d: int = 4) -> tuple[np.ndarray, np.ndarray]:
    t = rng.standard_normal((n, d)) @ rng.standard_normal((d, d))
    x = t + 0.3 * rng.standard_normal((n, d))
    return x, t @ rng.standard_normal(d) + 0.5 * rng.standard_normal(n)


def draw_state(rng: np.random.Generator, d: int, prior: GammaPrior | None) -> State:
    weights, variances = rng.standard_normal((2, d)), rng.uniform(0.2, 1.0, (4, d))
    if prior is None:
        variances[2:] = 0.0
    return State(*weights, *variances, float(rng.uniform(0.2, 1.0)))


def normal_equations(x: np.ndarray, y: np.ndarray) -> NormalEquations:
    return Moments.from_rows(x, y).pooled()


def posterior_of_hidden(state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Covariance of (z, t), and the matrices that give their mean from y and from x."""
    wz, wx, psi_x, psi_z, var_z, var_x, psi_y = state
    d = len(wz)
    precision = np.zeros((2 * d, 2 * d))
    precision[:d, :d] = np.ones((d, d)) / psi_y + np.diag(1.0 / psi_z)
    precision[:d, d:] = precision[d:, :d] = -np.diag(wz / psi_z)
    precision[d:, d:] = np.diag(1.0 + (wx**2 + var_x) / psi_x + (wz**2 + var_z) / psi_z)
    covariance = np.linalg.inv(precision)
    return covariance, covariance[:, :d] @ np.ones(d) / psi_y, covariance[:, d:] @ np.diag(wx / psi_x)


def relevance(state: State, prior: GammaPrior) -> tuple[float, np.ndarray]:
    """Shape and rates of q(α)."""
    squares = state.wz**2 + state.var_z + state.wx**2 + state.var_x
    return prior.shape + 1.0, prior.rate + 0.5 * squares


def em_by_rows(x: np.ndarray, y: np.ndarray, state: State, prior: GammaPrior | None) -> State:
    """The appendix, row by row."""
    n, d = x.shape
    covariance, from_y, from_x = posterior_of_hidden(state)
    zz, zt, tt, xt, residual = np.zeros(d), np.zeros(d), np.zeros(d), np.zeros(d), 0.0
    for row, output in zip(x, y, strict=True):
        mean = from_y * output + from_x @ row
        second = covariance + np.outer(mean, mean)
        zz += np.diag(second)[:d]
        tt += np.diag(second)[d:]
        zt += np.diag(second[:d, d:])
        xt += row * mean[d:]
        residual += output**2 - 2.0 * output * mean[:d].sum() + second[:d, :d].sum()
    alpha = np.zeros(d)
    if prior is not None:
        shape, rate = relevance(state, prior)
        alpha = shape / rate
    var_z = 1.0 / (tt / state.psi_z + alpha)
    var_x = 1.0 / (tt / state.psi_x + alpha)
    wz, wx = var_z / state.psi_z * zt, var_x / state.psi_x * xt
    if prior is None:
        var_z = var_x = np.zeros(d)
    psi_z = (zz - 2.0 * wz * zt + (wz**2 + var_z) * tt) / n
    psi_x = ((x**2).sum(axis=0) - 2.0 * wx * xt + (wx**2 + var_x) * tt) / n
    return State(wz, wx, psi_x, psi_z, var_z, var_x, residual / n)


def bound_by_rows(x: np.ndarray, y: np.ndarray, state: State, prior: GammaPrior) -> float:
    """``E_q[log p] - E_q[log q]``, term by term."""
    wz, wx, psi_x, psi_z, var_z, var_x, psi_y = state
    d = len(wz)
    covariance, from_y, from_x = posterior_of_hidden(state)
    square_z, square_x = wz**2 + var_z, wx**2 + var_x
    total = 0.0
    for row, output in zip(x, y, strict=True):
        mean = from_y * output + from_x @ row
        second = covariance + np.outer(mean, mean)
        zz, zt, tt, t = second[:d, :d], np.diag(second[:d, d:]), np.diag(second[d:, d:]), mean[d:]
        total += log_normal(output**2 - 2.0 * output * mean[:d].sum() + zz.sum(), psi_y)
        total += log_normal(np.diag(zz) - 2.0 * wz * zt + square_z * tt, psi_z).sum()
        total += log_normal(row**2 - 2.0 * wx * row * t + square_x * tt, psi_x).sum()
        total += log_normal(tt, np.ones(d)).sum()
        total += multivariate_normal(mean, covariance).entropy()
    shape, rate = relevance(state, prior)
    alpha, log_alpha = shape / rate, digamma(shape) - np.log(rate)
    for square, variance in ((square_z, var_z), (square_x, var_x)):
        total += (0.5 * (log_alpha - np.log(2.0 * np.pi) - alpha * square)).sum()
        total += 0.5 * np.log(2.0 * np.pi * np.e * variance).sum()
    log_norm = gamma(prior.shape, scale=1.0 / prior.rate).logpdf(1.0) + prior.rate
    total += (log_norm + (prior.shape - 1.0) * log_alpha - prior.rate * alpha).sum()
    return float(total + gamma(shape, scale=1.0 / rate).entropy().sum())


def log_normal(square: np.ndarray | float, variance: np.ndarray | float) -> np.ndarray:
    return -0.5 * (np.log(2.0 * np.pi * variance) + square / variance)


@PRIORS
@pytest.mark.parametrize("seed", range(3))
def test_em_on_moments_is_em_on_rows(seed: int, prior: GammaPrior | None) -> None:
    rng = np.random.default_rng(seed)
    x, y = draw_rows(rng)
    model = DenoisingModel(normal_equations(x, y), prior)
    slow = fast = draw_state(rng, x.shape[1], prior)
    for _ in range(200):
        slow = em_by_rows(x, y, slow, prior)
        fast = model.maximise(fast, model.expect(fast))
    for expected, found in zip(slow, fast, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@LAW
@given(seeds)
def test_the_bound_is_the_one_of_the_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = draw_rows(rng, n=6, d=3)
    prior = GammaPrior(0.3, 0.2)
    state = draw_state(rng, 3, prior)
    bound = DenoisingModel(normal_equations(x, y), prior).expect(state).bound
    assert bound == pytest.approx(bound_by_rows(x, y, state, prior), rel=1e-10)


@LAW
@given(seeds)
def test_without_the_bayesian_layer_the_bound_is_the_likelihood(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = draw_rows(rng)
    state = draw_state(rng, 4, None)
    covariance = np.diag(np.append(state.wx**2 + state.psi_x, state.psi_y + (state.psi_z + state.wz**2).sum()))
    covariance[:4, 4] = covariance[4, :4] = state.wx * state.wz
    likelihood = multivariate_normal(np.zeros(5), covariance).logpdf(np.column_stack([x, y])).sum()
    assert DenoisingModel(normal_equations(x, y), None).expect(state).bound == pytest.approx(likelihood, rel=1e-10)


@LAW
@given(seeds, priors)
def test_em_never_lowers_the_bound(seed: int, prior: GammaPrior | None) -> None:
    rng = np.random.default_rng(seed)
    model = DenoisingModel(normal_equations(*draw_rows(rng)), prior)
    state = draw_state(rng, 4, prior)
    bounds = []
    for _ in range(60):
        expected = model.expect(state)
        bounds.append(expected.bound)
        state = model.maximise(state, expected)
    assert np.diff(bounds).min() >= -1e-9 * abs(bounds[-1])


@LAW
@given(seeds, priors)
def test_both_systems_of_coordinates_have_the_same_bound(seed: int, prior: GammaPrior | None) -> None:
    rng = np.random.default_rng(seed)
    model = DenoisingModel(normal_equations(*draw_rows(rng)), prior)
    state = draw_state(rng, 4, prior)
    point = CoordinatePoint(model, to_vector(model, state))
    assert point.bound == pytest.approx(model.expect(state).bound, rel=1e-11)
    back = point.state()
    signs = np.sign(state.wx)  # wx → -wx, wz → -wz changes nothing
    for found, expected in zip(back, state._replace(wz=signs * state.wz, wx=signs * state.wx), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9)


@LAW
@given(seeds, priors)
def test_the_gradient_is_that_of_the_bound(seed: int, prior: GammaPrior | None) -> None:
    rng = np.random.default_rng(seed)
    model = DenoisingModel(normal_equations(*draw_rows(rng)), prior)
    vector = to_vector(model, draw_state(rng, 4, prior))
    point, direction = CoordinatePoint(model, vector), rng.standard_normal(len(vector))
    step = 1e-6
    ahead, behind = (CoordinatePoint(model, vector + sign * step * direction).bound for sign in (1.0, -1.0))
    scale = 1.0 + np.abs(point.gradient * direction).sum()
    assert (ahead - behind) / (2.0 * step) == pytest.approx(point.gradient @ direction, abs=1e-5 * scale)


@LAW
@given(seeds, priors)
def test_the_metric_is_symmetric_and_positive(seed: int, prior: GammaPrior | None) -> None:
    rng = np.random.default_rng(seed)
    model = DenoisingModel(normal_equations(*draw_rows(rng)), prior)
    vector = to_vector(model, draw_state(rng, 4, prior))
    metric = CoordinatePoint(model, vector).metric()
    dense = np.array([metric(unit) for unit in np.eye(len(vector))])
    np.testing.assert_allclose(dense, dense.T, rtol=1e-9, atol=1e-12 * np.abs(dense).max())
    assert np.linalg.eigvalsh(dense).min() > 0.0


def test_a_vector_whose_input_noise_exceeds_the_residual_is_not_admissible() -> None:
    rng = np.random.default_rng(0)
    model = DenoisingModel(normal_equations(*draw_rows(rng)), None)
    vector = to_vector(model, draw_state(rng, 4, None))
    vector[-1] = -50.0  # log D
    assert CoordinatePoint(model, vector).bound == -np.inf


def test_columns_without_energy_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"nothing in 1, 2 \(the output is 2\)"):
        DenoisingModel(normal_equations(np.array([[1.0, 0.0], [2.0, 0.0]]), np.zeros(2)), None)


@pytest.mark.parametrize("values", [(0.0, 1.0), (1.0, -1.0), (np.inf, 1.0), (np.nan, 1.0)])
def test_a_prior_that_is_no_distribution_is_refused(values: tuple[float, float]) -> None:
    with pytest.raises(ParameterError, match="shape and rate"):
        GammaPrior(*values)

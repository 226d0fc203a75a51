"""Laws of the smoothing spline."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.signals import build_smoother
from casysid.signals.smoothing import KNOTS_PER_CUTOFF_PERIOD, derivative_basis


@st.composite
def sample_times(draw: st.DrawFn) -> np.ndarray:
    """Uneven sample times: steps between 1 and 3 of a unit."""
    steps = draw(st.lists(st.floats(1.0, 3.0), min_size=30, max_size=120))
    return draw(st.floats(-10.0, 10.0)) + draw(st.sampled_from([1e-3, 1e-2, 0.5])) * np.cumsum(steps)


@settings(max_examples=25, deadline=None)
@given(sample_times(), st.floats(0.05, 0.5), st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_polynomials_below_the_order_pass_with_their_derivatives(time, relative_cutoff, coefficients):
    u = (time - time.mean()) / np.ptp(time)
    polynomial = np.polynomial.Polynomial(coefficients)
    smoother = build_smoother(time, relative_cutoff / np.median(np.diff(time)))
    size = 1.0 + np.abs(coefficients).max()
    for derivative in range(3):
        truth = (polynomial if derivative == 0 else polynomial.deriv(derivative))(u) * np.ones_like(u)
        got = smoother.smooth(polynomial(u), derivative) * np.ptp(time) ** derivative
        assert np.abs(got - truth).max() < 1e-6 * size


@settings(max_examples=25, deadline=None)
@given(sample_times(), st.integers(0, 2**32 - 1), st.floats(-5, 5))
def test_smoothing_is_linear_and_commutes_with_reversal_of_time(time, seed, factor):
    x, y = np.random.default_rng(seed).normal(size=(2, len(time)))
    smoother = build_smoother(time, 0.1 / np.median(np.diff(time)))
    assert np.allclose(smoother.smooth(x + factor * y), smoother.smooth(x) + factor * smoother.smooth(y), atol=1e-9)
    mirrored = build_smoother(-time[::-1], smoother.cutoff)
    assert np.allclose(mirrored.smooth(x[::-1])[::-1], smoother.smooth(x), atol=1e-7)


def test_several_columns_are_smoothed_as_each_alone():
    time = np.linspace(0, 1, 60)
    values = np.random.default_rng(0).normal(size=(60, 3))
    smoother = build_smoother(time, 8.0)
    together = smoother.smooth(values, 1)
    assert np.allclose(together, np.column_stack([smoother.smooth(column, 1) for column in values.T]))


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("ratio", [0.25, 0.5, 1.0, 1.5])
def test_gain_is_that_of_a_butterworth_filter_run_both_ways(order, ratio):
    time, cutoff = np.linspace(0, 6, 3001), 5.0
    smoother = build_smoother(time, cutoff, order)
    wave = np.sin(2 * np.pi * ratio * cutoff * time)
    middle = slice(1000, 2000)
    out = smoother.smooth(wave)
    gain = (out[middle] @ wave[middle]) / (wave[middle] @ wave[middle])
    assert gain == pytest.approx(1.0 / (1.0 + ratio ** (2 * order)), abs=5e-3)
    assert gain == pytest.approx(float(smoother.gain(np.array(ratio * cutoff))), abs=5e-3)
    assert np.linalg.norm(out[middle] - gain * wave[middle]) < 5e-3 * np.linalg.norm(wave[middle])  # no phase


def test_derivatives_of_a_slow_sine_are_exact_to_the_gain():
    time = np.linspace(0, 10, 2001)
    smoother = build_smoother(time, 10.0)
    for derivative, truth in enumerate([np.sin(time), np.cos(time), -np.sin(time)]):
        assert np.abs(smoother.smooth(np.sin(time), derivative) - truth)[100:-100].max() < 1e-6


def test_noise_covariance_is_that_of_smoothed_white_noise():
    time = np.linspace(0, 4, 801)
    smoother = build_smoother(time, 8.0)
    noise = np.random.default_rng(1).normal(size=(801, 2000))
    through = np.stack([smoother.smooth(noise, derivative)[400] for derivative in range(3)])
    measured = through @ through.T / 2000
    size = np.sqrt(np.outer(np.diag(measured), np.diag(measured)))
    assert np.abs(smoother.noise_covariance() - measured).max() < 0.1 * size.max()
    assert np.allclose(np.diag(smoother.noise_covariance()), np.diag(measured), rtol=0.12)


@pytest.mark.parametrize(
    ("time", "cutoff", "message"),
    [
        (np.arange(50.0), 0.0, "cut-off must be a positive number of Hz; got 0"),
        (np.arange(50.0), np.nan, "cut-off must be a positive number"),
        (np.arange(3.0), 0.1, "at least 4 samples; got 3"),
        (np.array([0.0, 1, 2, 2, 3]), 0.1, "times must increase; they do not after sample 3"),
    ],
)
def test_bad_requests_are_named(time, cutoff, message):
    with pytest.raises(ParameterError, match=message):
        build_smoother(time, cutoff)


def test_values_of_another_length_are_refused():
    with pytest.raises(ParameterError, match="built for 50 samples, got 49"):
        build_smoother(np.arange(50.0), 0.1).smooth(np.zeros(49))


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("seconds", [0.5, 4.0, 30.0])
def test_the_spline_minimises_misfit_and_roughness(order, seconds):
    """Against the same minimum found densely, with the roughness integrated over the whole span."""
    cutoff, degree, rng = 0.7, 2 * order - 1, np.random.default_rng(order)
    time = np.linspace(0.0, seconds, 40)
    values, step = rng.normal(size=40), time[1]
    intervals = max(int(np.ceil(seconds / max(1.0 / (KNOTS_PER_CUTOFF_PERIOD * cutoff), step))), 1)
    knots = seconds / intervals * np.arange(-degree, intervals + degree + 1)
    nodes, weights = np.polynomial.legendre.leggauss(degree)
    points = (knots[degree : -degree - 1, None] + (nodes + 1.0) / 2.0 * seconds / intervals).ravel()
    basis, rough = (derivative_basis(at, knots, degree, k).toarray() for at, k in ((time, 0), (points, order)))
    penalty = (2.0 * np.pi * cutoff) ** (-2 * order) / step * np.tile(weights * seconds / intervals / 2.0, intervals)
    wanted = basis @ np.linalg.solve(basis.T @ basis + rough.T @ (penalty[:, None] * rough), basis.T @ values)
    np.testing.assert_allclose(build_smoother(time, cutoff, order).smooth(values), wanted, atol=1e-6)

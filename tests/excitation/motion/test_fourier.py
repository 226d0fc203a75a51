import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.excitation.motion.fourier import FourierSeries

series = st.builds(FourierSeries, st.floats(0.5, 30.0), st.integers(2, 9))


@settings(max_examples=30, deadline=None)
@given(series, st.integers(0, 2**32 - 1))
def test_every_vector_of_coordinates_is_at_rest_at_the_start_and_after_each_period(series, seed):
    coordinates = np.random.default_rng(seed).normal(size=series.size)
    scale = (2 * np.pi * series.harmonics / series.period) ** np.arange(3)
    for order in range(3):
        ends = series.basis([0.0, series.period, 2 * series.period], order) @ coordinates
        np.testing.assert_allclose(ends / scale[order], 0.0, atol=1e-9 * np.linalg.norm(coordinates))


@settings(max_examples=30, deadline=None)
@given(series, st.floats(0.0, 1.0))
def test_derivatives_are_those_of_finite_differences(series, share):
    t, h = share * series.period, 1e-5 * series.period
    for order in range(3):
        slope = (series.basis([t + h], order) - series.basis([t - h], order)) / (2 * h)
        scale = (2 * np.pi * series.harmonics / series.period) ** (order + 1)
        np.testing.assert_allclose(slope / scale, series.basis([t], order + 1) / scale, atol=1e-6)


@settings(max_examples=20, deadline=None)
@given(series, st.integers(0, 2**32 - 1))
def test_coefficients_say_the_same_as_coordinates(series, seed):
    coordinates = np.random.default_rng(seed).normal(size=(2, series.size))
    sine, cosine = series.coefficients(coordinates)
    t = np.linspace(0.0, series.period, 7)
    angle = 2 * np.pi * np.multiply.outer(t, series.frequencies)
    plain = np.sin(angle) @ sine.T + (np.cos(angle) - 1.0) @ cosine.T
    np.testing.assert_allclose(plain, series.basis(t) @ coordinates.T, atol=1e-10)


@pytest.mark.parametrize(
    ("period", "harmonics", "message"),
    [(0.0, 5, "period must be a positive"), (np.inf, 5, "period"), (5.0, 1, "at least 2"), (5.0, 2.5, "whole number")],
)
def test_impossible_series_are_refused(period, harmonics, message):
    with pytest.raises(ParameterError, match=message):
        FourierSeries(period, harmonics)

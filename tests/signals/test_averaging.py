"""Averages of equations: they keep what is true, and remove what is fast."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.accumulation import accumulate_moments
from casysid.dynamics import build_regressor
from casysid.estimation import OrdinaryLeastSquares
from casysid.signals import BandAverage
from tests.simulated import bundled_robot
from tests.strategies import random_motion, robots


@settings(max_examples=20, deadline=None)
@given(st.integers(10, 400), st.floats(0.5, 20.0), st.integers(0, 2**32 - 1))
def test_weights_are_averages_over_neighbours(samples, cutoff, seed):
    time = np.cumsum(np.random.default_rng(seed).uniform(0.5, 1.5, samples)) * 0.01
    weights = BandAverage(time, cutoff).weights(np.arange(samples)).toarray()
    assert (weights >= 0).all()
    assert np.allclose(weights.sum(axis=1), 1.0)
    assert len(weights) <= samples + 4


@pytest.mark.parametrize(("ratio", "gain"), [(0.1, 1.0), (1.0, 0.5), (2.0, 0.04), (3.0, 0.0)])
def test_gain_is_one_half_at_the_cutoff(ratio, gain):
    time, cutoff = np.arange(0, 20, 2e-3), 3.0
    weights = BandAverage(time, cutoff).weights(np.arange(len(time)))
    centre = weights @ time
    inside = (centre > 2) & (centre < 18)
    wave = weights @ np.sin(2 * np.pi * ratio * cutoff * time)
    expected = gain * np.sin(2 * np.pi * ratio * cutoff * centre)
    assert np.abs(wave - expected)[inside].max() < 0.03


@settings(max_examples=10, deadline=None)
@given(robots(max_joints=3), st.integers(0, 2**32 - 1))
def test_true_parameters_solve_the_averaged_equations(robot, seed):
    regressor = build_regressor(robot)
    q, v, a = random_motion(robot, np.random.default_rng(seed), 400)
    tau = regressor.predict(regressor.prior, q, v, a)
    average = BandAverage(np.arange(400) * 0.01, 5.0)
    moments = accumulate_moments(regressor, q, v, a, tau, average=average, blocks=4)
    assert moments.residual_energy(regressor.prior).sum() < 1e-12 * max(moments.target_energy().sum(), 1e-300)


def test_averaged_moments_are_those_of_averaged_rows():
    rng = np.random.default_rng(0)
    robot = bundled_robot("two_link.urdf")
    regressor = build_regressor(robot)
    q, v, a = (rng.normal(size=(300, 2)) for _ in range(3))
    tau, average = rng.normal(size=(300, 2)), BandAverage(np.arange(300) * 0.01, 4.0)
    moments = accumulate_moments(regressor, q, v, a, tau, average=average, blocks=1)
    weights = average.weights(np.arange(300))
    rows = np.concatenate([regressor.evaluate(q, v, a), tau[:, :, None]], axis=2)
    for joint in range(2):
        averaged = weights @ rows[:, joint]
        assert np.allclose(moments.gram[0, joint], averaged.T @ averaged, atol=1e-9)
    assert (moments.count == weights.shape[0]).all()


def test_torque_noise_above_the_band_hardly_counts():
    robot = bundled_robot("two_link.urdf")
    regressor, rng = build_regressor(robot), np.random.default_rng(1)
    time = np.arange(0, 20, 2e-3)
    q = np.column_stack([np.sin(2 * np.pi * f * time) for f in (0.4, 0.7)])
    v = np.column_stack([2 * np.pi * f * np.cos(2 * np.pi * f * time) for f in (0.4, 0.7)])
    a = np.column_stack([-((2 * np.pi * f) ** 2) * np.sin(2 * np.pi * f * time) for f in (0.4, 0.7)])
    tau = regressor.predict(regressor.prior, q, v, a)
    noisy = tau + 3.0 * np.sin(2 * np.pi * 60 * time)[:, None] + 0.01 * rng.normal(size=tau.shape)
    moments = accumulate_moments(regressor, q, v, a, noisy, average=BandAverage(time, 5.0))
    found = OrdinaryLeastSquares().estimate(moments, regressor.prior).parameters
    error = regressor.predict(found, q, v, a) - tau
    assert np.sqrt(np.mean(error**2)) < 0.01

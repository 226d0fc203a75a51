"""What the position signals say about themselves."""

import numpy as np
import pytest

from casysid.signals import build_smoother, motion_band, position_noise, smoothing_cutoff


@pytest.mark.parametrize("sigma", [1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_white_noise_on_a_motion_is_measured_within_a_tenth(sigma, rate):
    time = np.arange(0, 20, 1 / rate)
    motion = np.column_stack([np.sin(2 * np.pi * f * time) + 0.3 * time for f in (0.5, 1.3, 2.2)])
    noise = np.random.default_rng(3).normal(size=motion.shape)
    assert position_noise(time, motion + sigma * noise) == pytest.approx(sigma, rel=0.1)


def test_quantisation_counts_as_noise_of_step_over_root_twelve():
    time, step = np.arange(0, 20, 1e-3), 1e-3
    motion = np.column_stack([np.sin(2 * np.pi * f * time) for f in (0.7, 1.1)])
    assert position_noise(time, np.round(motion / step) * step) == pytest.approx(step / np.sqrt(12), rel=0.25)


@pytest.mark.parametrize("sigma", [0.0, 1e-4, 1e-3])
def test_band_of_a_sine_is_its_frequency_whatever_the_noise(sigma):
    time = np.arange(0, 20, 2e-3)
    noise = np.random.default_rng(5).normal(size=(len(time), 2))
    motion = np.column_stack([np.sin(2 * np.pi * f * time) for f in (0.8, 3.0)])
    assert motion_band(time, motion + sigma * noise) == pytest.approx([0.8, 3.0], abs=0.15)


def test_a_joint_at_rest_has_no_band():
    time = np.arange(0, 10, 1e-2)
    assert motion_band(time, np.zeros((len(time), 1))) == pytest.approx([0.0])


@pytest.mark.parametrize("sigma", [1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
def test_quantised_and_noisy_positions_are_measured_within_a_fifth(sigma):
    time, step = np.arange(0, 20, 2e-3), 1e-4
    motion = np.column_stack([0.5 * np.sin(2 * np.pi * f * time) for f in (0.7, 1.9)])
    noisy = motion + sigma * np.random.default_rng(0).normal(size=motion.shape)
    logged = np.round(noisy / step) * step
    assert position_noise(time, logged) == pytest.approx(np.std(logged - motion, axis=0), rel=0.2)


def test_smoothing_keeps_the_motion_and_falls_with_the_noise():
    time = np.arange(0, 15, 1 / 400)
    motion = np.column_stack([0.1 * np.sin(2 * np.pi * f * time) for f in (0.8, 3.0)])
    noise = np.random.default_rng(0).normal(size=motion.shape)
    cutoffs = [smoothing_cutoff(time, motion + sigma * noise) for sigma in (0.0, 1e-5, 1e-4, 1e-3)]
    assert cutoffs == sorted(cutoffs, reverse=True)
    smoother = build_smoother(time, cutoffs[-1])
    assert smoother.gain(3.0) > 0.997
    assert cutoffs[-1] < 0.2 * cutoffs[0]

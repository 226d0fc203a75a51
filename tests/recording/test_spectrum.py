"""The spectrum of positions does not depend on how they come, and says what is in them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import periodogram

from casysid.recording import spectrum as spectrum_module
from casysid.recording.resolution import ResolutionScan, position_resolution
from casysid.recording.spectrum import PositionSpectrum, SpectrumScan
from casysid.signals import band_of, noise_of, speed_of

LAWS = settings(max_examples=20, deadline=None)


def scanned(time: np.ndarray, position: np.ndarray, rows: int) -> PositionSpectrum:
    scan, resolution = SpectrumScan(), ResolutionScan()
    for first in range(0, len(time), rows):
        scan.add(time[first : first + rows], position[first : first + rows])
        resolution.add(position[first : first + rows])
    found = scan.finish(resolution.finish(), float(np.ptp(time)), len(time))
    assert found is not None
    return found


@LAWS
@given(st.integers(2, 600), st.integers(0, 2**32 - 1))
def test_of_a_short_recording_it_is_the_periodogram(samples: int, seed: int) -> None:
    time = 7.0 + np.arange(samples) / 50.0
    position = np.random.default_rng(seed).normal(size=(samples, 3)).cumsum(axis=0)
    found = scanned(time, position, samples)
    frequency, power = periodogram(position, 50.0, window="hann", detrend="linear", axis=0)
    np.testing.assert_allclose(found.frequency, frequency, atol=1e-9)
    np.testing.assert_allclose(found.power, power, atol=1e-6 * power.max() + 1e-12)
    assert found.segments == 1.0


@settings(max_examples=20, deadline=None)
@given(st.integers(300, 3000), st.integers(100, 900), st.integers(0, 2**32 - 1))
def test_it_is_the_mean_over_segments_however_the_samples_come(samples: int, rows: int, seed: int) -> None:
    longest = 256
    rng = np.random.default_rng(seed)
    time = np.arange(samples) / 50.0
    position = rng.normal(size=(samples, 2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spectrum_module, "LONGEST_SEGMENT", longest)
        one, many = scanned(time, position, samples), scanned(time, position, rows)
    np.testing.assert_allclose(one.power, many.power, rtol=1e-6)
    assert one.segments == many.segments
    parts = [position[k * longest : (k + 1) * longest] for k in range(samples // longest)]
    weights = [1.0] * len(parts)
    if samples % longest > longest // spectrum_module.LARGEST_REST:
        parts.append(position[-longest:])
        weights.append(samples % longest / longest)
    powers = [periodogram(part, 50.0, window="hann", detrend="linear", axis=0)[1] for part in parts]
    np.testing.assert_allclose(one.power, np.average(powers, axis=0, weights=weights), rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("samples", [20_000, 65_536, 100_000, 400_000])
def test_noise_band_and_speed_do_not_depend_on_the_length(samples: int) -> None:
    rng = np.random.default_rng(5)
    time = np.arange(samples) / 1000.0
    omega = 2.0 * np.pi * np.array([0.5, 2.0])
    position = np.sin(omega * time[:, None]) + 1e-3 * rng.normal(size=(samples, 2))
    found = scanned(time, position, 1 << 16)
    np.testing.assert_allclose(noise_of(found), 1e-3, rtol=0.03)
    np.testing.assert_allclose(band_of(found), [0.5, 2.0], atol=3.0 * found.frequency[1])
    np.testing.assert_allclose(speed_of(found), omega / np.sqrt(2.0), rtol=0.03)


def test_a_pause_of_hours_is_no_hour_of_samples() -> None:
    time = np.arange(4000) / 100.0
    time[2000:] += 5e5
    position = np.sin(3.0 * time)[:, None]
    found = scanned(time, position, 1000)
    assert len(found.frequency) <= (4000 + 2 * spectrum_module.LONGEST_BRIDGE) // 2 + 1


def test_a_slower_clock_moves_the_lines_and_keeps_the_energy() -> None:
    time = np.arange(4000) / 100.0
    found = scanned(time, np.sin(3.0 * time)[:, None], 4000)
    slower = found.with_time_scaled(2.0)
    wanted = scanned(2.0 * time, np.sin(3.0 * time)[:, None], 4000)
    np.testing.assert_allclose(slower.frequency, wanted.frequency)
    np.testing.assert_allclose(slower.power, wanted.power, atol=1e-9 * wanted.power.max())
    assert (slower.rate, slower.duration) == pytest.approx((wanted.rate, wanted.duration))


@LAWS
@given(st.floats(1e-5, 1e-3), st.integers(100, 5000), st.booleans())
def test_the_resolution_is_found_batch_by_batch(step: float, rows: int, quantised: bool) -> None:
    position = np.sin(np.outer(np.arange(10_000), [1e-3, 2e-3]))
    if quantised:
        position = np.round(position / step) * step
    scan = ResolutionScan()
    for first in range(0, len(position), rows):
        scan.add(position[first : first + rows])
    np.testing.assert_allclose(scan.finish(), position_resolution(position), rtol=1e-6)
    if quantised:
        np.testing.assert_allclose(scan.finish(), step, rtol=1e-6)

"""What the position signals say about themselves: how fast the motion is and how noisy the sensor."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import gammainccinv, gammaincinv

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.recording import BATCH, PositionSpectrum
from casysid.recording.resolution import ResolutionScan
from casysid.recording.spectrum import SpectrumScan
from casysid.threads import single_threaded

SPLINE_ORDER = 3
SAMPLES_PER_PARAMETER = 1e4
LARGEST_LOSS = 2e-3
"""Of a motion's accelerations to smoothing."""
LIGHT = 0.01
"""Noise that passes, over the energy of a motion's accelerations."""
CANDIDATES = 60
INTEGRATION_STEPS = 1 << 14
CHANCE_LINES = 3.0
LOWEST_LINES = 10.0
"""Lowest candidate for the smoothing, in lines of the spectrum."""


@single_threaded()
def spectrum_of(time: Array, position: Array) -> PositionSpectrum:
    """Averaged periodogram of positions, shape (N, n), at increasing times [s]."""
    scan, resolution = SpectrumScan(), ResolutionScan()
    for first in range(0, len(time), BATCH):
        batch = slice(first, first + BATCH)
        scan.add(time[batch], position[batch])
        resolution.add(position[batch])
    spectrum = scan.finish(resolution.finish(), float(time[-1] - time[0]), len(time))
    if spectrum is None:
        raise RecordingError(f"a spectrum wants at least two samples in time; got {len(time)}")
    return spectrum


@single_threaded()
def motion_band(time: Array, position: Array, share: float = 0.99) -> Array:
    """:func:`band_of` positions, shape (N, n), at increasing times [s]."""
    return band_of(spectrum_of(time, position), share)


@single_threaded()
def position_noise(time: Array, position: Array) -> Array:
    """:func:`noise_of` positions, shape (N, n), at increasing times [s]."""
    return noise_of(spectrum_of(time, position))


@single_threaded()
def smoothing_cutoff(time: Array, position: Array, usual: float = np.inf) -> float:
    """:func:`cutoff_of` positions, shape (N, n), at increasing times [s]."""
    return cutoff_of(spectrum_of(time, position), usual)


def band_of(spectrum: PositionSpectrum, share: float = 0.99) -> Array:
    """Frequency below which ``share`` of each channel's velocity energy lies [Hz], shape (n,), sensor noise left out.

    The noise floor is the median of the position spectrum over its upper half; only lines above what the noise of so
    many lines reaches by chance count as motion. A channel that never rises above its floor has band 0.
    """
    frequency = spectrum.frequency
    motion = np.where(seen(spectrum), spectrum.power, 0.0) * frequency[:, None] ** 2
    moving = motion[: max(len(motion) // 2, 1)]
    total = np.cumsum(moving, axis=0)
    reached = np.argmax(total >= share * total[-1], axis=0)
    return np.asarray(np.where(total[-1] > 0, frequency[reached], 0.0))


def speed_of(spectrum: PositionSpectrum) -> Array:
    """Root mean square velocity by channel, shape (n,), sensor noise left out, in the channel's unit a second."""
    motion = np.where(seen(spectrum), spectrum.power - _floor(spectrum), 0.0)
    rates = (2.0 * np.pi * spectrum.frequency[: max(len(motion) // 2, 1)]) ** 2
    width = float(spectrum.frequency[1]) if len(spectrum.frequency) > 1 else 0.0
    return np.asarray(np.sqrt(width * (rates @ motion[: len(rates)])))


def noise_of(spectrum: PositionSpectrum) -> Array:
    """Standard deviation of position noise by channel, shape (n,), in the channel's unit.

    White noise is read from the upper half of the spectrum, where no motion is: the median of a mean of exponentially
    distributed periodograms is that of a gamma distribution, ``ln 2`` times the mean for one. A quantised sensor adds
    at least its step over √12 (Widrow 1956), which a slow motion shows at low frequencies only.
    """
    white = np.sqrt(_floor(spectrum) * spectrum.rate / 2.0)
    return np.asarray(np.maximum(white, spectrum.resolution / np.sqrt(12.0)))


def _floor(spectrum: PositionSpectrum) -> Array:
    """Of the noise, by channel, shape (n,)."""
    median = float(gammaincinv(spectrum.segments, 0.5)) / spectrum.segments
    return np.asarray(np.median(spectrum.power[len(spectrum.power) // 2 :], axis=0) / median)


def seen(spectrum: PositionSpectrum) -> npt.NDArray[np.bool_]:
    """Lines that noise alone does not reach; of so many, one does by chance in ``exp(3)`` recordings."""
    chance = np.exp(-CHANCE_LINES) / len(spectrum.power)
    highest = float(gammainccinv(spectrum.segments, chance)) / spectrum.segments
    return np.asarray(spectrum.power > highest * _floor(spectrum))


def cutoff_of(spectrum: PositionSpectrum, usual: float = np.inf) -> float:
    """Cut-off [Hz] of the smoothing spline: the usual one where noise is light, else what leaves accelerations best.

    Noise is light where what passes of it is no more than a hundredth of the accelerations' energy in any channel.
    Else the cut-off is sought that leaves least error in the accelerations, the neediest channel's, up to the usual.
    A low-pass of gain ``g`` biases an inertia by ``b = Σ ω⁴ g (1 - g) S / Σ ω⁴ g² S`` for a motion with spectrum ``S``,
    and leaves noise of ``r = Σ ω⁴ g² N / Σ ω⁴ S``, which attenuates the inertia by as much and scatters besides: the
    least of ``b² + r² + r (1 + r) / n`` is sought where ``b`` is small, n being what the samples are worth to a
    parameter. The less noise, the higher it is.
    """
    frequency, power, floor = spectrum.frequency, spectrum.power, _floor(spectrum)
    fourth = frequency[:, None] ** 4
    motion = np.where(seen(spectrum), power - floor, 0.0) * fourth
    motion[len(power) // 2 :] = 0.0
    size = motion.sum(axis=0)
    moving = size > 0.0

    def passed(gain: Array) -> Array:
        return np.asarray((gain**2 @ fourth) * (floor[moving] / size[moving]))

    if (passed(_gain(frequency, np.array([usual]))) < LIGHT).all():
        return usual
    lowest = min(LOWEST_LINES * float(frequency[1]), spectrum.rate / 4.0)
    candidates = np.geomspace(lowest, spectrum.rate / 2.0, CANDIDATES)
    gain = _gain(frequency, candidates)
    lost = (gain * (1.0 - gain)) @ motion[:, moving] / (gain**2 @ motion[:, moving])
    noise = passed(gain)
    scatter = noise * (1.0 + noise) / SAMPLES_PER_PARAMETER
    cost = np.where(lost < LARGEST_LOSS, lost**2 + noise**2 + scatter, np.inf)
    best = candidates[np.argmin(cost, axis=0)].max(initial=candidates[0] if moving.any() else candidates[-1])
    return min(usual, float(best))


def _gain(frequency: Array, cutoffs: Array) -> Array:
    """Of smoothing splines, shape (cutoffs, frequencies)."""
    return np.asarray(1.0 / (1.0 + (frequency / cutoffs[:, None]) ** (2 * SPLINE_ORDER)))


def smoothed_noise(cutoff: float, rate: float, derivative: int) -> float:
    """Standard deviation of a derivative of smoothed white noise of unit variance.

    The gain and ``(2 π f)^k`` squared, integrated over the noise's flat spectrum up to half its rate.
    """
    frequency = np.linspace(0.0, rate / 2.0, INTEGRATION_STEPS)
    passed = _gain(frequency, np.array([cutoff]))[0] * (2.0 * np.pi * frequency) ** derivative
    return float(np.sqrt(2.0 / rate * np.trapezoid(passed**2, frequency)))


def noise_level_error(samples: int) -> float:
    """Relative standard error of the variance that :func:`position_noise` reads from so many samples.

    A median over n lines has a relative variance of ``1 / (n ln² 2)``; the window makes 1.5 neighbours worth one.
    """
    lines = max(samples / 4.0, 1.0)
    return float(np.sqrt(1.5 / lines) / np.log(2.0))

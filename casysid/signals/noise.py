"""What the position signals say about themselves: how fast the motion is and how noisy the sensor."""

from __future__ import annotations

import numpy as np
from scipy.signal import periodogram

from casysid.arrays import Array
from casysid.threads import single_threaded

MINIMUM_GAPS = 10
MULTIPLES_THAT_TELL = 9.0
SPLINE_ORDER = 3
SAMPLES_PER_PARAMETER = 1e4
LARGEST_LOSS = 2e-3
"""Of a motion's accelerations to smoothing."""
LIGHT = 0.01
"""Noise that passes, over the energy of a motion's accelerations."""
CANDIDATES = 60
CHANCE_LINES = 3.0
LOWEST_LINES = 10.0
"""Lowest candidate for the smoothing, in lines of the spectrum."""


def _even_samples(time: Array, position: Array) -> tuple[Array, float]:
    """Position on an even time base of the median step, and its rate [Hz]."""
    step = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1] + step / 2, step)
    return np.stack([np.interp(grid, time, column) for column in position.T], axis=1), 1.0 / step


@single_threaded()
def motion_band(time: Array, position: Array, share: float = 0.99) -> Array:
    """Frequency below which ``share`` of each channel's velocity energy lies [Hz], shape (n,), sensor noise left out.

    The noise floor is the median of the position spectrum over its upper half; only lines above what the noise of so
    many lines reaches by chance count as motion. A channel that never rises above its floor has band 0.
    """
    even, rate = _even_samples(time, position)
    frequency, power = periodogram(even, rate, window="hann", detrend="linear", axis=0)
    floor = np.median(power[len(power) // 2 :], axis=0) / np.log(2.0)
    seen = power > (np.log(len(power)) + CHANCE_LINES) * floor
    motion = np.where(seen, power, 0.0) * frequency[:, None] ** 2
    moving = motion[: max(len(motion) // 2, 1)]
    total = np.cumsum(moving, axis=0)
    reached = np.argmax(total >= share * total[-1], axis=0)
    return np.asarray(np.where(total[-1] > 0, frequency[reached], 0.0))


@single_threaded()
def position_noise(time: Array, position: Array) -> Array:
    """Standard deviation of position noise by channel, shape (n,), in the channel's unit.

    White noise is read from the upper half of the spectrum, where no motion is: the median of an exponentially
    distributed periodogram is ``ln 2`` times its mean. A quantised sensor adds at least its step over √12 (Widrow
    1956), which a slow motion shows at low frequencies only.
    """
    even, rate = _even_samples(time, position)
    _, power = periodogram(even, rate, window="hann", detrend="linear", axis=0)
    floor = np.median(power[len(power) // 2 :], axis=0) / np.log(2.0)
    return np.asarray(np.maximum(np.sqrt(floor * rate / 2.0), position_resolution(position) / np.sqrt(12.0)))


@single_threaded()
def smoothing_cutoff(time: Array, position: Array, usual: float = np.inf) -> float:
    """Cut-off [Hz] of the smoothing spline: the usual one where noise is light, else what leaves accelerations best.

    Noise is light where what passes of it is no more than a hundredth of the accelerations' energy in any channel.
    Else the cut-off is sought that leaves least error in the accelerations, the neediest channel's, up to the usual.
    A low-pass of gain ``g`` biases an inertia by ``b = Σ ω⁴ g (1 - g) S / Σ ω⁴ g² S`` for a motion with spectrum ``S``,
    and leaves noise of ``r = Σ ω⁴ g² N / Σ ω⁴ S``, which averages out: the least of ``b² + r (1 + r) / n`` is sought
    where ``b`` is small, n being what the samples are worth to a parameter. The less noise, the higher it is.
    """
    even, rate = _even_samples(time, position)
    frequency, power = periodogram(even, rate, window="hann", detrend="linear", axis=0)
    floor = np.median(power[len(power) // 2 :], axis=0) / np.log(2.0)
    fourth = frequency[:, None] ** 4
    seen = power > (np.log(len(power)) + CHANCE_LINES) * floor  # noise alone does not reach so high
    motion = np.where(seen, power - floor, 0.0) * fourth
    motion[len(power) // 2 :] = 0.0
    size = motion.sum(axis=0)
    moving = size > 0.0

    def passed(gain: Array) -> Array:
        return np.asarray((gain**2 @ fourth) * (floor[moving] / size[moving]))

    if (passed(_gain(frequency, np.array([usual]))) < LIGHT).all():
        return usual
    lowest = min(LOWEST_LINES / (time[-1] - time[0]), rate / 4.0)
    candidates = np.geomspace(lowest, rate / 2.0, CANDIDATES)
    gain = _gain(frequency, candidates)
    lost = (gain * (1.0 - gain)) @ motion[:, moving] / (gain**2 @ motion[:, moving])
    noise = passed(gain)
    cost = np.where(lost < LARGEST_LOSS, lost**2 + noise * (1.0 + noise) / SAMPLES_PER_PARAMETER, np.inf)
    best = candidates[np.argmin(cost, axis=0)].max(initial=candidates[0] if moving.any() else candidates[-1])
    return min(usual, float(best))


def _gain(frequency: Array, cutoffs: Array) -> Array:
    """Of smoothing splines, shape (cutoffs, frequencies)."""
    return np.asarray(1.0 / (1.0 + (frequency / cutoffs[:, None]) ** (2 * SPLINE_ORDER)))


def noise_level_error(samples: int) -> float:
    """Relative standard error of the variance that :func:`position_noise` reads from so many samples.

    A median over n lines has a relative variance of ``1 / (n ln² 2)``; the window makes 1.5 neighbours worth one.
    """
    lines = max(samples / 4.0, 1.0)
    return float(np.sqrt(1.5 / lines) / np.log(2.0))


def position_resolution(position: Array) -> Array:
    """Quantisation step by channel, shape (n,), in the channel's unit; 0 where values are not multiples of a step."""
    return np.array([_step(channel) for channel in position.T])


def _step(values: Array) -> float:
    """The smallest distance of neighbouring levels, if nearly all small ones are multiples of it and many share it."""
    levels = np.unique(values)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-12 * max(np.abs(values).max(initial=0.0), 1e-300)]
    if len(gaps) < MINIMUM_GAPS:
        return 0.0
    step = float(np.quantile(gaps, 0.01))
    multiples = gaps / step
    regular = np.abs(multiples - np.round(multiples)) < 0.05
    few = multiples < MULTIPLES_THAT_TELL
    return step if few.sum() >= MINIMUM_GAPS and regular[few].mean() > 0.95 else 0.0

"""What the position signals say about themselves: how fast the motion is and how noisy the sensor."""

from __future__ import annotations

import numpy as np
from scipy.signal import periodogram

from casysid.arrays import Array

FLOOR_MARGIN = 4.0
MINIMUM_CHANGES = 50
MULTIPLES_THAT_TELL = 9.0


def _even_samples(time: Array, position: Array) -> tuple[Array, float]:
    """Position on an even time base of the median step, and its rate [Hz]."""
    step = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1] + step / 2, step)
    return np.stack([np.interp(grid, time, column) for column in position.T], axis=1), 1.0 / step


def motion_band(time: Array, position: Array, share: float = 0.99) -> Array:
    """Frequency below which ``share`` of each channel's velocity energy lies [Hz], shape (n,), sensor noise left out.

    The noise floor is the median of the position spectrum over its upper half; only lines four times above it count as
    motion. A channel that never rises above its floor has band 0.
    """
    even, rate = _even_samples(time, position)
    frequency, power = periodogram(even, rate, window="hann", detrend="linear", axis=0)
    floor = np.median(power[len(power) // 2 :], axis=0) / np.log(2.0)
    motion = np.where(power > FLOOR_MARGIN * floor, power, 0.0) * frequency[:, None] ** 2
    moving = motion[: max(len(motion) // 2, 1)]
    total = np.cumsum(moving, axis=0)
    reached = np.argmax(total >= share * total[-1], axis=0)
    return np.asarray(np.where(total[-1] > 0, frequency[reached], 0.0))


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


def position_resolution(position: Array) -> Array:
    """Quantisation step by channel, shape (n,), in the channel's unit; 0 where values are not multiples of a step."""
    return np.array([_step(channel) for channel in position.T])


def _step(values: Array) -> float:
    """The smallest change, if nearly all changes are multiples of it and many samples share it."""
    change = np.abs(np.diff(values))
    change = change[change > 1e-12 * max(np.abs(values).max(initial=0.0), 1e-300)]
    if len(change) < MINIMUM_CHANGES:
        return 0.0
    step = float(np.quantile(change, 0.01))
    multiples = change / step
    regular = np.abs(multiples - np.round(multiples)) < 0.05
    few = multiples < MULTIPLES_THAT_TELL
    return step if few.sum() >= MINIMUM_CHANGES and regular[few].mean() > 0.95 else 0.0

"""The quantisation step of position channels, from samples that come batch by batch."""

from __future__ import annotations

import numpy as np

from casysid.arrays import Array

MINIMUM_GAPS = 10
MULTIPLES_THAT_TELL = 9.0
MOST_LEVELS = 1 << 16
"""Once so many different values were seen, further samples are not looked at."""
LOOKED_AT = 1 << 12
"""Of each batch after the first, so many consecutive samples are looked at."""


class ResolutionScan:
    """Gathers the different values of each channel."""

    def __init__(self) -> None:
        self._levels: list[Array] = []

    def add(self, position: Array) -> None:
        """Samples in any order; neighbours should be neighbours in time."""
        if not self._levels:
            self._levels = [np.unique(channel) for channel in position.T]
            return
        for k, channel in enumerate(position[:LOOKED_AT].T):
            if len(self._levels[k]) < MOST_LEVELS // 2:
                self._levels[k] = np.union1d(self._levels[k], channel)

    def finish(self) -> Array:
        """Quantisation step by channel, shape (n,), in the channel's unit; 0 where there is none."""
        return np.array([_step(levels) for levels in self._levels])


def position_resolution(position: Array) -> Array:
    """Quantisation step by channel, shape (n,), in the channel's unit; 0 where values are not multiples of a step."""
    return np.array([_step(np.unique(channel)) for channel in position.T])


def _step(levels: Array) -> float:
    """The smallest distance of neighbouring levels, if nearly all small ones are multiples of it and many share it."""
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-12 * max(np.abs(levels).max(initial=0.0), 1e-300)]
    if len(gaps) < MINIMUM_GAPS:
        return 0.0
    step = float(np.quantile(gaps, 0.01))
    multiples = gaps / step
    regular = np.abs(multiples - np.round(multiples)) < 0.05
    few = multiples < MULTIPLES_THAT_TELL
    return step if few.sum() >= MINIMUM_GAPS and regular[few].mean() > 0.95 else 0.0

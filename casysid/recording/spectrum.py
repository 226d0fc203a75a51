"""The spectrum of position channels, averaged over consecutive segments, from samples that come batch by batch.

Source: Welch 1967, without overlap: the averaged periodograms are then independent.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft
from scipy.signal import get_window

from casysid.arrays import Array, frozen

LONGEST_SEGMENT = 1 << 16
LONGEST_BRIDGE = 1 << 10
"""A hole in time is bridged by a line of at most so many samples; what it lasts longer is left out."""
LARGEST_REST = 8
"""Samples at the end that are less than one part in so many of a segment are left out."""
ROUNDING = 1e-6
"""Of a moment, in samples."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PositionSpectrum:
    """Averaged periodogram of the positions.

    Attributes:
        frequency: From 0 to half the rate [Hz], shape (F,).
        power: One-sided density by channel, shape (F, channels), [(rad, m)²/Hz].
        rate: Of the even samples that it was taken from [Hz].
        segments: How many periodograms of equal weight it is worth: power has the gamma distribution of that order.
        resolution: Quantisation step of the positions by channel, shape (channels,); 0 where there is none.
        duration: Of the recording [s].
        samples: Of the recording.
    """

    frequency: Array
    power: Array
    rate: float
    segments: float
    resolution: Array
    duration: float
    samples: int

    def __post_init__(self) -> None:
        for name in ("frequency", "power", "resolution"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def with_time_scaled(self, scale: float) -> PositionSpectrum:
        """Of the same positions in a clock that runs slower by ``scale``."""
        return dataclasses.replace(
            self,
            frequency=self.frequency / scale,
            power=self.power * scale,
            rate=self.rate / scale,
            duration=self.duration * scale,
        )


class SpectrumScan:
    """Gathers the spectrum of samples that are added in the order of time."""

    def __init__(self) -> None:
        self._step = 0.0
        self._even = np.empty((0, 0))  # not yet in a segment
        self._tail = np.empty((0, 0))  # the last segment's worth of samples before them
        self._last: tuple[float, Array] | None = None
        self._skipped = 0.0
        self._next = 0  # number of the next even sample
        self._origin = 0.0
        self._sum = np.zeros((0, 0))
        self._count = self._squares = 0.0
        self._size = LONGEST_SEGMENT

    def add(self, time: Array, position: Array) -> None:
        """Samples that follow those added before; the median step of the first ones is that of the even samples."""
        if self._last is None:
            if len(time) < 2:
                return
            self._step = float(np.median(np.diff(time)))
            if not self._step > 0.0:
                return
            self._origin = float(time[0])
            self._even = self._tail = np.empty((0, position.shape[1]))
            joined, values = time, position
        else:
            joined = np.concatenate([[self._last[0]], time])
            values = np.concatenate([self._last[1][None], position])
        self._last = (float(joined[-1]), np.array(values[-1]))
        number = self._numbers(joined)
        there = np.arange(self._next, int(np.floor(number[-1] + ROUNDING)) + 1)
        self._next += len(there)
        even = np.column_stack([np.interp(there, number, column) for column in values.T])
        self._even = np.concatenate([self._even, even])
        while len(self._even) >= LONGEST_SEGMENT:
            segment, self._even = self._even[:LONGEST_SEGMENT], self._even[LONGEST_SEGMENT:]
            self._average(segment, 1.0)
            self._tail = segment

    def _numbers(self, time: Array) -> Array:
        """The moments in even samples, long holes shortened."""
        excess = np.maximum(np.diff(time) - LONGEST_BRIDGE * self._step, 0.0)
        skipped = self._skipped + np.concatenate([[0.0], np.cumsum(excess)])
        self._skipped = float(skipped[-1])
        return np.asarray((time - self._origin - skipped) / self._step)

    def _average(self, segment: Array, weight: float) -> None:
        window = get_window("hann", len(segment))
        lines = rfft(_without_trend(segment) * window[:, None], axis=0)
        power = np.abs(lines) ** 2 * (2.0 * self._step / (window @ window))
        power[0] /= 2.0
        if len(segment) % 2 == 0:
            power[-1] /= 2.0
        self._sum = self._sum + weight * power if self._count else weight * power
        self._count += weight
        self._squares += weight**2

    def finish(self, resolution: Array, duration: float, samples: int) -> PositionSpectrum | None:
        """The spectrum of all that was added; None if that is too little."""
        if not self._count and len(self._even) < 2:
            return None
        if not self._count:
            self._size = len(self._even)
            self._average(self._even, 1.0)
        elif len(self._even) > LONGEST_SEGMENT // LARGEST_REST:
            last = np.concatenate([self._tail, self._even])[-LONGEST_SEGMENT:]
            self._average(last, len(self._even) / LONGEST_SEGMENT)
        return PositionSpectrum(
            frequency=np.arange(len(self._sum)) / (self._size * self._step),
            power=self._sum / self._count,
            rate=1.0 / self._step,
            segments=self._count**2 / self._squares,
            resolution=resolution,
            duration=duration,
            samples=samples,
        )


def _without_trend(values: Array) -> Array:
    """Values, shape (N, n), less the line of least squares through each column."""
    number = np.arange(len(values)) - (len(values) - 1) / 2.0
    slope = number @ values / max(float(number @ number), 1e-300)
    return np.asarray(values - values.mean(axis=0) - number[:, None] * slope)

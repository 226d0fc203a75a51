"""Steps of time, from time stamps that come batch by batch: their quantiles and the long ones among them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.recording.recording import GAP

SAMPLE = 1 << 17
"""Quantiles are exact up to so many steps, and beyond from at least half as many drawn at random: the median's standard
error is then below a two-hundredth of the quartiles' distance from it."""
MOST_HOLES = 1 << 16
"""Of more long steps than this, the longest are kept."""
HOLE = 0.5
"""Steps longer than this share of a gap, by the median so far, are kept."""


class RandomSample:
    """Some of a long row of numbers, each with the same chance; all of them while they are few."""

    def __init__(self, size: int = SAMPLE) -> None:
        self._size = size
        self._random = np.random.default_rng(0)
        self._share = 1.0
        self._values, self._draws = np.empty(0), np.empty(0)

    def add(self, values: Array) -> None:
        """Further numbers; however they come in parts, the same ones are kept."""
        draws = self._random.random(len(values))
        kept = draws < self._share
        self._values = np.concatenate([self._values, values[kept]])
        self._draws = np.concatenate([self._draws, draws[kept]])
        while len(self._values) > self._size:
            self._share /= 2.0
            kept = self._draws < self._share
            self._values, self._draws = self._values[kept], self._draws[kept]

    @property
    def values(self) -> Array:
        """Those that are kept, in their order."""
        return self._values


class StepStatistics:
    """Quantiles, mean and long ones of the steps of time.

    Attributes:
        count: Of the steps.
        start: First time stamp [s].
        stop: Last time stamp [s].
    """

    def __init__(self) -> None:
        self.count = 0
        self.start = self.stop = math.nan
        self._sample = RandomSample()
        self._rows: npt.NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self._edges = np.empty((0, 2))

    def add(self, time: Array) -> None:
        """Time stamps, the first of them the last of those before, except at the start."""
        if math.isnan(self.start):
            self.start = float(time[0])
        self.stop = float(time[-1])
        steps = np.diff(time)
        if not len(steps):
            return
        self._sample.add(steps)
        self.count += len(steps)
        long = np.flatnonzero(steps > HOLE * GAP * self.median)
        self._rows = np.concatenate([self._rows, self.count - len(steps) + long + 1])
        self._edges = np.concatenate([self._edges, np.stack([time[long], time[long + 1]], axis=1)])
        if len(self._rows) > 2 * MOST_HOLES:
            longest = np.sort(np.argsort(np.diff(self._edges)[:, 0])[-MOST_HOLES:])
            self._rows, self._edges = self._rows[longest], self._edges[longest]

    @property
    def median(self) -> float:
        """Of the steps [s]; nan when there are none."""
        return float(np.median(self._sample.values)) if self.count else math.nan

    def quantiles(self, shares: list[float]) -> Array:
        """Steps that these shares of them do not exceed [s]."""
        return np.asarray(np.quantile(self._sample.values, shares))

    @property
    def rate(self) -> float:
        """Samples per second, gaps left out [Hz]."""
        gaps = self.gaps
        length, count = self.stop - self.start - float(np.sum(gaps[:, 1] - gaps[:, 0])), self.count - len(gaps)
        return count / length if count and length > 0.0 else math.nan

    @property
    def gaps(self) -> Array:
        """Times before and after each step of more than five medians [s], shape (gaps, 2)."""
        return self._edges[self._long]

    @property
    def gap_rows(self) -> npt.NDArray[np.intp]:
        """Rows of the first samples after those."""
        return self._rows[self._long]

    @property
    def holes(self) -> tuple[npt.NDArray[np.intp], Array]:
        """Rows after all long steps that are kept, and the times before and after each [s], shape (holes, 2)."""
        return self._rows, self._edges

    @property
    def _long(self) -> npt.NDArray[np.bool_]:
        return np.asarray(np.diff(self._edges)[:, 0] > GAP * self.median)

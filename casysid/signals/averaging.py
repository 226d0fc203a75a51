"""Averages over short overlapping windows: a low-pass for both sides of a linear equation, with few rows left.

``tau = Y θ`` holds at every instant, and so do its averages. Averaging both sides alike removes torque noise above a
band and biases nothing, whatever the regressor holds: Coulomb friction's jumps are averaged as the measured torque's
are. The windows are cubic B-splines, whose gain ``sinc(f h)⁴`` is one half at the cut-off for a spacing ``h`` of 0.32
periods, and 4 % at twice it.

Source: the parallel low-pass and decimation of the field (Gautier 1997), its window a B-spline.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.interpolate import BSpline

from casysid.arrays import Array
from casysid.recording import Stretch

SPACING = 0.32
"""Of the windows, in periods of the cut-off: ``sinc(0.32)⁴ = 1/2``."""
DEGREE = 3
SMALLEST_SHARE = 0.2
"""A window with less than this share of the fullest one's weight lies over an end or a gap and is left out."""


@dataclass(frozen=True, eq=False)
class BandAverage:
    """Averages of samples up to a cut-off.

    Attributes:
        time: Of all samples [s], shape (N,).
        cutoff: Frequency of half gain [Hz].
    """

    time: Array
    cutoff: float

    def weights(self, samples: npt.NDArray[np.intp]) -> Any:
        """Sparse weights of the windows over some consecutive samples, shape (windows, samples); rows sum to one."""
        weights, total = _windows(self.time[samples], self._knots(self.time[samples]))
        kept = _full_enough(total)
        return sparse.diags_array(1.0 / total[kept]) @ weights[kept]

    def windows(self, samples: npt.NDArray[np.intp]) -> Windows:
        """The same windows, to be filled piece by piece."""
        return Windows(self.time, self._knots(self.time[samples]))

    def beside(
        self,
        samples: npt.NDArray[np.intp],
        values: Array,
        other_time: Array,
        other: Array,
        delays: Array,
        full: float,
    ) -> tuple[Array, Array]:
        """Averages over some consecutive samples, and of another signal by the same windows moved by some delays.

        Args:
            samples: Which samples.
            values: At them, shape (samples, n).
            other_time: The other signal's own time stamps [s], shape (M,).
            other: Its values, shape (M, m).
            delays: By how much later than the samples it is looked at [s], shape (K,).
            full: Windows with less than this share of the usual weight, in either signal, are left out.

        Returns:
            Averages, shape (windows, n), and those of the other signal, shape (windows, m, K).
        """
        time = self.time[samples]
        knots = self._knots(time)
        weights, total = _windows(time, knots)
        kept = total > full * np.median(total)
        moved = []
        for delay in delays:
            first, last = np.searchsorted(other_time, (time[0] + delay, time[-1] + delay))
            there, weight = _windows(other_time[first:last] - delay, knots)
            kept &= weight > full * np.median(weight)
            moved.append((there @ other[first:last]) / np.maximum(weight, 1e-12)[:, None])
        return (weights @ values)[kept] / total[kept, None], np.stack(moved, axis=2)[kept]

    def _knots(self, time: Array) -> Array:
        span = float(time[-1] - time[0])
        windows = max(int(np.ceil(span * self.cutoff / SPACING)), 1)
        spacing = max(span, 1e-12) / windows
        return np.asarray(time[0] + spacing * np.arange(-DEGREE, windows + DEGREE + 1))


def window_reach(cutoff: float) -> float:
    """How far from its middle a window reaches at most [s]."""
    return 0.5 * (DEGREE + 1) * SPACING / cutoff


class PieceWindows(NamedTuple):
    """Windows over a piece of a stretch.

    Attributes:
        weights: Sparse, shape (windows, samples); rows sum to one.
        middle: Of each window [s], shape (windows,).
    """

    weights: Any
    middle: Array


def piece_windows(time: Array, own: tuple[float, float], stretch: Stretch, cutoff: float, rate: float) -> PieceWindows:
    """The windows of a whole stretch whose middles lie in a piece's own time; together, pieces have each window once.

    Args:
        time: Samples of the piece, and those beside as far as :func:`window_reach`, [s], shape (N,).
        own: The piece's own time [s]: windows from the first moment up to before the second.
        stretch: All of it.
        cutoff: Frequency of half gain [Hz].
        rate: Usual samples per second, [Hz]: a window with less than a fifth of their weight is left out.
    """
    span = max(stretch.stop - stretch.start, 1e-12)
    count = max(int(np.ceil(span * cutoff / SPACING)), 1)
    spacing = span / count
    middles: Array = np.asarray(stretch.start + spacing * np.arange(-1, count + 2))
    first, last = np.searchsorted(middles, own)
    knots = stretch.start + spacing * np.arange(first - 2 * DEGREE, last + DEGREE + 1)
    begin, end = np.searchsorted(time, (knots[DEGREE], knots[-DEGREE - 1]), side="left")
    if last <= first or end <= begin:
        return PieceWindows(sparse.csr_array((0, len(time))), np.empty(0))
    reached = BSpline.design_matrix(time[begin:end], knots, DEGREE).T.tocsr()[DEGREE : DEGREE + last - first]
    total = np.asarray(reached.sum(axis=1)).ravel()
    kept = total > SMALLEST_SHARE * rate * spacing
    few = (sparse.diags_array(1.0 / total[kept]) @ reached[kept]).tocsr()
    shape = (few.shape[0], len(time))
    return PieceWindows(
        sparse.csr_array((few.data, few.indices + begin, few.indptr), shape=shape), middles[first:last][kept]
    )


@dataclass(frozen=True, eq=False)
class Windows:
    """The windows over some consecutive samples, whose averages are gathered from pieces of the samples.

    Attributes:
        time: Of all samples [s], shape (N,).
        knots: Of the windows [s].
    """

    time: Array
    knots: Array

    def sums(self, piece: npt.NDArray[np.intp], values: Array) -> WindowSums:
        """What a piece of the samples adds, from its values of shape (samples, n)."""
        weights, _ = _windows(self.time[piece], self.knots)
        reached = np.flatnonzero(np.diff(weights.indptr))
        within = slice(int(reached[0]), int(reached[-1]) + 1)
        part = weights[within]
        return WindowSums(within, part @ values, np.asarray(part.sum(axis=1)).ravel())

    def averages(self, parts: Iterable[WindowSums]) -> Array:
        """Averages over the windows that are full enough, shape (windows, n), from the sums of all pieces."""
        parts = list(parts)
        total = np.zeros(len(self.knots) - DEGREE - 1)
        values = np.zeros((len(total), parts[0].values.shape[1]))
        for part in parts:
            values[part.windows] += part.values
            total[part.windows] += part.weights
        kept = _full_enough(total)
        return np.asarray(values[kept] / total[kept, None])


class WindowSums(NamedTuple):
    """Of one piece over the windows that it reaches: weighted ``values`` (windows, n), and ``weights`` (windows,)."""

    windows: slice
    values: Array
    weights: Array


def _full_enough(total: Array) -> npt.NDArray[np.bool_]:
    return np.asarray(total > SMALLEST_SHARE * total.max())


def _windows(time: Array, knots: Array) -> tuple[Any, Array]:
    """Sparse weights of the windows, shape (windows, samples), and their sums, shape (windows,)."""
    inside = np.clip(time, knots[DEGREE], knots[-DEGREE - 1])
    weights = BSpline.design_matrix(inside, knots, DEGREE).T.tocsr()
    return weights, np.asarray(weights.sum(axis=1)).ravel()

"""Which waves over a joint's position a residual torque holds: a periodogram over angle, with its own false alarms.

Residuals are coloured and their size changes with time, so the noise of the periodogram is taken from itself: the sums
``S_b(k) = Σ r exp(-i k s)`` of blocks of time add up in phase where there is a wave, and at random where there is none.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from casysid.arrays import Array
from casysid.errors import ParameterError

LEAST_PERIODS = 2.0
"""Over the joint's range: a wave with fewer looks like the links' weight, a spring or an offset."""
OVERSAMPLING = 4
"""Of the periodogram against one over the range, and of cells in half the shortest wave: a peak loses 3 %."""


def ripple_wave_numbers(
    position: npt.ArrayLike,
    residual: npt.ArrayLike,
    highest: float,
    *,
    most: int = 3,
    false_alarm: float = 0.01,
    blocks: int = 20,
    unlimited: bool = False,
) -> tuple[float, ...]:
    """Wave numbers at which a residual torque repeats over position, the strongest first.

    Take the residual times the sign of velocity for friction that changes over position. A wave number found is
    explained by least squares before the next one is looked for.

    Args:
        position: Of the joint, samples in order of time, shape (N,) [rad or m].
        residual: Of its torque, shape (N,).
        highest: Wave number looked for [rad/rad or rad/m]: the band of the equations times 2π over the usual speed.
        most: Wave numbers wanted.
        false_alarm: Probability of finding one where there is only noise.
        blocks: Of time, whose sums are taken as independent.
        unlimited: Whether the joint turns without end, so that only whole wave numbers make sense.

    Raises:
        ParameterError: Shapes do not fit or there are fewer samples than blocks.

    Source: the false alarms of the largest peak between the frequencies of a grid are Baluev's (2008), Eq. (6), with
    the share of one direction among ``blocks`` complex normal sums, a beta distribution, for the single peak.
    """
    s, r = np.asarray(position, dtype=np.float64), np.asarray(residual, dtype=np.float64)
    if s.ndim != 1 or s.shape != r.shape or len(s) < blocks:
        raise ParameterError(
            f"ripple: position and residual must be (N,) with N of at least {blocks}; got {s.shape} and {r.shape}"
        )
    span = 2.0 * np.pi if unlimited else float(np.ptp(s))
    found: list[float] = []
    lowest = 2.0 * np.pi * LEAST_PERIODS / span if span > 0.0 else np.inf
    while len(found) < most and lowest < highest:
        left = _left_by(found, s, r)
        k = _strongest(s, left, lowest, highest, blocks, false_alarm, unlimited)
        if k is None:
            break
        found.append(k)
    return tuple(found)


def _strongest(
    s: Array, r: Array, lowest: float, highest: float, blocks: int, false_alarm: float, whole: bool
) -> float | None:
    """The wave number of the clearest peak; None when it may be noise."""
    sums, origin, cell = _sums_by_cell(s, r, highest, blocks)
    count = 1 << int(np.ceil(np.log2(OVERSAMPLING * sums.shape[1])))
    k = 2.0 * np.pi * np.fft.rfftfreq(count, cell)
    spectra = np.fft.rfft(sums, count)
    energy = (np.abs(spectra) ** 2).sum(axis=0)
    share = np.abs(spectra.sum(axis=0)) ** 2 / np.where(energy > 0.0, blocks * energy, np.inf)
    share[(k < lowest) | (k > highest)] = 0.0
    best = int(share.argmax())
    if _false_alarm(share[best], blocks, (highest - lowest) / (2.0 * np.pi) * float(s.std())) > false_alarm:
        return None
    if whole:
        return float(max(round(k[best]), 1))
    at, total = origin + cell * np.arange(sums.shape[1]), sums.sum(axis=0)
    near = minimize_scalar(lambda one: -(np.abs(np.exp(-1j * one * at) @ total) ** 2), bounds=k[[best - 1, best + 1]])
    return float(near.x)


def _sums_by_cell(s: Array, r: Array, highest: float, blocks: int) -> tuple[Array, float, float]:
    """Sums of a residual in blocks of time and cells of position, (blocks, cells); the first cell, and their width."""
    cell = np.pi / (OVERSAMPLING * highest)
    origin = float(s.min())
    place = np.rint((s - origin) / cell).astype(np.intp)
    cells = int(place.max()) + 1
    block = np.arange(len(s)) * blocks // len(s)
    sums = np.bincount(block * cells + place, weights=r, minlength=blocks * cells)
    return np.asarray(sums.reshape(blocks, cells), dtype=np.float64), origin, cell


def _false_alarm(share: float, blocks: int, width: float) -> float:
    """Probability that noise has a peak as large anywhere, for ``width`` = range of frequencies times deviation."""
    single = (1.0 - min(float(share), 1.0)) ** (blocks - 1)
    if single == 0.0:
        return 0.0
    crossings = np.sqrt(4.0 * np.pi) * width * single * np.sqrt(-np.log(single))
    return float(1.0 - (1.0 - single) * np.exp(-crossings))


def _left_by(found: list[float], s: Array, r: Array) -> Array:
    """What a constant and the waves found so far do not explain."""
    columns = [np.ones_like(s), *(wave(k * s) for k in found for wave in (np.cos, np.sin))]
    x = np.stack(columns, axis=1)
    return np.asarray(r - x @ np.linalg.lstsq(x, r)[0])

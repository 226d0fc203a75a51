"""Whether machines differ by more than their standard errors, and whether one changes with time.

Sources: Cochran 1954 (test of homogeneity); DerSimonian and Laird 1986 (variance between); Birge 1932 (standard errors
that scatter shows to be too small are stretched by it).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from casysid.arrays import Array

LEVEL = 0.95


@dataclass(frozen=True)
class Difference:
    """How a quantity differs over machines.

    Attributes:
        told: Machines whose data tell it.
        mean: Weighted by certainty.
        between: Standard deviation of the machines' true values, their errors taken off; 0 where those explain all.
        chance: Probability that equal machines scatter so much.
    """

    told: int
    mean: float
    between: float
    chance: float


@dataclass(frozen=True)
class Drift:
    """How a quantity changes with the order of recordings.

    Attributes:
        told: Recordings that tell it.
        slope: By recording.
        low: Lower end of the slope's 95 % interval.
        high: Upper end.
    """

    told: int
    slope: float
    low: float
    high: float


def difference(values: Array, std: Array) -> Difference | None:
    """Of machines with ``values`` and standard errors ``std``, shape (n,) each; None where fewer than two tell."""
    kept = _told(values, std)
    x, w = values[kept], std[kept] ** -2.0
    if len(x) < 2:
        return None
    mean = float(w @ x / w.sum())
    scatter, freedom = float(w @ (x - mean) ** 2), len(x) - 1
    excess = max(scatter - freedom, 0.0) / float(w.sum() - w @ w / w.sum())
    return Difference(len(x), mean, float(np.sqrt(excess)), float(chi2.sf(scatter, freedom)))


def drift(values: Array, std: Array) -> Drift | None:
    """Of recordings in their order, shape (n,) each; None where fewer than three tell the quantity."""
    kept = _told(values, std)
    x, t, w = values[kept], np.flatnonzero(kept).astype(np.float64), std[kept] ** -2.0
    if len(x) < 3:
        return None
    t = t - w @ t / w.sum()
    slope = float(w @ (t * x) / (w @ t**2))
    left = x - w @ x / w.sum() - slope * t
    freedom = len(x) - 2
    stretch = max(float(w @ left**2) / freedom, 1.0)
    half = float(student.ppf(0.5 + LEVEL / 2.0, freedom) * np.sqrt(stretch / (w @ t**2)))
    return Drift(len(x), slope, slope - half, slope + half)


def _told(values: Array, std: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    return np.asarray(np.isfinite(values) & np.isfinite(std) & (std > 0.0))

"""Averages over short overlapping windows: a low-pass for both sides of a linear equation, with few rows left.

``tau = Y θ`` holds at every instant, and so do its averages. Averaging both sides alike removes torque noise above a
band and biases nothing, whatever the regressor holds: Coulomb friction's jumps are averaged as the measured torque's
are. The windows are cubic B-splines, whose gain ``sinc(f h)⁴`` is one half at the cut-off for a spacing ``h`` of 0.32
periods, and 4 % at twice it.

Source: the parallel low-pass and decimation of the field (Gautier 1997), its window a B-spline.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.interpolate import BSpline

from casysid.arrays import Array

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
        time = self.time[samples]
        span = float(time[-1] - time[0])
        windows = max(int(np.ceil(span * self.cutoff / SPACING)), 1)
        spacing = max(span, 1e-12) / windows
        knots = time[0] + spacing * np.arange(-DEGREE, windows + DEGREE + 1)
        weights = BSpline.design_matrix(np.clip(time, time[0], knots[-DEGREE - 1]), knots, DEGREE).T.tocsr()
        total = np.asarray(weights.sum(axis=1)).ravel()
        kept = total > SMALLEST_SHARE * total.max()
        return sparse.diags_array(1.0 / total[kept]) @ weights[kept]

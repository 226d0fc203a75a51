"""When a joint stands: friction then holds it with any torque up to the break-away, which no model of motion explains.

Stands are short where friction only delays a joint that turns round, so they are looked for in slopes of the logged
positions, over the shortest windows in which noise is small beside the joint's speed, whatever the equations' low-pass.
A joint that turns round under the acceleration ``a`` is slower than ``s`` for ``2s/a``, and slower than ``3s`` for
three times as long; one that stands is so for nearly equal times. That tells them apart at any acceleration.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import correlate1d

from casysid.arrays import Array

NOISE_MARGIN = 4.0
"""A stand shows as a slope of less than this many standard deviations of the slope's noise."""
SPEED_SHARE = 0.05
"""Windows are so long that this is less than such a share of the joint's root mean square speed."""
CREEP_SHARE = 0.01
"""Slower than this share of it counts as standing even without noise."""
WIDER = 3.0
LONGEST_RATIO = 1.6
"""A stand is slower than ``WIDER`` thresholds for at most so many times as long as slower than one; a turn, for three
times as long, and a joint that nearly stops and goes on, for the root of it."""
FEWEST_SAMPLES = 5

Mask = npt.NDArray[np.bool_]


def standing(position: Array, rate: float, noise: Array, speed: Array, longest: float) -> Mask:
    """Which samples find a joint standing, shape (N, n).

    Args:
        position: One column a joint, evenly sampled, shape (N, n).
        rate: Of the samples [Hz].
        noise: Standard deviation of the position's noise, shape (n,).
        speed: Root mean square speed of each joint, shape (n,).
        longest: No window is longer [s].
    """
    stands = np.empty(position.shape, dtype=bool)
    for k, (column, sigma, usual) in enumerate(zip(position.T, noise, speed, strict=True)):
        samples = _window(sigma * rate, usual, int(longest * rate))
        kernel = np.arange(samples) - (samples - 1) / 2.0
        energy = float(kernel @ kernel)
        slope = correlate1d(column, kernel * (rate / energy), mode="nearest")
        threshold = max(NOISE_MARGIN * sigma * rate / np.sqrt(energy), CREEP_SHARE * usual)
        stands[:, k] = _held(np.abs(slope), threshold, samples)
    return stands


def _window(noise: float, speed: float, most: int) -> int:
    """Samples, an odd number, over which a slope's noise is as small as wanted; ``noise`` times rate, [rad/s]."""
    most = max(most, FEWEST_SAMPLES)
    relative = NOISE_MARGIN * noise / max(SPEED_SHARE * speed, NOISE_MARGIN * noise / most**1.5, 1e-300)
    return int(np.clip(np.cbrt(12.0 * relative**2), FEWEST_SAMPLES, most)) | 1


def _held(slope: Array, threshold: float, fewest: int) -> Mask:
    """Samples in runs below the wider threshold that are nearly all below the threshold, too."""
    slow = slope <= WIDER * threshold
    run = np.cumsum(slow & ~np.append(False, slow[:-1])) * slow  # number of the run, 0 outside
    length = np.bincount(run)
    still = np.bincount(run, weights=slope <= threshold)
    is_stand = (still >= fewest) & (length <= LONGEST_RATIO * still)
    is_stand[0] = False
    return np.asarray(is_stand[run])

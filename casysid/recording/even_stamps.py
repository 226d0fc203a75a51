"""Time stamps that jitter although the samples were taken evenly, as a logger writes that stamps what it receives.

Which of the two jitters, the samples or the stamps, the positions tell: a smooth motion is a smooth function of the
times at which it was measured. Each position is compared with the cubic through its four neighbours, once at the stamps
and once at even steps; whichever leaves less is nearer to the truth.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.signal import savgol_filter

from casysid.arrays import Array
from casysid.errors import CasysidWarning
from casysid.recording.recording import Recording
from casysid.recording.source import BATCH, Source

WORTH = 0.05
"""Fall of what the cubics leave, in its logarithm over all channels, for which stamps are changed."""
CLEAR = 2.0
"""And in standard errors of its mean over blocks of time."""
BLOCKS = 20
"""Of time."""
WINDOW = 101
"""Samples over which steps count as even: jitter sinks to a tenth, the drift of a clock stays."""
MISSING = 1.8
"""Median steps beyond which a sample is missing, which makes two, and a new run begins."""


def with_even_stamps(recording: Recording) -> Recording | None:
    """The recording with its stamps smoothed over each run of samples; None where the stamps are the better times.

    Args:
        recording: With or without time.
    """
    if recording.time is None or len(recording) < BLOCKS * 10:
        return None
    steps = np.diff(recording.time)
    even = steps <= MISSING * np.median(steps)
    if np.ptp(steps[even]) == 0.0 or not _are_noisier(recording.time, recording.position, even):
        return None
    edges = [0, *(np.flatnonzero(~even) + 1).tolist(), len(recording)]
    time = np.concatenate([_smoothed(recording.time[first:last]) for first, last in pairwise(edges)])
    return None if (np.diff(time) <= 0.0).any() else dataclasses.replace(recording, time=time)


def evened(recordings: Sequence[Source]) -> tuple[Source, ...]:
    """Recordings of no more than a batch of samples with their stamps made even where that is right, and said."""
    return tuple(_evened(one) if one.has_time and len(one) <= BATCH else one for one in recordings)


def _evened(recording: Source) -> Source:
    log = recording.in_memory()
    even = with_even_stamps(log)
    if even is None:
        return recording
    assert even.time is not None
    assert log.time is not None
    warnings.warn(
        f"{recording.label}: time stamps jitter by {1e3 * float(np.std(even.time - log.time)):.2g} ms although the "
        "samples were taken evenly: the positions are smoother so. The stamps were smoothed; check how they are made",
        CasysidWarning,
        stacklevel=4,
    )
    return even


def _are_noisier(time: Array, position: Array, even: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> bool:
    """Whether even steps leave positions clearly smoother than the stamps do."""
    fresh = even & (np.diff(position, axis=0) != 0.0).any(axis=1)
    together = fresh[:-3] & fresh[1:-2] & fresh[2:-1] & fresh[3:]
    index = np.arange(len(time), dtype=np.float64)
    left = [_left_by_cubics(times, position)[together] ** 2 for times in (time, index)]
    if len(left[0]) < BLOCKS:
        return False
    parts = [np.array([part.mean(axis=0) for part in np.array_split(one, BLOCKS)]) for one in left]
    told = (parts[0] > 0.0) & (parts[1] > 0.0)
    gains = 0.5 * np.log(np.where(told, parts[0], 1.0) / np.where(told, parts[1], 1.0)).sum(axis=1)
    return bool(gains.mean() > max(WORTH, CLEAR * gains.std(ddof=1) / np.sqrt(BLOCKS)))


def _left_by_cubics(time: Array, position: Array) -> Array:
    """What the cubic through its neighbours leaves of each inner position, in units of one sample's noise, (N - 4, n).

    Source: Lagrange's formula.
    """
    places = np.arange(2, len(time) - 2)
    neighbours = np.stack([places + k for k in (-2, -1, 1, 2)], axis=1)
    T = time[neighbours] - time[places, None]
    differences = T[:, :, None] - T[:, None, :]
    weights = np.stack(
        [np.prod(-np.delete(T, k, 1) / np.delete(differences[:, k], k, 1), axis=1) for k in range(4)], axis=1
    )
    left = position[places] - np.einsum("nk,nkc->nc", weights, position[neighbours])
    return np.asarray(left / np.sqrt(1.0 + np.sum(weights**2, axis=1))[:, None])


def _smoothed(time: Array) -> Array:
    """The stamps of a run on straight lines over windows."""
    index = np.arange(len(time), dtype=np.float64)
    if len(time) < 3:
        return time
    slope, start = np.polyfit(index, time - time[0], 1)
    straight = time[0] + start + slope * index
    if len(time) <= WINDOW:
        return np.asarray(straight)
    return np.asarray(straight + savgol_filter(time - straight, WINDOW, 1))

"""The band of frequencies in which equations are fitted and errors are told, derived from the motion alone.

Friction and inertia answer to the motion, so the band is a multiple of the motion's own: that of 99.9 % of the
positions' energy, of all channels together. Noise has no vote (only lines of the spectrum above the noise floor count),
nor has a joint that stands (its energy is nothing beside the others'). No torque error is looked at: a cut-off that is
searched by it runs to where the error looks small, and adds its own scatter.

Noise of the positions has a say in one way: where much of it would pass, it attenuates inertias by its share of the
accelerations' energy. There the positions are smoothed at what leaves accelerations best
(:func:`casysid.signals.cutoff_of`), and equations reach no further.

Wide bands are safe where the equations near rest, whose friction turns round or has not broken loose, have a noise of
their own, and where friction before sliding is part of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.recording import PositionSpectrum, Source
from casysid.signals import cutoff_of

ENERGY = 0.999
"""Share of the positions' energy that is motion: the rest is a thirtieth of its amplitude."""
EQUATIONS_IN_MOTION = 6.0
"""Cut-off of the equations over the motion's band. Accelerations and products of velocities reach twice the band, the
turns of friction further; measured by ``scripts/benchmark_population.py`` beside 3 and 12."""
SMOOTHING_IN_EQUATIONS = 2.0
"""Cut-off of the positions' smoothing over the equations': the spline is 1.5 % off there, the average half."""
HIGHEST_SHARE_OF_RATE = 0.2
"""Of the equations' cut-off in the sampling rate: the smoothing's is then below half of it."""
LOWEST_PERIODS = 4.0
"""Periods of the equations' cut-off in a recording at least: fewer windows than that are no average."""
CHANCE_LINES = 3.0
"""Lines of noise exceed ``ln n`` times their mean by so much in one recording of twenty."""


@dataclass(frozen=True, eq=False)
class BandChoice:
    """Cut-offs and why they were taken.

    Attributes:
        motion_band: Frequency below which nearly all of the motion lies [Hz]; 0 when samples have no time.
        cutoff: Up to which equations are fitted and errors told [Hz]; None when samples are taken as logged.
        reason: In words.
        errors: Up to which errors are told, where a given cut-off is another [Hz].
        noise_limit: Highest cut-off of the positions' smoothing that their noise allows [Hz].
    """

    motion_band: float
    cutoff: float | None
    reason: str
    errors: float | None = None
    noise_limit: float = np.inf

    @property
    def smoothing(self) -> float | None:
        """Cut-off of the positions' smoothing [Hz]."""
        return None if self.cutoff is None else min(SMOOTHING_IN_EQUATIONS * self.cutoff, self.noise_limit)

    def to_json(self) -> dict[str, object]:
        """Plain numbers and words."""
        return {
            "hz": self.cutoff,
            "motion_band_hz": self.motion_band,
            "smoothing_hz": self.smoothing,
            "errors_hz": self.errors,
            "reason": self.reason,
        }


def choose_band(recordings: Sequence[Source], cutoff: float | None = None) -> BandChoice:
    """The band of recordings; a cut-off that is given is taken for the equations, errors keep the motion's.

    Args:
        recordings: What is fitted.
        cutoff: Given for the equations [Hz].
    """
    if not all(recording.has_time for recording in recordings):
        return BandChoice(0.0, None, "samples without time are taken as logged")
    motion = float(np.median([motion_band(recording.spectrum) for recording in recordings]))
    highest = HIGHEST_SHARE_OF_RATE * min(recording.rate for recording in recordings)
    lowest = min(LOWEST_PERIODS / max(recording.duration for recording in recordings), highest)
    derived = float(np.clip(EQUATIONS_IN_MOTION * motion, lowest, highest))
    words = f"{EQUATIONS_IN_MOTION:g} times the motion's band of {motion:.3g} Hz"
    if derived != EQUATIONS_IN_MOTION * motion:
        words = f"the nearest that rate and duration allow to {words}"
    limit = _noise_limit(recordings, derived)
    if limit < derived:
        derived, words = limit, f"where the positions' noise leaves accelerations best, below {words}"
    if cutoff is not None:
        return BandChoice(motion, cutoff, "given", derived, _noise_limit(recordings, cutoff))
    return BandChoice(motion, derived, words, derived, limit)


def _noise_limit(recordings: Sequence[Source], cutoff: float) -> float:
    """Cut-off of the smoothing that is best for positions so noisy, inf where noise is light [Hz]."""
    usual = SMOOTHING_IN_EQUATIONS * cutoff
    limit = float(np.median([cutoff_of(recording.spectrum, usual) for recording in recordings]))
    return limit if limit < usual else np.inf


def motion_band(spectrum: PositionSpectrum) -> float:
    """Frequency below which nearly all energy of the positions lies [Hz]; 0 where nothing moves."""
    energy = motion_power(spectrum).sum(axis=1)
    total = float(energy.sum())
    if total <= 0.0:
        return 0.0
    return float(spectrum.frequency[np.searchsorted(np.cumsum(energy), ENERGY * total)])


def motion_power(spectrum: PositionSpectrum) -> Array:
    """The spectrum less its noise floor, where it clearly rises above it, else zero, shape (F, channels).

    The floor is the median over the upper half. Of averaged periodograms, lines of noise scatter the less.
    """
    power, lines = spectrum.power, len(spectrum.power)
    upper = power[lines // 2 :]
    floor = np.median(upper, axis=0) / _median_of_mean(spectrum.segments)
    highest = 1.0 + (np.log(max(lines, 2)) + CHANCE_LINES - 1.0) / np.sqrt(spectrum.segments)
    return np.where(power > highest * floor, power - floor, 0.0)


def _median_of_mean(segments: float) -> float:
    """Median over mean of noise lines, of the gamma distribution with so many segments (Wilson and Hilferty 1931)."""
    return float(np.log(2.0)) if segments <= 1.0 else float((1.0 - 1.0 / (9.0 * segments)) ** 3)

"""What one scan found of a log, without what nobody asks for: it crosses to the workers and back.

A spectrum has up to 32 769 lines of every channel, nearly all of them noise. Of lines that noise alone reaches, only
the median over the upper half is ever used (:mod:`casysid.signals.noise`, :mod:`casysid.identification.tuning.band`).
Flattened so that this median stays, they compress to nothing, and every answer is the same to the last bit.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from casysid.arrays import Array, frozen
from casysid.identification.tuning.band import motion_power
from casysid.recording import PositionSpectrum, RecordingFile
from casysid.signals.noise import seen

MARKS = 64
"""Rows whose times are kept, to find others by: where a recording is cut, so much less than all of it is read."""


def compact(recording: RecordingFile) -> RecordingFile:
    """The recording, its spectrum flattened and its marks thinned."""
    facts = recording.facts
    step = max(-(-len(facts.mark_rows) // MARKS), 1)
    return dataclasses.replace(
        recording,
        facts=dataclasses.replace(
            facts,
            mark_rows=facts.mark_rows[::step].copy(),
            mark_times=facts.mark_times[::step].copy(),
            spectrum=None if facts.spectrum is None else flattened(facts.spectrum),
        ),
    )


def flattened(spectrum: PositionSpectrum) -> PositionSpectrum:
    """Lines that noise alone reaches set to 0 in the lower half and to the median, or around it, in the upper."""
    power = np.array(spectrum.power)
    noise = ~(seen(spectrum) | (motion_power(spectrum) > 0.0))
    half = len(power) // 2
    for channel in range(power.shape[1]):
        lower, upper = power[:half, channel], power[half:, channel]
        lower[noise[:half, channel]] = 0.0
        upper[:] = np.where(noise[half:, channel], _around_median(upper), upper)
    fields = {field.name: getattr(spectrum, field.name) for field in dataclasses.fields(spectrum)}
    return RuledSpectrum(**fields | {"power": frozen(power)})


def _around_median(values: Array) -> Array:
    """Values below the median as the one next to it from below, those above as the next from above."""
    ordered = np.sort(values)
    below, above = ordered[(len(values) - 1) // 2], ordered[len(values) // 2]
    return np.asarray(np.where(values <= below, below, above))


@dataclass(frozen=True, eq=False, kw_only=True)
class RuledSpectrum(PositionSpectrum):
    """A spectrum that travels without its frequencies where they are ``k / c``."""

    def __reduce__(self) -> tuple[Any, ...]:
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        period = _period(self.frequency)
        if period is not None:
            fields["frequency"] = None
        return _unpacked, (period, fields)


def _unpacked(period: float | None, fields: dict[str, Any]) -> RuledSpectrum:
    if period is not None:
        fields["frequency"] = np.arange(len(fields["power"])) / period
    return RuledSpectrum(**fields)


def _period(frequency: Array) -> float | None:
    """The c of frequencies that are ``k / c`` to the last bit; None where none is found within rounding."""
    if len(frequency) < 2:
        return None
    guess = 1.0 / frequency[1]
    for period in (guess, np.nextafter(guess, 0.0), np.nextafter(guess, np.inf)):
        if np.array_equal(np.arange(len(frequency)) / period, frequency):
            return float(period)
    return None

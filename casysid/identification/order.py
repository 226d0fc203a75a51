"""One order of recordings, whichever they are given in: sums of the same numbers are the same to the last bit then."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from casysid.recording import Source

T = TypeVar("T")


def places_by_content(recordings: Sequence[Source]) -> tuple[int, ...]:
    """Places of recordings, sorted by what is in them: length, clock, ranges and torques, no names."""
    if len(recordings) < 2:
        return tuple(range(len(recordings)))
    return tuple(sorted(range(len(recordings)), key=lambda place: _content(recordings[place])))


def as_given(values: Sequence[T], places: Sequence[int]) -> tuple[T, ...]:
    """One value of each sorted recording, in the order in which the recordings were given.

    What is not one of each, such as excerpts of long recordings, stays as it is.
    """
    if len(values) != len(places):
        return tuple(values)
    found = dict(zip(places, values, strict=True))
    return tuple(found[place] for place in range(len(places)))


def _content(recording: Source) -> bytes:
    summary = recording.summary()
    figures = [
        *(float(len(recording)), recording.start, summary.duration, summary.rate),
        *(end for ends in summary.position_range.values() for end in ends),
        *summary.torque_peak.values(),
        *summary.torque_rms.values(),
    ]
    return np.array(figures).tobytes()

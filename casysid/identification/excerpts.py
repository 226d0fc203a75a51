"""Excerpts of long recordings, for choices that a part of the samples settles as well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from casysid.recording import Recording

ENOUGH = 80_000
"""So many samples in all settle cut-offs, widths and delays."""
PIECES = 4
"""Stretches that are taken of a recording, evenly over its time."""


def excerpts(recordings: Sequence[Recording], enough: int = ENOUGH) -> tuple[Recording, ...]:
    """The recordings themselves if they have no more than ``enough`` samples in all, else stretches of the long ones.

    Every recording keeps its share of ``enough``; samples without time are taken evenly over all.

    Args:
        recordings: At least one.
        enough: Samples wanted in all.
    """
    if sum(map(len, recordings)) <= enough:
        return tuple(recordings)
    share = enough // len(recordings)
    return tuple(piece for recording in recordings for piece in _pieces(recording, share))


def _pieces(recording: Recording, samples: int) -> list[Recording]:
    if len(recording) <= samples:
        return [recording]
    if recording.time is None:
        return [recording.selected(np.linspace(0, len(recording) - 1, samples).astype(np.intp))]
    length = samples // PIECES
    starts = np.linspace(0, len(recording) - length, PIECES).astype(np.intp)
    return [recording.selected(slice(start, start + length)) for start in starts.tolist()]

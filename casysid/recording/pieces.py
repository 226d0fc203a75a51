"""A recording piece by piece, each with the samples beside it that a filter wants to see."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from casysid.recording.recording import Recording, joined
from casysid.recording.source import BATCH, Source, Stretch


class Piece(NamedTuple):
    """Consecutive samples of one stretch.

    Attributes:
        recording: The piece's own samples and those beside them.
        core: Which of its rows are its own; the cores of all pieces hold every sample of the source once.
        first: Row of the source at which the core starts.
        stretch: All of the stretch: its rows in the source, and its ends in time [s].
    """

    recording: Recording
    core: slice
    first: int
    stretch: Stretch


def pieces(
    source: Source, overlap: float, *, rows: int = BATCH, gap: float | None = None, multiple: int = 1
) -> Iterator[Piece]:
    """Consecutive pieces, none over a gap, with samples beside the core on either side as far as the stretch has them.

    These reach at least ``overlap`` seconds before the core's first sample and after the next core's first one, and
    are at least as many as the source usually has in that time, so holes that are no gaps count for nothing. In memory
    are no more than ``rows``, those beside them, and a batch.

    Args:
        source: With time.
        overlap: [s].
        rows: Of a core; the last core of a stretch may have up to twice as many.
        gap: Longer steps of time part stretches [s]; None: five median steps.
        multiple: The number of rows in a core is a multiple of it, but for a stretch's last.
    """
    fewest = math.ceil(overlap * source.rate) if overlap > 0.0 else 0
    rows = max(rows // multiple, 1) * multiple
    window = _Window(source.batches())
    for stretch in source.stretches(gap):
        count = max((stretch.rows.stop - stretch.rows.start) // rows, 1)
        edges = [stretch.rows.start + k * rows for k in range(count)] + [stretch.rows.stop]
        window.keep(stretch.rows.start, stretch.rows.start)
        for first, last in pairwise(edges):
            before = window.before(first, overlap, fewest, stretch.rows.start)
            window.keep(before, last)
            after = window.after(last, overlap, fewest, stretch.rows.stop)
            yield Piece(window.rows(before, after), slice(first - before, last - before), first, stretch)


class _Window:
    """A part of the samples that moves on through all of them."""

    def __init__(self, batches: Iterator[Recording]) -> None:
        self._batches = batches
        self._parts: list[Recording] = []
        self._first = self._stop = 0

    def keep(self, first: int, last: int) -> None:
        """Have the rows from ``first`` up to before ``last``, and none before."""
        while self._stop < last:
            self._append()
        while self._parts and self._first + len(self._parts[0]) <= first:
            self._first += len(self._parts.pop(0))

    def _append(self) -> None:
        part = next(self._batches)
        self._parts.append(part)
        self._stop += len(part)

    def rows(self, first: int, last: int) -> Recording:
        """Some rows that are there."""
        found, row = [], self._first
        for part in self._parts:
            inside = slice(max(first - row, 0), max(min(last - row, len(part)), 0))
            if inside.stop > inside.start:
                found.append(part.selected(inside))
            row += len(part)
        return joined(found)

    def before(self, row: int, overlap: float, fewest: int, start: int) -> int:
        """The row from which on there is enough before ``row``; no earlier than ``start``."""
        if row == start or not overlap:
            return row
        time = self.rows(start if start >= self._first else self._first, row + 1).time
        assert time is not None
        enough = int(np.searchsorted(time, time[-1] - overlap, side="right")) - 1
        return max(row + 1 - len(time) + min(enough, len(time) - 1 - fewest), start, self._first)

    def after(self, row: int, overlap: float, fewest: int, stop: int) -> int:
        """The row up to before which there is enough from ``row`` on; no later than ``stop``."""
        if not overlap or row == stop:
            return row
        until = min(row + max(fewest, 1), stop)
        self.keep(self._first, until)
        moment = self._time(row) + overlap
        while self._time(self._stop - 1) < moment and self._stop < stop:
            self._append()
        times = self.rows(row, min(self._stop, stop)).time
        assert times is not None
        return max(until, min(row + int(np.searchsorted(times, moment)) + 1, stop))

    def _time(self, row: int) -> float:
        time = self.rows(row, row + 1).time
        assert time is not None
        return float(time[0])

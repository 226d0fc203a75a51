"""What is wrong with the rows of a log, from one scan, and the next repair that it calls for."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from casysid.arrays import Array
from casysid.readers.columns import Layout
from casysid.readers.messages import listing
from casysid.readers.repairs import (
    LARGEST,
    ROW,
    WINDOW,
    Columns,
    Glitches,
    Repairs,
    complete_rows,
    same_as_before,
    stray_stamps,
)

MOSTLY = 0.5
"""Of the rows that hold something of what is used: if more are incomplete, no log was left, and it is refused."""
COARSE = 0.05
"""More stamps than this repeat the one before: the clock is coarser than the rows; else rows came twice."""
RARELY = 0.01
"""Glitches are rarer: of more the model's limits, or the units, are wrong."""
REGULAR = 0.8
"""Of the runs of equal rows, so many have the usual length, give or take one: the log is faster than the samples."""
LONGEST_RUN = 1 << 12
KEPT_STEPS = 1 << 12


class Survey:
    """Faults of rows that come batch by batch, already repaired as far as is known."""

    def __init__(self, layout: Layout, glitches: Glitches) -> None:
        self._layout, self._glitches = layout, glitches
        self.rows = self.nothing = self.incomplete = 0
        self.empty = dict.fromkeys(layout.used, 0)
        self.first: dict[str, int] = {}
        self.back = self.same = self.stray = self.glitched = self.equal = 0
        self._furthest = self._moved_rows = self._moved_stamps = 0.0
        self._runs, self._run = np.zeros(LONGEST_RUN + 1, dtype=np.intp), 1
        self._steps = np.empty(0)
        self._held: Columns | None = None

    def add(self, columns: Columns) -> None:
        """Rows that follow those added before."""
        rows = len(columns[ROW])
        if not rows:
            return
        self.rows += rows
        self._add_finite(columns)
        time = self._layout.time
        held = self._held
        joined = columns if held is None else {k: np.concatenate([held[k], columns[k]]) for k in columns}
        with np.errstate(invalid="ignore", over="ignore"):
            self._add_runs(joined, rows)
            if time is not None:
                self._add_stamps(joined, columns, time)
        self._held = {name: values[-2:] for name, values in joined.items()}

    def _add_finite(self, columns: Columns) -> None:
        used = self._needed()
        good = complete_rows(columns, used)
        if good.all():
            return
        holds = np.zeros(len(good), dtype=np.bool_)
        for name in used:
            bad = ~np.isfinite(columns[name]) | ((np.abs(columns[name]) > LARGEST) & (name != self._layout.time))
            self.empty[name] += int(np.count_nonzero(bad))
            if name != self._layout.time:
                holds |= ~bad
            if bad.any():
                self.first.setdefault(name, int(columns[ROW][int(np.argmax(bad))]))
        self.nothing += int(np.count_nonzero(~holds))
        self.incomplete += int(np.count_nonzero(~good & holds))

    def _needed(self) -> tuple[str, ...]:
        """Columns that must hold numbers, the stamps first."""
        clock = () if self._layout.time is None else (self._layout.time,)
        rest = [name for name in self._layout.used if name not in self._layout.unmeasured]
        others = () if self._layout.clock is None else self._layout.clock.columns
        return (*clock, *(name for name in rest if name not in others))

    def _add_runs(self, joined: Columns, rows: int) -> None:
        same = same_as_before(joined, self._layout.time)[-rows:]
        if not len(same):
            return
        self.equal += int(np.count_nonzero(same))
        ends = np.flatnonzero(~same)
        if not len(ends):
            self._run += len(same)
            return
        lengths = np.diff(ends, prepend=-1)
        lengths[0] += self._run - 1
        self._runs += np.bincount(np.minimum(lengths, LONGEST_RUN), minlength=LONGEST_RUN + 1)
        self._run = len(same) - int(ends[-1])

    def _add_stamps(self, joined: Columns, columns: Columns, time: str) -> None:
        self._note(columns[ROW], columns[time], joined[time])
        stamps = joined[time]
        steps = np.diff(stamps)[-len(columns[ROW]) :]
        if len(self._steps) < KEPT_STEPS:
            self._steps = np.concatenate([self._steps, steps[steps > 0.0][:KEPT_STEPS]])
        self.back += int(np.count_nonzero(steps < 0.0))
        self.same += int(np.count_nonzero(steps == 0.0))
        self.stray += int(np.count_nonzero(stray_stamps(stamps, WINDOW * self.step))) if self.step else 0
        if not (steps < 0.0).any():
            self.glitched += int(np.count_nonzero(self._glitches.found(joined, time)))
            self.glitched += len(joined[ROW]) == len(columns[ROW]) and self._glitches.first(joined, time)
            return
        order = np.argsort(stamps, kind="stable")
        places = np.empty(len(order), dtype=np.intp)
        places[order] = np.arange(len(order))
        self._furthest = max(self._furthest, float(np.abs(places - np.arange(len(order))).max()))
        position = np.stack([joined[name] for name in self._layout.position], axis=1)
        self._moved_rows += float(np.nansum(np.abs(np.diff(position[order], axis=0))))
        self._moved_stamps += float(np.nansum(np.abs(np.diff(position, axis=0))))

    def _note(self, rows: Array, stamps: Array, joined: Array) -> None:
        steps = np.diff(joined)
        for word, found in (("same", steps == 0.0), ("back", steps < 0.0)):
            if found.any() and word not in self.first:
                self.first[word] = int(rows[max(int(np.argmax(found)) + 1 - (len(joined) - len(stamps)), 0)])

    @property
    def step(self) -> float:
        """Median of the first steps that go forward [s]; 0 while there is none."""
        return float(np.median(self._steps)) if len(self._steps) else 0.0

    def emptied(self) -> tuple[str, ...]:
        """Columns that hold nothing throughout."""
        return tuple(name for name in self._needed() if self.rows and self.empty[name] == self.rows)

    def repaired(self, repairs: Repairs, place: Callable[[int], str]) -> tuple[Repairs, str] | None:
        """The repairs with one more, and what to say of it; None when the rows call for none.

        Args:
            repairs: Those that were made.
            place: Says where a row of the file stands.
        """
        for search in (self._incomplete, self._stray, self._order, self._repeats, self._hold, self._spikes):
            found = search(repairs, place)
            if found is not None:
                return found
        return None

    def _incomplete(self, repairs: Repairs, place: Callable[[int], str]) -> tuple[Repairs, str] | None:
        some = self.rows - self.nothing
        if repairs.complete or not (self.nothing or self.incomplete) or self.incomplete > MOSTLY * some:
            return None
        counts = {name: self.empty[name] - self.nothing for name in self.empty if self.empty[name] > self.nothing}
        words = []
        if self.nothing:
            words.append(
                f"{self.nothing} of {self.rows} rows hold none of the columns that are used; they are left out"
            )
        if self.incomplete:
            name = next(iter(counts), self._layout.position[0])
            words.append(
                f"{self.incomplete} of {some} rows are incomplete or hold impossible numbers and are left out: "
                f"{listing([f'{column} {count}' for column, count in counts.items()], 6)}; "
                f"the first is {place(self.first[name])}"
            )
        return dataclasses.replace(repairs, complete=self._needed()), "; ".join(words)

    def _stray(self, repairs: Repairs, place: Callable[[int], str]) -> tuple[Repairs, str] | None:
        if repairs.stray_stamps is not None or not 0 < self.stray <= max(RARELY * self.rows, 1):
            return None
        return (
            dataclasses.replace(repairs, stray_stamps=WINDOW * self.step),
            f"{self.stray} single time stamps are far from those before and after them; their rows are left out",
        )

    def _order(self, repairs: Repairs, place: Callable[[int], str]) -> tuple[Repairs, str] | None:
        if repairs.sort or not self.back or self._furthest > WINDOW or self.back > MOSTLY * self.rows:
            return None
        words = f"time stamps are out of order {self.back} times, first in {place(self.first['back'])}"
        if self._moved_rows <= self._moved_stamps:
            return dataclasses.replace(repairs, sort=True), f"{words}; the rows are sorted by them"
        if repairs.stray_stamps == 0.0:
            return None
        return (
            dataclasses.replace(repairs, stray_stamps=0.0),
            f"{words}; positions are smoother as the rows stand, so rows with such a stamp are left out",
        )

    def _repeats(self, repairs: Repairs, place: Callable[[int], str]) -> tuple[Repairs, str] | None:
        if repairs.repeats is not None or not self.same or self.back or not self.step:
            return None
        at = place(self.first["same"])
        different = self.same - self.equal
        if self.same > COARSE * self.rows and different > MOSTLY * self.same:
            if self.same > self.rows * (1.0 - 1.0 / WINDOW):
                return None
            return (
                dataclasses.replace(repairs, repeats="spread", spacing=self.step),
                f"{self.same} of {self.rows} time stamps repeat the one before (first in {at}): the clock is coarser "
                "than the rows, which share the time from one stamp to the next evenly; write time with more digits",
            )
        return (
            dataclasses.replace(repairs, repeats="first"),
            f"{self.same} rows repeat the time stamp before (first in {at}); the first of each is kept",
        )

    def _hold(self, repairs: Repairs, place: Callable[[int], str]) -> tuple[Repairs, str] | None:
        runs = int(self._runs.sum())
        if repairs.held > 1 or not runs or self.back or self.same or self._layout.time is None:
            return None
        usual = int(np.searchsorted(np.cumsum(self._runs), 0.5 * runs))
        near = int(self._runs[max(usual - 1, 1) : usual + 2].sum())
        if usual < 2 or near < REGULAR * runs or runs < WINDOW // 10:
            return None
        return (
            dataclasses.replace(repairs, held=usual + max(usual // 2, 1)),
            f"rows repeat the one before in runs of {usual}: the log is {usual} times faster than the samples, of "
            "which the first row each is kept",
        )

    def _spikes(self, repairs: Repairs, place: Callable[[int], str]) -> tuple[Repairs, str] | None:
        if repairs.glitches is not None or not 0 < self.glitched <= max(RARELY * self.rows, 1) or self.back:
            return None
        return (
            dataclasses.replace(repairs, glitches=self._glitches),
            f"{self.glitched} single samples leap away from those before and after them, faster than ten times "
            "the joint's limit or beyond ten times its torque; their rows are left out",
        )

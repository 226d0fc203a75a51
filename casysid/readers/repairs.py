"""Everyday faults of logs mended while they are read: rows left out, put in order, or given stamps; none invented."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.readers.angles import NEAR, TURN

ROW = "\0row"
"""Key of the rows' places in the file, which travel with them."""
WINDOW = 100
"""Rows by which a stamp may be out of order: the usual queue of a recorder (``rosbag record``'s buffer by topic)."""
LARGEST = 1e9
"""Of any value but time, in SI units: a wind turbine's shaft carries 1e7 N m, a spindle at a million revolutions a
minute turns 1e9 rad in three hours."""

Columns = dict[str, Array]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Glitches:
    """What is too far from the sample before and the one after to be a motion.

    Attributes:
        speed: Beyond this both ways a position has leapt [rad/s, m/s], by column.
        step: And by more than this [rad, m].
        turns: Columns that may leap by a whole turn.
        torque: Beyond this a torque is none [N m, N], by column; its neighbours within a tenth of it.
    """

    speed: dict[str, float]
    step: float
    turns: tuple[str, ...]
    torque: dict[str, float]

    def first(self, columns: Columns, time: str) -> bool:
        """Whether the first row of a log is a glitch: some position leaps from it, and stays where it is then."""
        start = taken(columns, slice(0, 3))
        return any(leap[0] and not leap[1] for _, leap in self._leaps(start, time) if len(leap) == 2)

    def _leaps(self, columns: Columns, time: str) -> Iterator[tuple[Array, Mask]]:
        """Steps of each position, and which of them no joint makes."""
        step = np.diff(columns[time])
        for name, speed in self.speed.items():
            change = np.diff(columns[name])
            size = np.abs(change)
            if size.max(initial=0.0) > self.step:
                leap = (size > speed * step) & (size > self.step)
                yield change, leap & (np.abs(size - TURN) > NEAR) if name in self.turns else leap

    def found(self, columns: Columns, time: str) -> Mask:
        """Which rows but the first and the last are glitches, shape (N - 2,)."""
        bad = np.zeros(max(len(columns[time]) - 2, 0), dtype=np.bool_)
        for change, leap in self._leaps(columns, time):
            size = np.abs(change)
            across = np.abs(change[1:] + change[:-1])
            returns = (change[1:] * change[:-1] < 0.0) & (across < 0.5 * np.minimum(size[1:], size[:-1]))
            bad |= leap[1:] & leap[:-1] & returns
        for name, most in self.torque.items():
            size = np.abs(columns[name])
            if size.max(initial=0.0) > most:
                bad |= (size[1:-1] > most) & (np.maximum(size[2:], size[:-2]) <= 0.1 * most)
        return bad


@dataclass(frozen=True, kw_only=True)
class Repairs:
    """What is done to the rows of a log, in this order.

    Attributes:
        complete: Columns of which rows must hold finite numbers below :data:`LARGEST`; other rows are left out.
        stray_stamps: Rows whose stamp alone is out of order by more than so many seconds are left out; None: none is.
        sort: Whether rows are sorted by their stamps.
        repeats: Whether only the first of several rows with one stamp is kept, or they share the time to the next.
        spacing: Time that rows with one stamp share at most [s].
        held: Of rows that repeat the one before, every so many is kept; 1 keeps all.
        glitches: Rows that are left out.
    """

    complete: tuple[str, ...] = ()
    stray_stamps: float | None = None
    sort: bool = False
    repeats: Literal["first", "spread"] | None = None
    spacing: float = 0.0
    held: int = 1
    glitches: Glitches | None = None

    def apply(self, batches: Iterator[Columns], time: str | None) -> Iterator[Columns]:
        """Batches repaired; time is the column of stamps."""
        if self.complete:
            batches = _selected(batches, lambda columns: complete_rows(columns, self.complete))
        if time is not None and self.stray_stamps is not None:
            far = self.stray_stamps
            batches = _without(batches, lambda columns: stray_stamps(columns[time], far))
        if time is not None and self.sort:
            batches = _sorted(batches, time)
        if time is not None and self.repeats == "first":
            batches = _increasing(batches, time)
        if time is not None and self.repeats == "spread":
            batches = _spread(batches, time, self.spacing)
        if self.held > 1:
            batches = _unheld(batches, time, self.held)
        if time is not None and self.glitches is not None:
            glitches = self.glitches
            batches = _without(
                batches, lambda columns: glitches.found(columns, time), lambda columns: glitches.first(columns, time)
            )
        return batches


NONE = Repairs()


def complete_rows(columns: Columns, names: tuple[str, ...]) -> Mask:
    """Which rows hold finite numbers of a size that machines have."""
    good = np.ones(len(columns[names[0]]), dtype=np.bool_)
    for name in names:
        good &= np.isfinite(columns[name])
        if not name.startswith("\0") and not _is_time(name, names):
            good &= ~(np.abs(columns[name]) > LARGEST)
    return good


def _is_time(name: str, names: tuple[str, ...]) -> bool:
    return name == names[0]  # the stamps come first


def stray_stamps(time: Array, far: float) -> Mask:
    """Which stamps but the first and the last are far from both neighbours that are in order, shape (N - 2,)."""
    before, after = np.diff(time)[:-1], np.diff(time)[1:]
    return np.asarray((before * after < 0.0) & (before + after > 0.0) & (np.minimum(abs(before), abs(after)) > far))


def same_as_before(columns: Columns, time: str | None) -> Mask:
    """Which rows but the first repeat all but the stamp of the one before, shape (N - 1,)."""
    rows = len(columns[ROW])
    same = np.ones(max(rows - 1, 0), dtype=np.bool_)
    for name, values in columns.items():
        if name not in (ROW, time) and same.any():
            same &= values[1:] == values[:-1]
    return same


def taken(columns: Columns, rows: slice | npt.NDArray[Any]) -> Columns:
    """Some rows."""
    return {name: values[rows] for name, values in columns.items()}


def together(parts: list[Columns]) -> Columns:
    """Consecutive rows as one."""
    return parts[0] if len(parts) == 1 else {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _selected(batches: Iterator[Columns], keep: Callable[[Columns], Mask]) -> Iterator[Columns]:
    for columns in batches:
        good = keep(columns)
        yield columns if good.all() else taken(columns, good)


def _without(
    batches: Iterator[Columns],
    inner: Callable[[Columns], Mask],
    first: Callable[[Columns], bool] = lambda columns: False,
) -> Iterator[Columns]:
    """Without rows that ``inner`` finds between a first and a last one, and without the first of all if it is bad."""
    held: Columns | None = None
    start = True
    for columns in batches:
        joined = columns if held is None else together([held, columns])
        if start and len(joined[ROW]) < 3:
            held = joined
            continue
        if len(columns[ROW]):
            yield taken(joined, np.concatenate([[start and not first(joined)], ~inner(joined), [False]]))
            start, held = False, taken(joined, slice(-2, None))
    if held is not None:
        yield held if start else taken(held, slice(-1, None))


def _sorted(batches: Iterator[Columns], time: str) -> Iterator[Columns]:
    held: Columns | None = None
    for columns in batches:
        joined = columns if held is None else together([held, columns])
        joined = taken(joined, np.argsort(joined[time], kind="stable"))
        done = max(len(joined[ROW]) - WINDOW, 0)
        yield taken(joined, slice(0, done))
        held = taken(joined, slice(done, None))
    if held is not None:
        yield held


def _increasing(batches: Iterator[Columns], time: str) -> Iterator[Columns]:
    last = -np.inf
    for columns in batches:
        stamps = columns[time]
        if not len(stamps):
            continue
        steps = np.diff(stamps, prepend=last)
        last = stamps[-1]
        yield columns if (steps > 0.0).all() else taken(columns, steps > 0.0)


def _spread(batches: Iterator[Columns], time: str, spacing: float) -> Iterator[Columns]:
    held: Columns | None = None
    for columns in batches:
        joined = columns if held is None else together([held, columns])
        if not len(joined[ROW]):
            continue
        last = int(np.searchsorted(joined[time], joined[time][-1]))
        yield shared_time(taken(joined, slice(0, last)), time, spacing, float(joined[time][-1]))
        held = taken(joined, slice(last, None))
    if held is not None and len(held[ROW]):
        yield shared_time(held, time, spacing, float(held[time][-1]) + spacing)


def shared_time(columns: Columns, time: str, spacing: float, after: float) -> Columns:
    """Rows with one stamp evenly over the time to the next one, at most ``spacing``; ``after`` follows the last."""
    stamps = columns[time]
    starts = np.flatnonzero(np.diff(stamps, prepend=-np.inf) > 0.0)
    counts = np.diff(np.append(starts, len(stamps)))
    lengths = np.minimum(np.diff(np.append(stamps[starts], after)), spacing)
    place = np.arange(len(stamps)) - np.repeat(starts, counts)
    return {**columns, time: stamps + place * np.repeat(lengths / counts, counts)}


def _unheld(batches: Iterator[Columns], time: str | None, held: int) -> Iterator[Columns]:
    before: Columns | None = None
    run = 0
    for columns in batches:
        if not len(columns[ROW]):
            continue
        joined = columns if before is None else together([before, columns])
        same = same_as_before(joined, time)
        place = np.arange(len(same) + 1)
        starts = np.where(np.concatenate([[False], ~same]), place, -run)
        since = place - np.maximum.accumulate(starts)
        keep = since % held == 0
        run = int(since[-1])
        yield taken(columns, keep if before is None else keep[1:])
        before = taken(columns, slice(-1, None))

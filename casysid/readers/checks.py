"""Samples that cannot be used: each fault with the file, the column and the place of the first bad row."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.columns import Layout
from casysid.readers.messages import listing
from casysid.readers.repairs import LARGEST, ROW
from casysid.readers.statistics import FASTEST, Statistics
from casysid.robot import JointKind, Robot

FEWEST = 20
"""Fewer rows than this are no recording."""
LONGEST = 1e9
"""From the first sample to the last [s]: thirty years."""


class SampleChecks:
    """Refuses samples that are too few, not finite, not in time order, or all the same, once all batches were seen."""

    def __init__(self, place: Callable[[int], str], layout: Layout, source: str) -> None:
        self._place, self._layout, self._source = place, layout, source
        self._samples = 0
        self._bad: dict[str, tuple[int, int, float]] = {}
        self._far: dict[str, tuple[int, int, float]] = {}
        self._back = self._same = 0
        self._first_back: tuple[int, float, float] | None = None
        self._first_same: tuple[int, float] | None = None
        self._last_time = np.empty(0)
        self._low: dict[str, float] = {}
        self._high: dict[str, float] = {}

    @property
    def faulty(self) -> bool:
        """Whether figures of the samples would be meaningless."""
        return bool(self._bad or self._far or self._back or self._same)

    def add(self, columns: Mapping[str, Array]) -> None:
        """Rows that follow those added before."""
        rows = len(columns[self._layout.torque[0]])
        if not rows:
            return
        places = columns[ROW]
        for name in self._layout.used:
            if name in columns:
                self._add_finite(name, columns[name], places)
        if self._layout.time is not None:
            self._add_order(columns[self._layout.time], places)
        for name in self._layout.used:
            if name != self._layout.time and name in columns:
                self._add_magnitude(name, columns[name], places)
        for name in (*self._layout.position, *self._layout.torque):
            self._low[name] = min(self._low.get(name, np.inf), float(columns[name].min()))
            self._high[name] = max(self._high.get(name, -np.inf), float(columns[name].max()))
        self._samples += rows

    def _add_finite(self, name: str, values: Array, places: Array) -> None:
        finite = np.isfinite(values)
        if not finite.all():
            first = int(np.argmin(finite))
            count, row, value = self._bad.get(name, (0, int(places[first]), float(values[first])))
            self._bad[name] = (count + int(np.count_nonzero(~finite)), row, value)

    def _add_magnitude(self, name: str, values: Array, places: Array) -> None:
        if max(values.max(), -values.min()) > LARGEST:
            far = np.flatnonzero(np.abs(values) > LARGEST)
            first = int(far[0])
            count, row, value = self._far.get(name, (0, int(places[first]), float(values[first])))
            self._far[name] = (count + len(far), row, value)

    def _add_order(self, time: Array, places: Array) -> None:
        joined = np.concatenate([self._last_time, time])
        steps, skip = np.diff(joined), 1 - len(self._last_time)
        back, same = steps < 0.0, steps == 0.0
        if back.any() and self._first_back is None:
            k = int(np.argmax(back))
            self._first_back = (int(places[k + skip]), float(joined[k]), float(joined[k + 1]))
        if same.any() and self._first_same is None:
            k = int(np.argmax(same))
            self._first_same = (int(places[k + skip]), float(joined[k + 1]))
        self._back += int(np.count_nonzero(back))
        self._same += int(np.count_nonzero(same))
        self._last_time = time[-1:]

    def finish(self) -> None:
        """Judge what was added.

        Raises:
            RecordingError: On the first of these faults.
        """
        self._check_count()
        self._check_finite()
        self._check_magnitude()
        self._check_order()
        for word, names, means in (
            (
                "position",
                self._layout.position,
                "a robot at rest tells nothing about its inertia or friction; record it moving",
            ),
            ("torque", self._layout.torque, "is this the measured torque, and were the drives on?"),
        ):
            if all(self._low[name] == self._high[name] for name in names):
                raise RecordingError(f"{self._source}: no {word} ever changes ({listing(names)}); {means}")

    def _check_count(self) -> None:
        if self._samples == 0:
            raise RecordingError(f"{self._source}: a header but no rows; the log has no samples")
        if self._samples < FEWEST:
            raise RecordingError(
                f"{self._source}: {self._samples} rows are too few to identify anything; record at least {FEWEST}"
            )

    def _check_finite(self) -> None:
        bad = {name: self._bad[name] for name in self._layout.used if name in self._bad}
        if bad:
            name, (_, row, value) = next(iter(bad.items()))
            kind = "empty or NaN" if np.isnan(value) else "infinite"
            counts = listing([f"'{name}' in {count} rows" for name, (count, _, _) in bad.items()], 6)
            raise RecordingError(
                f"{self._source}: values that are not finite numbers: {counts}; "
                f"'{name}' is {kind} in {self._place(row)} first. Cut those rows at the source; "
                "none is dropped or filled in silently"
            )

    def _check_magnitude(self) -> None:
        """A value that no machine has: a glitch, an overflow, or another unit."""
        for name, (count, row, value) in self._far.items():
            raise RecordingError(
                f"{self._source}: '{name}' is {value:.6g} in {self._place(row)}, beyond {LARGEST:g}, "
                f"which no machine reaches in SI units ({count} rows); cut out the glitch, or convert the column"
            )

    def _check_order(self) -> None:
        name = self._layout.time
        if self._first_back is not None:
            row, before, after = self._first_back
            raise RecordingError(
                f"{self._source}: '{name}' runs backwards {self._back} times, first in {self._place(row)} "
                f"({before!r} then {after!r}); sort the rows, or give joined logs as separate files"
            )
        if self._first_same is not None:
            row, at = self._first_same
            raise RecordingError(
                f"{self._source}: '{name}' repeats the stamp before it in {self._same} rows, first in "
                f"{self._place(row)} ({at!r}); remove the repeated rows, or write time with more digits"
            )


def check_steps(place: Callable[[int], str], layout: Layout, statistics: Statistics) -> None:
    """Refuse a position that leaps faster than any joint can move, and time that spans more than a life's work.

    Raises:
        RecordingError: Naming the first leap.
    """
    gaps, rows, label = statistics.steps.gaps, statistics.steps.gap_rows, statistics.label
    span = statistics.steps.stop - statistics.steps.start
    if span > LONGEST and len(gaps):
        largest = int(np.argmax(gaps[:, 1] - gaps[:, 0]))
        raise RecordingError(
            f"{label}: time spans {span:.3g} s, its largest step before {place(int(rows[largest]))} "
            f"({float(gaps[largest, 0])!r} then {float(gaps[largest, 1])!r}); wanted seconds of one recording, at most "
            f"{LONGEST:g}"
        )
    leaps = statistics.positions(unwrapped=True)
    for k in np.flatnonzero(leaps.leaps):
        row, before, after, step = leaps.first_leap[k]
        raise RecordingError(
            f"{label}: '{layout.position[k]}' leaps from {before:.6g} to {after:.6g} in {step:.3g} s "
            f"before {place(int(row))}, faster than {FASTEST:g} a second, which no joint is ({leaps.leaps[k]} "
            "steps); cut out the glitch, or check the units of q and time"
        )


def check_quaternions(statistics: Statistics, robot: Robot) -> None:
    """Refuse orientations whose quaternions are not of unit length within 1 %.

    Raises:
        RecordingError: Naming the joint.
    """
    for joint in robot.joints:
        if joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER):
            length, row = statistics.worst_quaternion[joint.name]
            if abs(length - 1.0) > 0.01:
                names = robot.channels[joint.channels][-4:]
                raise RecordingError(
                    f"{statistics.label}: the quaternion of '{joint.name}' ({listing(names)}) has length "
                    f"{length:.4g} in sample {row + 1}, wanted 1; check which columns they are (w comes last)"
                )

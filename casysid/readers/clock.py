"""Time stamps in whatever clock a log has them, as seconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from casysid.arrays import Array
from casysid.readers.units_of_columns import UNITS
from casysid.readers.words import curve_times, seconds_part_of, time_unit_of

USUAL = ("time", "Time", "t", "timestamp")
"""Names that mean time in seconds unless the log says otherwise; the first that is there counts."""
EPOCH = (9.4e8, 4.1e9)
"""Seconds since 1970 in the years 2000 to 2100: a stamp in just one unit lies there."""


@dataclass(frozen=True)
class Clock:
    """The columns that make the time stamps.

    Attributes:
        columns: One, or whole seconds and their fraction.
        units: Of each (a word of :data:`~casysid.readers.units_of_columns.UNITS`); None while it is not known.
        origin: What is taken from each before it becomes a float: the first stamp of clocks that count in other units
            than plain seconds, so that no digit is lost; zeros otherwise.
    """

    columns: tuple[str, ...]
    units: tuple[str | None, ...]
    origin: tuple[int | float, ...] = ()

    def seconds(self, columns: Mapping[str, np.ndarray[Any, Any]]) -> Array:
        """The stamps of some rows [s]."""
        total: Array | None = None
        for name, unit, origin in zip(self.columns, self.units, self.origin or (0,) * len(self.units), strict=True):
            values = columns[name]
            part = (values - origin if origin else values).astype(np.float64, copy=False)
            if unit not in (None, "s"):
                part = part / round(1.0 / UNITS["time"][unit]) if UNITS["time"][unit] < 1.0 else part * 60.0
            total = part if total is None else total + part
        assert total is not None
        return total

    def started(self, first: Mapping[str, np.ndarray[Any, Any]]) -> Clock:
        """With the first stamps known: the unit where they tell it, and the origin."""
        values = [first[name][:1] for name in self.columns]
        if any(len(value) == 0 or not np.isfinite(value[0]) for value in values):
            return replace(self, origin=(0,) * len(self.columns))
        clock = self
        if self.units == (None,):
            clock = replace(self, units=(_unit_by_epoch(float(values[0][0])),))
        plain = clock.units in (("s",), (None,)) and values[0].dtype.kind == "f"
        return replace(clock, origin=tuple(0 if plain else value[0].item() for value in values))


def _unit_by_epoch(stamp: float) -> str | None:
    low, high = EPOCH
    return next((unit for unit in ("ms", "us", "ns") if low <= stamp * UNITS["time"][unit] <= high), None)


def find_clock(names: Sequence[str], units: Mapping[str, str], near: str = "") -> Clock | None:
    """The columns of time among those of a log.

    Args:
        names: All columns.
        units: What the log says of them in a row of units.
        near: The first column of the positions; of several stamps that of the same origin counts.
    """
    for name in USUAL:
        if name in names:
            return Clock((name,), (units.get(name),))
    if near in (curves := curve_times(names)):
        return Clock((curves[near],), (units.get(curves[near]),))
    pairs = _pairs(names)
    said = {name: found for name in names if (found := time_unit_of(name)) is not None}
    single = [name for name in said if seconds_part_of(name) is None]
    ranked = sorted(single, key=lambda n: (said[n][0] > 0, -_shared(n, near), said[n][0], names.index(n)))
    if ranked and (not pairs or said[ranked[0]][0] == 0):
        return Clock((ranked[0],), (units.get(ranked[0]) or said[ranked[0]][1],))
    if pairs:
        seconds, fraction, unit = max(pairs, key=lambda pair: _shared(pair[0], near))
        return Clock((seconds, fraction), ("s", unit))
    alone = [name for name in names if (part := seconds_part_of(name)) and part[1] == "s" and not part[0]]
    return Clock((alone[0],), ("s",)) if alone else None


def _pairs(names: Sequence[str]) -> list[tuple[str, str, str]]:
    """Columns of whole seconds, of their fractions, and the fractions' unit."""
    parts = {name: found for name in names if (found := seconds_part_of(name)) is not None}
    fractions = {before: (name, unit) for name, (before, unit) in parts.items() if unit != "s"}
    return [(name, *fractions[before]) for name, (before, unit) in parts.items() if unit == "s" and before in fractions]


def _shared(name: str, other: str) -> int:
    """Letters that two names have in common at their beginnings."""
    return next((k for k, (a, b) in enumerate(zip(name, other, strict=False)) if a != b), min(len(name), len(other)))

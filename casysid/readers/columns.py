"""Which column of a log is which channel of the robot.

A file names its columns by joint (``q_elbow, tau_elbow``) or numbers them in the model file's order, from 1 or from 0
(``q1, dq1, ddq1, tau1``; ``q_1`` too, and plain ``q`` for a single one), never both. Of the spellings below the first
that the file has counts, and the others are left aside.

============ ============================== ==========================
quantity     by name, ``<spelling>_<name>`` by number, ``<spelling>1``
============ ============================== ==========================
time         time, Time, t, timestamp
position     q, position, pos               q, position, pos
velocity     v, dq, qd, velocity            dq, v, qd, velocity
acceleration a, ddq, qdd, acceleration      ddq, a, qdd, acceleration
torque       tau, effort, torque            tau, effort, torque
============ ============================== ==========================

Names are position channels for q and degrees of freedom for the rest: the joint's name when it moves in one way.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from casysid.errors import RecordingError

TIME = ("time", "Time", "t", "timestamp")
MOST_COLUMNS = 10_000
"""A table with more is no recording: 1000 joints (the most of any model here) of 10 quantities each."""
LONGEST_NAME = 80
"""Letters of a column's name that a message shows."""
MOST_COMPARED = 1000
"""Columns among which a misspelled one is looked for."""


@dataclass(frozen=True)
class Quantity:
    """A measured quantity and how its columns may be spelled.

    Attributes:
        word: What it is called.
        named: Spellings before the name of a channel.
        numbered: Spellings before a number.
    """

    word: str
    named: tuple[str, ...]
    numbered: tuple[str, ...]

    @property
    def usual(self) -> Quantity:
        """With the first spellings alone."""
        return Quantity(self.word, self.named[:1], self.numbered[:1])


POSITION = Quantity("position", ("q", "position", "pos"), ("q", "position", "pos"))
VELOCITY = Quantity("velocity", ("v", "dq", "qd", "velocity"), ("dq", "v", "qd", "velocity"))
ACCELERATION = Quantity("acceleration", ("a", "ddq", "qdd", "acceleration"), ("ddq", "a", "qdd", "acceleration"))
TORQUE = Quantity("torque", ("tau", "effort", "torque"), ("tau", "effort", "torque"))


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The columns that a recording is made of, each in the robot's order.

    Attributes:
        time: Column of time stamps; None for unordered samples.
        position: By channel.
        velocity: By degree of freedom; None when not logged.
        acceleration: By degree of freedom; None when not logged.
        torque: By degree of freedom.
    """

    time: str | None
    position: tuple[str, ...]
    velocity: tuple[str, ...] | None
    acceleration: tuple[str, ...] | None
    torque: tuple[str, ...]

    @property
    def used(self) -> tuple[str, ...]:
        """All of them."""
        return (
            *(() if self.time is None else (self.time,)),
            *self.position,
            *(self.velocity or ()),
            *(self.acceleration or ()),
            *self.torque,
        )


def match_columns(
    found: Sequence[str],
    channels: Sequence[str],
    dofs: Sequence[str],
    source: str,
    numbered: tuple[Sequence[str], Sequence[str]] | None = None,
) -> Layout:
    """The layout of a file with the columns ``found``, for a robot with these channels and degrees of freedom.

    ``numbered`` has the same channels and degrees of freedom in the order that numbers count; None is theirs.

    Raises:
        RecordingError: If a wanted column is missing, there twice or once too often, or names and numbers are mixed.
    """
    counted = _Counted(channels, dofs, *(numbered or (channels, dofs)))
    named = _by_name(POSITION, found, channels, source)
    position = named or counted.channels(POSITION, found, source)
    if position is None:
        raise _lacking(POSITION, [f"q_{name}" for name in channels], found, source)
    if named and all(f"q{k + 1}" in set(found) - set(named) for k in range(len(channels))):
        raise _mixed(source, named[0], "q1")
    optional = (VELOCITY, ACCELERATION)
    find, other = (_by_name, counted.dofs) if named else (counted.dofs, _by_name)
    velocity, acceleration, torque = (find(quantity, found, dofs, source) for quantity in (*optional, TORQUE))
    for quantity, columns in zip((*optional, TORQUE), (velocity, acceleration, torque), strict=True):
        stray = None if columns else other(quantity.usual if quantity in optional else quantity, found, dofs, source)
        if stray:
            raise _mixed(source, position[0], stray[0])
    if torque is None:
        wanted = [f"tau_{name}" for name in dofs] if named else [f"tau{k + 1}" for k in range(len(dofs))]
        raise _lacking(TORQUE, wanted, found, source)
    time = next((name for name in TIME if name in found), None)
    layout = Layout(time=time, position=position, velocity=velocity, acceleration=acceleration, torque=torque)
    _refuse_unusable(layout, found, source)
    return layout


@dataclass(frozen=True)
class _Counted:
    """Numbered columns, put from the order in which numbers count into the robot's."""

    own_channels: Sequence[str]
    own_dofs: Sequence[str]
    counted_channels: Sequence[str]
    counted_dofs: Sequence[str]

    def channels(self, quantity: Quantity, found: Sequence[str], source: str) -> tuple[str, ...] | None:
        """Columns by channel."""
        columns = _by_number(quantity, found, self.counted_channels, source)
        return columns and self._in_own_order(columns, self.counted_channels, self.own_channels)

    def dofs(
        self, quantity: Quantity, found: Sequence[str], names: Sequence[str], source: str
    ) -> tuple[str, ...] | None:
        """Columns by degree of freedom."""
        columns = _by_number(quantity, found, self.counted_dofs, source)
        return columns and self._in_own_order(columns, self.counted_dofs, names)

    @staticmethod
    def _in_own_order(columns: tuple[str, ...], counted: Sequence[str], own: Sequence[str]) -> tuple[str, ...]:
        place = {name: k for k, name in enumerate(counted)}
        return tuple(columns[place[name]] for name in own)


def _by_name(quantity: Quantity, found: Sequence[str], names: Sequence[str], source: str) -> tuple[str, ...] | None:
    for spelling in quantity.named:
        wanted = [f"{spelling}_{name}" for name in names]
        present = [name in found for name in wanted]
        if all(present):
            return tuple(wanted)
        if any(present):
            raise _lacking(quantity, wanted, found, source)
    return None


def _by_number(quantity: Quantity, found: Sequence[str], names: Sequence[str], source: str) -> tuple[str, ...] | None:
    for spelling, mark in product(quantity.numbered, ("", "_")):
        pattern = re.compile(rf"{spelling}{mark}([0-9]{{1,9}})")
        numbered = [(int(m[1]), name) for name in found if (m := pattern.fullmatch(name))]
        hits = dict(numbered)
        _refuse_same_number(quantity, numbered, hits, source)
        hits = hits or ({1: spelling} if spelling in found else {})
        if hits:
            return _in_order(quantity, hits, names, source)
    return None


def _refuse_same_number(
    quantity: Quantity, numbered: Sequence[tuple[int, str]], hits: Mapping[int, str], source: str
) -> None:
    for number, name in numbered:
        if name != hits[number]:
            raise RecordingError(
                f"{source}: columns '{name}' and '{hits[number]}' are both number {number} of {quantity.word}; "
                "rename or remove one of them"
            )


def _in_order(quantity: Quantity, hits: dict[int, str], names: Sequence[str], source: str) -> tuple[str, ...]:
    columns = tuple(hits[k] for k in sorted(hits))
    if sorted(hits) in (list(range(1, len(names) + 1)), list(range(len(names)))):
        return columns
    transposed = "; in a matrix rows are samples, so transpose it" if len(columns) > 10 * len(names) else ""
    raise RecordingError(
        f"{source}: {len(columns)} numbered columns of {quantity.word} ({listing(columns, 8)}), "
        f"but the robot has {len(names)}: {listing(names)}. Numbers run from 1 in the "
        f"model file's order, none left out{transposed}; "
        f"name the columns by joint ({quantity.named[0]}_{names[0]}) or lock the joints that the log lacks"
    )


def _refuse_unusable(layout: Layout, found: Sequence[str], source: str) -> None:
    if layout.time is None and (layout.velocity is None or layout.acceleration is None):
        lacking = " and ".join(w for w in ("velocity", "acceleration") if getattr(layout, w) is None)
        near = [name for name in found if "time" in name.lower() or "stamp" in name.lower()]
        raise RecordingError(
            f"{source}: no column time [s]{_maybe(near)}; rows without time are unordered samples and need q, v, a and "
            f"tau, but {lacking} is missing. Add one or the other. Found: {listing(found)}"
        )
    twice = sorted({name for name in layout.used if list(found).count(name) > 1})
    if twice:
        raise RecordingError(f"{source}: columns named twice: {listing(twice)}; rename or remove one of each")


def _lacking(quantity: Quantity, wanted: Sequence[str], found: Sequence[str], source: str) -> RecordingError:
    lacking = [name for name in wanted if name not in found]
    short = [name for name in found[:MOST_COMPARED] if len(name) <= LONGEST_NAME]
    free = [name for name in short if not _means_something(name, wanted)]
    near = [match for name in lacking[:8] for match in difflib.get_close_matches(name, free, 1, 0.75)]
    letter, number = quantity.named[0], quantity.numbered[0]
    return RecordingError(
        f"{source}: no column {listing(lacking)}{_maybe(near)}. Wanted for {quantity.word}: {listing(wanted)} "
        f"({letter}_<name> by joint, or {number}1 to {number}{len(wanted)} in the model's order). "
        f"Found: {listing(found)}. Rename the columns, or lock joints that were not logged"
    )


def _means_something(name: str, wanted: Sequence[str]) -> bool:
    """Whether a column has its own meaning already, and so cannot be another one misspelled."""
    prefix, _, owner = name.partition("_")
    spellings = {spelling for quantity in (POSITION, VELOCITY, ACCELERATION, TORQUE) for spelling in quantity.named}
    return prefix in spellings and owner in {column.partition("_")[2] for column in wanted}


def _mixed(source: str, column: str, stray: str) -> RecordingError:
    return RecordingError(
        f"{source}: some columns are named by joint and some numbered ({column}, {stray}), "
        "so joints could be confused; name them all or number them all"
    )


def _maybe(near: Sequence[str]) -> str:
    return f" (did you mean {listing(sorted(set(near)))}?)" if near else ""


def listing(names: Sequence[str], most: int = 16) -> str:
    """Names for a message, the first ``most`` of them, long ones cut short."""
    more = f", ... ({len(names)} in all)" if len(names) > most else ""
    shown = (name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 3]}..." for name in names[:most])
    return ", ".join(shown) + more


def refuse_too_many(columns: int, source: str) -> None:
    """Nothing, if a table of so many columns can be a recording.

    Raises:
        RecordingError: It cannot.
    """
    if columns > MOST_COLUMNS:
        raise RecordingError(
            f"{source}: {columns} columns, at most {MOST_COLUMNS} are read; rows are samples, so transpose a matrix "
            "that has them as columns"
        )

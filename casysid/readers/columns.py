"""Which column of a log is which channel of the robot.

By joint (``q_elbow, tau_elbow``) or numbered in the model file's order, from 1 or from 0 (``q1, dq1, ddq1, tau1``;
``q_1`` too, and plain ``q`` for a single one), never both. Of these spellings the first that the file has counts, and
the others are left aside.

============ ============================== ==========================
quantity     by name, ``<spelling>_<name>`` by number, ``<spelling>1``
============ ============================== ==========================
time         time, Time, t, timestamp
position     q, position, pos               q, position, pos
velocity     v, dq, qd, velocity            dq, v, qd, velocity
acceleration a, ddq, qdd, acceleration      ddq, a, qdd, acceleration
torque       tau, effort, torque            tau, effort, torque
============ ============================== ==========================

Where there are none of these, the names are read word by word (:mod:`casysid.readers.words`): groups of columns that
differ in the joint alone, or in one number alone, and whose other words name a quantity. A measured group is preferred
to a commanded one; between two that are alike none is chosen. Names are position channels for q and degrees of freedom
for the rest: the joint's name when it moves in one way.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NoReturn

from casysid.errors import RecordingError
from casysid.readers.candidates import (
    ACCELERATION,
    POSITION,
    QUANTITIES,
    TORQUE,
    VELOCITY,
    Candidate,
    Labels,
    Quantity,
    read_names,
    usual_by_name,
    usual_by_number,
)
from casysid.readers.choosing import choose_pair, choose_rest, only_commanded
from casysid.readers.clock import Clock, find_clock
from casysid.readers.messages import listing
from casysid.readers.refusals import current_not_torque, lacking, mixed, no_clock, same_number, wrong_count
from casysid.readers.scaling import factors_of
from casysid.recording.declared import NOTHING, Declared

__all__ = ["Labels", "Layout", "match_columns"]


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The columns that a recording is made of, each in the robot's order.

    Attributes:
        clock: Columns of time stamps; None for unordered samples.
        position: By channel.
        velocity: By degree of freedom; None when not logged.
        acceleration: By degree of freedom; None when not logged.
        torque: By degree of freedom.
        factors: By which columns are multiplied to be in SI units at the joint; the others by one.
        remarks: What to say of the choice.
        unmeasured: Columns of torque that hold nothing; zeros stand for them.
        contacts: Frames that touch with wrenches that nobody measured, each with its column of flags.
        wrenches: Frames whose measured wrenches are in the torques.
    """

    clock: Clock | None
    position: tuple[str, ...]
    velocity: tuple[str, ...] | None
    acceleration: tuple[str, ...] | None
    torque: tuple[str, ...]
    factors: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    unmeasured: tuple[str, ...] = ()
    contacts: tuple[tuple[str, str], ...] = ()
    wrenches: tuple[str, ...] = ()

    @property
    def time(self) -> str | None:
        """The column of time stamps, the first if there are two; None for unordered samples."""
        return None if self.clock is None else self.clock.columns[0]

    @property
    def used(self) -> tuple[str, ...]:
        """All columns, each once."""
        clock = () if self.clock is None else self.clock.columns
        motion = (*self.position, *(self.velocity or ()), *(self.acceleration or ()))
        flags = (column for _, column in self.contacts)
        return tuple(dict.fromkeys((*clock, *motion, *self.torque, *flags)))


@dataclass(frozen=True)
class _Names:
    """The names of a log beside those of the robot."""

    found: Sequence[str]
    channels: Sequence[str]
    dofs: Sequence[str]
    source: str
    labels: Labels

    def of(self, quantity: Quantity) -> Sequence[str]:
        """Joints that have the quantity."""
        return self.channels if quantity is POSITION else self.dofs

    def by_name(self) -> list[Candidate]:
        """Groups of the usual spellings by joint."""
        return [one for quantity in QUANTITIES for one in usual_by_name(quantity, self.found, self.of(quantity))]

    def by_number(self) -> list[Candidate]:
        """Groups of the usual spellings by number."""
        return [
            one
            for quantity in QUANTITIES
            for one in usual_by_number(quantity, self.found, len(self.of(quantity)), self.source)
        ]


def match_columns(
    found: Sequence[str],
    channels: Sequence[str],
    dofs: Sequence[str],
    source: str,
    labels: Labels | None = None,
    declared: Declared = NOTHING,
    linear: Collection[str] = (),
    numbered: tuple[Sequence[str], Sequence[str]] | None = None,
) -> Layout:
    """The layout of a file with the columns ``found``, for a robot with these channels and degrees of freedom.

    Args:
        found: Names of the columns.
        channels: Of the robot's positions.
        dofs: Of the robot.
        source: What to call the log in a message.
        labels: What the log says of its columns beside their names.
        declared: What its user says; no columns.
        linear: Channels and degrees of freedom that are lengths.
        numbered: The channels and the degrees of freedom in the order that numbers count; None is theirs.

    Raises:
        RecordingError: If a wanted column is missing, there twice or once too often, names and numbers are mixed, two
            choices are alike, or there are currents only.
    """
    names = _Names(found, channels, dofs, source, labels or Labels())
    groups = _groups(names, declared)
    by_quantity = {word: [one for one in groups if one.quantity == word] for word in _WORDS}
    if declared.motor_constant is not None or declared.units.get("torque"):
        _take_currents(by_quantity, declared)
    if not by_quantity["torque"]:
        _refuse_no_torque(names, by_quantity, named=groups[0].named)
    position, torque = choose_pair(by_quantity["position"], by_quantity["torque"], source)
    if position.named:
        _refuse_mixed(names, position)
    velocity = choose_rest(by_quantity["velocity"], position)
    acceleration = choose_rest(by_quantity["acceleration"], position)
    for quantity, chosen in ((VELOCITY, velocity), (ACCELERATION, acceleration)):
        if chosen is None:
            _refuse_half(names, quantity, named=position.named)
    picked = [one for one in (position, velocity, acceleration, torque) if one is not None]
    for one in picked:
        if one.doubled:
            raise same_number(one.quantity, one.doubled[0], one.columns, source)
    position, *others = (in_own_order(one, channels, dofs, numbered) for one in picked)
    by_word = {one.quantity: one.columns for one in others}
    picked = [position, *others]
    layout = Layout(
        clock=find_clock(found, names.labels.units, position.columns[0]),
        position=position.columns,
        velocity=by_word.get("velocity"),
        acceleration=by_word.get("acceleration"),
        torque=others[-1].columns,
        factors=factors_of(picked, channels, dofs, names.labels, declared, set(linear), source),
        remarks=only_commanded(picked),
    )
    refuse_unusable(layout, found, source)
    return layout


def in_own_order(
    candidate: Candidate,
    channels: Sequence[str],
    dofs: Sequence[str],
    numbered: tuple[Sequence[str], Sequence[str]] | None,
) -> Candidate:
    """Numbered columns, put from the order in which numbers count into the robot's."""
    if candidate.named or numbered is None:
        return candidate
    own, counted = (channels, numbered[0]) if candidate.quantity == POSITION.word else (dofs, numbered[1])
    places = [list(counted).index(name) for name in own]
    return replace(
        candidate,
        columns=tuple(candidate.columns[place] for place in places),
        units=tuple(candidate.units[place] for place in places),
    )


_WORDS = ("position", "velocity", "acceleration", "torque", "current")


def _groups(names: _Names, declared: Declared) -> list[Candidate]:
    """Complete groups of columns, by joint if the positions are; else numbered."""
    named = names.by_name()
    complete = [one for one in named if not one.lacking]
    read = read_names(names.found, names.channels, names.dofs, names.labels)
    read = [one for one in read if one.columns not in {usual.columns for usual in named}]
    complete += [one for one in read if one.named and not one.lacking]
    if any(one.quantity == "position" for one in complete):
        return _positions_first(complete)
    partial = [one for one in (*named, *read) if one.quantity == "position" and one.named and one.columns]
    if any(one.usual is not None for one in partial):
        raise _lacking(names, POSITION, partial, named=True)
    numbered = names.by_number()
    usual = {one.columns for one in numbered}
    others = [one for one in read if not one.named and one.columns not in usual]
    complete = [one for one in (*numbered, *others) if not one.lacking]
    if any(one.quantity == "position" for one in complete):
        return _positions_first(complete)
    short = [one for one in (*numbered, *others) if one.quantity == "position"]
    if short and not partial:
        raise wrong_count(POSITION, max(short, key=lambda one: len(one.columns)), names.channels, names.source)
    raise _lacking(names, POSITION, partial, named=True)


def _positions_first(groups: Sequence[Candidate]) -> list[Candidate]:
    return sorted(groups, key=lambda one: one.quantity != "position")


def _take_currents(by_quantity: dict[str, list[Candidate]], declared: Declared) -> None:
    """Currents stand in for torques where a motor constant is declared, or a unit of torque and no torque is there."""
    currents = [one for one in by_quantity["current"] if not one.commanded] or by_quantity["current"]
    if currents and (declared.motor_constant is not None or not by_quantity["torque"]):
        by_quantity["torque"] = currents


def _refuse_no_torque(names: _Names, by_quantity: Mapping[str, Sequence[Candidate]], *, named: bool) -> NoReturn:
    position = by_quantity["position"][0]
    others = names.by_number() if named else names.by_name()
    stray = [one for one in others if one.quantity == "torque" and not one.lacking]
    if stray:
        raise mixed(names.source, position.columns[0], stray[0].columns[0])
    if by_quantity["current"]:
        raise current_not_torque(by_quantity["current"][0], names.source)
    partial = [one for one in _of_kind(names, named=named) if one.quantity == "torque"]
    if partial and not named:
        raise wrong_count(TORQUE, max(partial, key=lambda one: len(one.columns)), names.dofs, names.source)
    raise _lacking(names, TORQUE, partial, named=named)


def _lacking(names: _Names, quantity: Quantity, partial: Sequence[Candidate], *, named: bool) -> RecordingError:
    return lacking(quantity, names.of(quantity), names.found, partial, names.source, named=named)


def _of_kind(names: _Names, *, named: bool) -> list[Candidate]:
    read = read_names(names.found, names.channels, names.dofs, names.labels)
    return [*(names.by_name() if named else names.by_number()), *(one for one in read if one.named == named)]


def _refuse_mixed(names: _Names, position: Candidate) -> None:
    numbers = {f"q{k + 1}" for k in range(len(names.channels))}
    if position.usual is not None and numbers <= set(names.found) - set(position.columns):
        raise mixed(names.source, position.columns[0], "q1")


def _refuse_half(names: _Names, quantity: Quantity, *, named: bool) -> None:
    """Velocities, accelerations of some joints only, or named in another way than the positions."""
    joints = names.of(quantity)
    own = usual_by_name(quantity, names.found, joints) if named else []
    if own:
        raise lacking(quantity, joints, names.found, own, names.source, named=named)
    if not named:
        short = usual_by_number(quantity, names.found, len(joints), names.source)
        if short:
            raise wrong_count(quantity, short[0], joints, names.source)
    other = (
        usual_by_number(quantity.usual, names.found, len(joints), names.source)
        if named
        else usual_by_name(quantity.usual, names.found, joints)
    )
    if other:
        first = f"{quantity.named[0]}_{joints[0]}" if named else f"{quantity.numbered[0]}1"
        raise mixed(names.source, first if first in names.found else names.found[0], other[0].columns[0])


def refuse_unusable(layout: Layout, found: Sequence[str], source: str) -> None:
    """Nothing, if the columns are there once, with time or with all that unordered samples need.

    Raises:
        RecordingError: They are not.
    """
    if layout.clock is None and (layout.velocity is None or layout.acceleration is None):
        short = [word for word in ("velocity", "acceleration") if getattr(layout, word) is None]
        raise no_clock(short, found, source)
    counts = {name: 0 for name in layout.used}
    for name in found:
        if name in counts:
            counts[name] += 1
    twice = sorted(name for name, count in counts.items() if count > 1)
    if twice:
        raise RecordingError(f"{source}: columns named twice: {listing(twice)}; rename or remove one of each")

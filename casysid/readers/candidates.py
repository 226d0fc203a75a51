"""Groups of columns that could be a quantity of all joints, by the spellings of the convention and by the grammar."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

from casysid.errors import RecordingError
from casysid.readers.units_of_columns import is_unit_of
from casysid.readers.words import SLOT, curve_times, meaning_of, without_unit, words_of

MOST_READ = 4000
"""Columns whose names are looked into; the grammar compares each with the joints."""


@dataclass(frozen=True)
class Quantity:
    """A measured quantity and the usual spellings of its columns.

    Attributes:
        word: What it is called.
        named: Before the name of a channel, with an underscore between.
        numbered: Before a number.
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
QUANTITIES = (POSITION, VELOCITY, ACCELERATION, TORQUE)


@dataclass(frozen=True)
class Labels:
    """What a log says of its columns outside of their names.

    Attributes:
        units: Units by column, from a row of them.
        owners: Joints by column, as messages that bring their names have them.
    """

    units: Mapping[str, str] = field(default_factory=dict)
    owners: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Candidate:
    """Columns that could be one quantity.

    Attributes:
        quantity: Which.
        columns: In the robot's order; of fewer joints than it has where it is not complete.
        units: As written, by column.
        lacking: Joints without a column.
        named: Whether by joint; else numbered.
        usual: Place in the table of usual spellings; None for others.
        commanded: Whether it was asked for, not measured.
        motor: Whether it is of motors.
        unknown: Words that mean nothing here.
        surround: All words but the quantity's.
        doubled: Two columns of one number; empty for none.
    """

    quantity: str
    columns: tuple[str, ...]
    units: tuple[str | None, ...]
    lacking: tuple[str, ...] = ()
    named: bool = True
    usual: int | None = None
    commanded: bool = False
    motor: bool = False
    unknown: int = 0
    surround: tuple[str, ...] = ()
    doubled: tuple[str, ...] = ()

    @property
    def pattern(self) -> str:
        """The columns in short: the first of them, and the last."""
        return self.columns[0] if len(self.columns) == 1 else f"{self.columns[0]} ... {self.columns[-1]}"


def usual_by_name(quantity: Quantity, found: Sequence[str], names: Sequence[str]) -> list[Candidate]:
    """Those of ``<spelling>_<name>``, complete or not."""
    there, candidates = set(found), []
    for place, spelling in enumerate(quantity.named):
        wanted = [f"{spelling}_{name}" for name in names]
        columns = tuple(column for column in wanted if column in there)
        lacking = tuple(name for name, column in zip(names, wanted, strict=True) if column not in there)
        if columns:
            units = (None,) * len(columns)
            candidates.append(Candidate(quantity.word, columns, units, lacking, usual=place))
    return candidates


def usual_by_number(quantity: Quantity, found: Sequence[str], count: int, source: str) -> list[Candidate]:
    """Those of ``<spelling>1`` and ``<spelling>_1``, however many; a single one may go without a number.

    Raises:
        RecordingError: Two columns have one number.
    """
    candidates = []
    for place, (spelling, mark) in enumerate(product(quantity.numbered, ("", "_"))):
        pattern = re.compile(rf"{spelling}{mark}([0-9]{{1,9}})")
        numbered = [(int(match[1]), name) for name in found if (match := pattern.fullmatch(name))]
        hits = dict(numbered)
        refuse_same_number(quantity.word, numbered, source)
        hits = hits or ({1: spelling} if spelling in found else {})
        if hits:
            columns = tuple(hits[k] for k in sorted(hits))
            lacking = () if _counts(hits, count) else (str(count),)
            units = (None,) * len(columns)
            candidates.append(Candidate(quantity.word, columns, units, lacking, named=False, usual=place))
    return candidates


def refuse_same_number(word: str, numbered: Sequence[tuple[int, str]], source: str) -> None:
    """Nothing, if no number is there twice under different names.

    Raises:
        RecordingError: One is.
    """
    hits: dict[int, str] = {}
    for number, name in numbered:
        if hits.setdefault(number, name) != name:
            raise RecordingError(
                f"{source}: columns '{name}' and '{hits[number]}' are both number {number} of {word}; "
                "rename or remove one of them"
            )


def _counts(hits: Collection[int], count: int) -> bool:
    return sorted(hits) in (list(range(1, count + 1)), list(range(count)))


def read_names(found: Sequence[str], channels: Sequence[str], dofs: Sequence[str], labels: Labels) -> list[Candidate]:
    """All groups of columns whose names differ in the joint alone, or in one number alone, complete or not."""
    by_joint: dict[tuple[str, tuple[str, ...]], dict[str, tuple[str, str | None]]] = defaultdict(dict)
    by_number: dict[tuple[str, tuple[str, ...]], list[tuple[int, str, str | None]]] = defaultdict(list)
    joints = _Joints(tuple(dict.fromkeys((*channels, *dofs))))
    times = set(curve_times(found).values())
    for name in [name for name in found[:MOST_READ] if name not in times]:
        bare, unit = without_unit(name)
        unit = labels.units.get(name, unit)
        words, owner = words_of(bare), labels.owners.get(name)
        if owner is not None:
            words = (*(words[:-1] if words[-1:] and words[-1].isdigit() else words), SLOT)
        else:
            owner, words = joints.taken_out(words)
        if owner is not None:
            if (key := _key(words, unit)) is not None:
                by_joint[key[:2]].setdefault(owner, (name, key[2]))
            continue
        if len(dofs) == 1 and not any(word.isdigit() for word in words) and (key := _key((*words, SLOT), unit)):
            by_number[key[:2]].append((1, name, key[2]))
        for place, word in enumerate(words):
            if word.isdigit() and len(word) < 10:
                slotted = (*words[:place], SLOT, *words[place + 1 :])
                if (key := _key(slotted, unit)) is not None:
                    by_number[key[:2]].append((int(word), name, key[2]))
    return [
        *(_of_joints(key, hits, channels if key[0] == "position" else dofs) for key, hits in by_joint.items()),
        *(_of_numbers(key, hits, len(channels if key[0] == "position" else dofs)) for key, hits in by_number.items()),
    ]


def _key(words: tuple[str, ...], unit: str | None) -> tuple[str, tuple[str, ...], str | None] | None:
    """Quantity, all words but the unit's, and the unit."""
    found = meaning_of(words)
    if found is None:
        return None
    meaning, last = found
    if last is not None:
        words = tuple(word for word in words if word != last)
    unit = unit or last
    quantity = meaning.quantity
    if quantity == "torque" and unit is not None and is_unit_of(unit, "current"):
        quantity = "current"
    return quantity, words, unit


def _of_joints(
    key: tuple[str, tuple[str, ...]], hits: Mapping[str, tuple[str, str | None]], names: Sequence[str]
) -> Candidate:
    there = [name for name in names if name in hits]
    lacking = tuple(name for name in names if name not in hits)
    columns, units = tuple(hits[name][0] for name in there), tuple(hits[name][1] for name in there)
    return _candidate(key, columns, units, lacking, named=True)


def _of_numbers(key: tuple[str, tuple[str, ...]], hits: Sequence[tuple[int, str, str | None]], count: int) -> Candidate:
    numbers = {number: (name, unit) for number, name, unit in hits}
    doubled = tuple(name for number, name, _ in hits if name != numbers[number][0])[:1]
    columns = tuple(numbers[k][0] for k in sorted(numbers))
    units = tuple(numbers[k][1] for k in sorted(numbers))
    one = _candidate(key, columns, units, () if _counts(numbers, count) else (str(count),), named=False)
    return replace(one, doubled=doubled)


def _candidate(
    key: tuple[str, tuple[str, ...]],
    columns: tuple[str, ...],
    units: tuple[str | None, ...],
    lacking: tuple[str, ...],
    *,
    named: bool,
) -> Candidate:
    quantity, words = key
    found = meaning_of(words)
    assert found is not None
    meaning = found[0]
    kept = set(meaning.rest) | {SLOT}
    return Candidate(
        quantity,
        columns,
        units,
        lacking,
        named=named,
        commanded=meaning.commanded,
        motor=meaning.motor,
        unknown=meaning.unknown,
        surround=tuple(word for word in words if word in kept),
    )


class _Joints:
    """Finds the joint that a column's words name."""

    def __init__(self, names: Sequence[str]) -> None:
        cut: dict[tuple[str, ...], list[str]] = defaultdict(list)
        for name in names:
            cut[words_of(name)].append(name)
        self._owners = {words: found[0] for words, found in cut.items() if words and len(found) == 1}
        self._lengths = sorted({len(words) for words in self._owners}, reverse=True)

    def taken_out(self, words: tuple[str, ...]) -> tuple[str | None, tuple[str, ...]]:
        """The joint with the most words that is named, and the words with a slot in its place."""
        for length in self._lengths:
            for start in range(len(words) - length + 1):
                owner = self._owners.get(words[start : start + length])
                if owner is not None:
                    return owner, (*words[:start], SLOT, *words[start + length :])
        return None, words

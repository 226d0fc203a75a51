"""One group of columns for each quantity, where several could be it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from casysid.errors import RecordingError
from casysid.readers.candidates import Candidate

Pair = tuple[Candidate, Candidate]


def choose_pair(positions: Sequence[Candidate], torques: Sequence[Candidate], source: str) -> Pair:
    """The positions and the torques.

    What was measured comes before what was commanded, the usual spellings before others, joints before motors, and
    columns that share all other words before those that do not.

    Raises:
        RecordingError: Two pairs are alike.
    """
    pairs = sorted(product(_measured(positions), _measured(torques)), key=_rank)
    if len(pairs) > 1 and _rank(pairs[0]) == _rank(pairs[1]):
        raise _ambiguous(pairs[0], pairs[1], source)
    return pairs[0]


def choose_rest(candidates: Sequence[Candidate], position: Candidate) -> Candidate | None:
    """Velocities, or accelerations, that go with the positions; None where none does, or two are alike."""
    measured = [one for one in candidates if one.commanded == position.commanded]
    ranked = sorted(measured, key=lambda one: _rank((position, one)))
    alike = len(ranked) > 1 and _rank((position, ranked[0])) == _rank((position, ranked[1]))
    return None if not ranked or alike else ranked[0]


def only_commanded(chosen: Sequence[Candidate]) -> tuple[str, ...]:
    """A sentence about each quantity that was commanded or is of motors, not measured at joints."""
    sentences = []
    for one in chosen:
        if one.commanded:
            sentences.append(
                f"{one.quantity} is taken from {one.pattern}, which by its name was commanded, not measured; there is "
                "no other"
            )
        elif one.motor and one.quantity != "current":
            sentences.append(
                f"{one.quantity} is taken from {one.pattern} as the joints', though the name says motor; "
                "--gear tells the ratio if torques are the motors'"
            )
    return tuple(sentences)


def _measured(candidates: Sequence[Candidate]) -> Sequence[Candidate]:
    return [one for one in candidates if not one.commanded] or candidates


def _rank(pair: Pair) -> tuple[object, ...]:
    """Smaller for the better choice; equal where nothing tells."""
    position, other = pair
    places = tuple(99 if one.usual is None else one.usual for one in pair)
    unusual = sum(one.usual is None for one in pair)
    apart = position.surround != other.surround and unusual == len(pair)
    return unusual, places, apart, position.motor + other.motor


def _ambiguous(first: Pair, second: Pair, source: str) -> RecordingError:
    one, other = (f"position = {pair[0].pattern}, torque = {pair[1].pattern}" for pair in (first, second))
    return RecordingError(
        f"{source}: the columns can be taken in two ways: ({one}) or ({other}). Say which with --map FILE, a file "
        f'such as: position = "{star(first[0])}"  torque = "{star(first[1])}" (one line each, * for the joint), or '
        "leave out the other columns"
    )


def star(candidate: Candidate) -> str:
    """The columns in short, the joint or its number replaced by a star where that gives them all."""
    if len(candidate.columns) < 2:
        return candidate.columns[0]
    first, last = candidate.columns[0], candidate.columns[-1]
    start = next((k for k, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), 0)
    end = next((k for k, (a, b) in enumerate(zip(first[::-1], last[::-1], strict=False)) if a != b), 0)
    return f"{first[:start]}*{first[len(first) - end :]}"

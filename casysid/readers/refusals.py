"""Messages about columns that are not there, with the columns that come nearest."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from casysid.errors import RecordingError
from casysid.readers.candidates import QUANTITIES, Candidate, Quantity
from casysid.readers.messages import LONGEST_NAME, listing
from casysid.readers.words import time_unit_of

MOST_COMPARED = 1000
"""Columns among which a misspelled one is looked for."""


def wrong_count(quantity: Quantity, found: Candidate, names: Sequence[str], source: str) -> RecordingError:
    """Numbered columns, but not as many as the robot has joints."""
    count = len(found.columns)
    transposed = "; in a matrix rows are samples, so transpose it" if count > 10 * len(names) else ""
    return RecordingError(
        f"{source}: {count} numbered columns of {quantity.word} ({listing(found.columns, 8)}), "
        f"but the robot has {len(names)}: {listing(names)}. Numbers run from 1 in the "
        f"model's order, none left out{transposed}; "
        f"name the columns by joint ({quantity.named[0]}_{names[0]}), say which is which with --map FILE, or lock the "
        f"joints that the log lacks (--lock {names[-1]}=VALUE)"
    )


def lacking(
    quantity: Quantity,
    names: Sequence[str],
    found: Sequence[str],
    partial: Sequence[Candidate],
    source: str,
    *,
    named: bool,
) -> RecordingError:
    """No columns for all joints.

    Args:
        quantity: That is lacking.
        names: The joints.
        found: All columns.
        partial: Groups that come near.
        source: What to call the log.
        named: Whether columns are by joint.
    """
    letter, number = quantity.named[0], quantity.numbered[0]
    nearest = max(partial, key=lambda one: (len(one.columns), one.usual is not None), default=None)
    absent = nearest.lacking if nearest and nearest.named else tuple(names)
    spelling = letter if nearest is None or nearest.usual is None else quantity.named[nearest.usual]
    wanted = [f"{spelling}_{name}" for name in names] if named else [f"{number}{k + 1}" for k in range(len(names))]
    missing = [f"{spelling}_{name}" for name in absent] if named else wanted
    near = _near(missing, wanted, found)
    nearly = f" Nearest is {nearest.pattern} ({len(nearest.columns)} of {len(names)})." if nearest else ""
    if nearest is not None and nearest.named:
        locks = " ".join(f"--lock {name}=VALUE" for name in absent[:8])
        advice = f"If {listing(absent, 8)} did not move and was not logged, lock joints like it: {locks}"
        form = ""
    else:
        advice = "Rename the columns, say which is which with --map FILE, or lock joints that were not logged (--lock)"
        form = f" ({letter}_<name> by joint, or {number}1 to {number}{len(names)} in the model's order)"
    return RecordingError(
        f"{source}: no column {listing(missing)}{_maybe(near)}. Wanted for {quantity.word}: {listing(wanted)}{form}."
        f"{nearly} Found: {listing(found)}. {advice}"
    )


def current_not_torque(currents: Candidate, source: str) -> RecordingError:
    """Motor currents and no torque."""
    first = currents.columns[0]
    return RecordingError(
        f"{source}: no torque, but what looks like motor currents: {currents.pattern} ('{first}'). A current is not "
        "taken for a torque: give --motor-constant NUMBER [N m/A], with --gear RATIO if that is the motor's; "
        "or --units torque=Nm if they are torques in N m"
    )


def same_number(quantity: str, column: str, chosen: Sequence[str], source: str) -> RecordingError:
    """Two columns of one number."""
    return RecordingError(
        f"{source}: column '{column}' and one of {listing(chosen)} are the same number of {quantity}; "
        "rename or remove one of them"
    )


def mixed(source: str, column: str, stray: str) -> RecordingError:
    """Some columns by joint, some numbered."""
    return RecordingError(
        f"{source}: some columns are named by joint and some numbered ({column}, {stray}), "
        "so joints could be confused; name them all or number them all, or say which is which with --map FILE"
    )


def no_clock(short: Sequence[str], found: Sequence[str], source: str) -> RecordingError:
    """Neither time nor all that samples without time need."""
    near = [name for name in found if time_unit_of(name) or "time" in name.lower() or "stamp" in name.lower()]
    return RecordingError(
        f"{source}: no column time [s]{_maybe(near)}; rows without time are unordered samples and need q, v, a and "
        f"tau, but {' and '.join(short)} is missing. Add one or the other. Found: {listing(found)}"
    )


def _near(missing: Sequence[str], wanted: Sequence[str], found: Sequence[str]) -> list[str]:
    short = [name for name in found[:MOST_COMPARED] if len(name) <= LONGEST_NAME]
    free = [name for name in short if not _means_something(name, wanted)]
    return [match for name in missing[:8] for match in difflib.get_close_matches(name, free, 1, 0.75)]


def _means_something(name: str, wanted: Sequence[str]) -> bool:
    """Whether a column has its own meaning already, and so cannot be another one misspelled."""
    prefix, _, owner = name.partition("_")
    spellings = {spelling for quantity in QUANTITIES for spelling in quantity.named}
    return prefix in spellings and owner in {column.partition("_")[2] for column in wanted}


def _maybe(near: Sequence[str]) -> str:
    return f" (did you mean {listing(sorted(set(near)))}?)" if near else ""

"""What a verdict is made of: criteria with values and limits, what breaking one means, and where limits come from."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

WORTH_NAMING = 6
"""Names in one sentence; of more, the number is told."""


class Word(enum.Enum):
    """The verdict in a word."""

    ACCEPTED = "accepted"
    DOUBTFUL = "doubtful"
    REJECTED = "rejected"

    @property
    def exit_code(self) -> int:
        """Of the command line; 1 and 2 are a solver's failure and bad input."""
        return {Word.ACCEPTED: 0, Word.DOUBTFUL: 3, Word.REJECTED: 4}[self]


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One thing that was looked at.

    Attributes:
        name: Of the criterion.
        joint: Whose; empty where it is of the whole.
        value: What was found.
        limit: What it may be at most.
        word: What the verdict is at best if the limit is broken.
        reason: What a broken limit means and what to do, one sentence.
        origin: Where the limit comes from.
    """

    name: str
    joint: str = ""
    value: float
    limit: float
    word: Word
    reason: str
    origin: str

    @property
    def met(self) -> bool:
        """Whether the value keeps to the limit; one that is no number does not."""
        return self.value <= self.limit

    def to_json(self) -> dict[str, object]:
        """Plain words and numbers."""
        return {
            "name": self.name,
            "joint": self.joint or None,
            "value": self.value,
            "limit": self.limit,
            "met": self.met,
            "at_best": None if self.met else self.word.value,
            "reason": self.reason,
            "origin": self.origin,
        }


@dataclass(frozen=True)
class Verdict:
    """The judgement on an identification.

    Attributes:
        criteria: All that was looked at.
        remarks: What is weak although the answer stands.
        set_aside: Joints that nothing explains; the rest is judged without them.
    """

    criteria: tuple[Criterion, ...]
    remarks: tuple[str, ...] = ()
    set_aside: tuple[str, ...] = ()

    @property
    def word(self) -> Word:
        """The worst that a broken limit means."""
        broken = {criterion.word for criterion in self.criteria if not criterion.met}
        return next((word for word in (Word.REJECTED, Word.DOUBTFUL) if word in broken), Word.ACCEPTED)

    @property
    def accepted(self) -> bool:
        """Whether a controller may use the parameters."""
        return self.word is Word.ACCEPTED

    @property
    def headline(self) -> str:
        """One word."""
        return self.word.value

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why not accepted, the gravest first, one sentence each; empty when accepted."""
        broken = [criterion for criterion in self.criteria if not criterion.met]
        order = [
            *(one for one in broken if one.word is Word.REJECTED),
            *(one for one in broken if one.word is not Word.REJECTED),
        ]
        return tuple(dict.fromkeys(one.reason for one in order))

    def to_json(self) -> dict[str, object]:
        """Plain words and numbers."""
        return {
            "word": self.word.value,
            "accepted": self.accepted,
            "reasons": list(self.reasons),
            "remarks": list(self.remarks),
            "set_aside": list(self.set_aside),
            "criteria": [criterion.to_json() for criterion in self.criteria],
        }


def names(several: Sequence[str]) -> str:
    """Names with commas between them, not too many."""
    shown = ", ".join(several[:WORTH_NAMING])
    return shown if len(several) <= WORTH_NAMING else f"{shown} and {len(several) - WORTH_NAMING} more"


def merged(families: Iterable[Iterable[Criterion]]) -> tuple[Criterion, ...]:
    """All criteria, those of a family together."""
    return tuple(criterion for family in families for criterion in family)

"""What may be wrong with a log, or with where the robot stands, and how it is told."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array


class MistakeKind(enum.Enum):
    """What may be wrong; the value is how it is told."""

    TORQUE_NEGATED = "tau of {0} looks negated"
    POSITION_NEGATED = "q of {0} looks negated"
    AXIS_NEGATED = "{0} looks mirrored, q and tau alike: its axis points the other way"
    ALL_TORQUES_NEGATED = "the torques of all joints look negated"
    TORQUES_PERMUTED = "the torques look permuted: {order}"
    POSITIONS_PERMUTED = "the positions look permuted: {order}"
    JOINTS_PERMUTED = "the columns look permuted, q and tau alike: {order}"
    ZERO_SHIFTED = "the zero of {0} looks {amount:+.0f} degrees away from the file's"
    DEGREES = "q looks like degrees"
    SCALE = "tau of {0} is {amount:.3g} times what the file's masses can mean: in other units, or at the motor's side?"
    ALL_SCALED = "the torques are {amount:.3g} times what the file's masses hold: currents, or before gears?"
    GRAVITY_ABSENT = "these torques hold no gravity: it was taken out before they were logged"
    GRAVITY_TURNED = "gravity points along {vector}, {amount:.0f} degrees from the file's: the base stands otherwise"


SCALES = (MistakeKind.SCALE, MistakeKind.ALL_SCALED)
"""Mistakes that only a file with true masses can tell."""


@dataclass(frozen=True)
class Column:
    """The column that holds a joint's values.

    Attributes:
        joint: Whose name or number the column bears.
        position_negated: Whether its positions have the other sign.
        torque_negated: Whether its torques have.
    """

    joint: str
    position_negated: bool = False
    torque_negated: bool = False

    @property
    def words(self) -> str:
        """The column's name, with its signs."""
        turned = [word for word, is_so in (("q", self.position_negated), ("tau", self.torque_negated)) if is_so]
        return f"{self.joint} with {' and '.join(turned)} negated" if turned else self.joint


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """One reading of the log under which the model file explains it far better.

    Attributes:
        kind: What was mistaken.
        joints: Whose columns; of all joints where gravity is the mistake.
        amount: Degrees of a shifted zero or of gravity's turn, factor of a scale; 0 for the others.
        gain: Evidence for it [nats].
        explained: Share of the torque's variance that bodies near the file's explain of these joints, mean: as logged,
            corrected.
        alternatives: Other readings that do nearly as well, in words.
        order: Of permuted columns, for each of ``joints`` the column that holds its values.
        gravity: That the log asks for [m/s²]; empty where gravity is not the mistake.
    """

    kind: MistakeKind
    joints: tuple[str, ...]
    amount: float = 0.0
    gain: float = 0.0
    explained: tuple[float, float] = (0.0, 0.0)
    alternatives: tuple[str, ...] = ()
    order: tuple[Column, ...] = ()
    gravity: tuple[float, ...] = ()

    @property
    def words(self) -> str:
        """What looks wrong."""
        moved = zip(self.joints, self.order, strict=False)
        order = ", ".join(f"{joint} is logged as {one.words}" for joint, one in moved)
        vector = f"({' '.join(map(_number, self.gravity))}) m/s²"
        return self.kind.value.format(*self.joints, amount=self.amount, order=order, vector=vector)

    @property
    def sentence(self) -> str:
        """What looks wrong, why, and what was done about it: a torque's sign is taken so, nothing else is changed."""
        others = f" (or else: {'; '.join(self.alternatives)})" if self.alternatives else ""
        before, after = self.explained
        done = "It was taken so" if self.negated_torques else "Nothing was changed"
        return (
            f"{self.words}{others}. Bodies near the model file's explain {before:.1%} of that torque's variance as "
            f"logged, {after:.1%} so corrected. {done}; {self._remedy}"
        )

    @property
    def option(self) -> str | None:
        """Words of the command line that mend it; None where the log or the file must be mended."""
        if self.gravity:
            return f"--gravity {' '.join(map(_number, self.gravity))}"
        return f"--flip {self.flip}" if self.flip else None

    @property
    def _remedy(self) -> str:
        if self.gravity:
            return f"check where the base stands and what the torques hold, or try {self.option}"
        if self.order:
            return "check the order of the log's columns and rename them so"
        return "check the log's columns and the file's axes" + (
            f", or read it so by {self.option}" if self.option else ""
        )

    @property
    def flip(self) -> str | None:
        """What :meth:`casysid.recording.Recording.flipped` is to be told; None where a sign is not the mistake."""
        match self.kind:
            case MistakeKind.TORQUE_NEGATED:
                return f"tau_{self.joints[0]}"
            case MistakeKind.POSITION_NEGATED:
                return f"q_{self.joints[0]}"
            case MistakeKind.AXIS_NEGATED:
                return self.joints[0]
            case MistakeKind.ALL_TORQUES_NEGATED:
                return "tau"
            case _:
                return None

    @property
    def negated_torques(self) -> tuple[str, ...]:
        """Joints whose torque has the other sign, where no other reading does nearly as well."""
        is_sign = self.kind in (MistakeKind.TORQUE_NEGATED, MistakeKind.ALL_TORQUES_NEGATED)
        return self.joints if is_sign and not self.alternatives else ()

    def to_json(self) -> dict[str, object]:
        """Plain words and numbers."""
        return {
            "kind": self.kind.name.lower(),
            "joints": list(self.joints),
            "amount": self.amount,
            "gain": self.gain,
            "explained": list(self.explained),
            "words": self.words,
            "alternatives": list(self.alternatives),
            "option": self.option,
            "order": {joint: one.words for joint, one in zip(self.joints, self.order, strict=False)},
            "gravity": list(self.gravity),
        }


def torque_signs(mistakes: Sequence[Mistake], dofs: Sequence[str]) -> Array:
    """-1 where a degree of freedom's torque is clearly logged with the other sign, else 1, shape (nv,)."""
    negated = [joint for mistake in mistakes for joint in mistake.negated_torques]
    return np.array([(-1.0) ** negated.count(dof) for dof in dofs])


def _number(value: float) -> str:
    """A component of gravity, without a sign before zero."""
    return f"{round(value, 2) + 0.0:g}"

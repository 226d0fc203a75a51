"""Where each parameter comes from: how far the data decided it and how far the model file, and what more they could.

A parameter that counts only in combination is decided in part by the file whatever the motion: the mechanism sets what
perfect data could decide of it. Excited it is when these data decide most of that.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.estimation.base import Spread
from casysid.identifiability import BaseParameters, Identifiability

MOSTLY, HARDLY = 0.8, 0.2
"""Shares of what the mechanism lets anyone know, above which a parameter is excited, and below which it is not."""
HALF = 0.5
"""What the data decided less than this share of is the model file's."""


class Excitation(enum.Enum):
    """Whether the recordings show a parameter as far as the mechanism can; the value is the phrase a user reads."""

    EXCITED = "excited"
    WEAK = "weakly excited"
    NOT = "not excited"
    IMPOSSIBLE = "no torque depends on it"


@dataclass(frozen=True, eq=False)
class Sources:
    """What decided each of the p parameters.

    Attributes:
        names: Of the parameters.
        identifiable: What the mechanism lets anyone know of them.
        by_data: Share that the data decided, between 0 and 1; the rest is the model file's, shape (p,). What no torque
            depends on is decided as far as it goes along with what is seen, as in a body of the file's proportions.
        decidable: Share that perfect data would decide, shape (p,).
    """

    names: tuple[str, ...]
    identifiable: tuple[Identifiability, ...]
    by_data: Array
    decidable: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "by_data", frozen(self.by_data))
        object.__setattr__(self, "decidable", frozen(self.decidable))

    @property
    def excitation(self) -> tuple[Excitation, ...]:
        """Of every parameter."""
        return tuple(
            Excitation.IMPOSSIBLE if known is Identifiability.NOT_AT_ALL else _excitation(by_data, decidable)
            for known, by_data, decidable in zip(self.identifiable, self.by_data, self.decidable, strict=True)
        )

    def within(self, places: slice) -> Sources:
        """The same of some of the parameters."""
        return Sources(self.names[places], self.identifiable[places], self.by_data[places], self.decidable[places])

    @property
    def of_the_file(self) -> tuple[str, ...]:
        """Names of the parameters that are the model file's rather than the data's."""
        return tuple(name for name, share in zip(self.names, self.by_data, strict=True) if share < HALF)


def sources_of(spread: Spread, structural: BaseParameters) -> Sources:
    """What decided the parameters of an estimate.

    Args:
        spread: Of the estimate.
        structural: What the mechanism lets anyone know.
    """
    each = np.eye(len(structural.names))
    by_data, decidable = spread.decided(each), spread.decidable(each, structural.transform)
    return Sources(structural.names, structural.identifiability(), np.minimum(by_data, decidable), decidable)


def _excitation(by_data: float, decidable: float) -> Excitation:
    if by_data >= MOSTLY * decidable:
        return Excitation.EXCITED
    return Excitation.NOT if by_data < HARDLY * decidable else Excitation.WEAK

"""What machines are compared by: masses, combinations of first moments that torque depends on, and friction."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.dynamics.drive import Parameter
from casysid.identifiability import BaseParameters
from casysid.identification.result import is_dry

VISCOUS = "viscous"
FIRST_MOMENTS = ("mcx", "mcy", "mcz")


@dataclass(frozen=True, eq=False)
class Quantities:
    """Weighted sums of parameters.

    Attributes:
        names: Of each.
        units: Of each.
        weights: Of the parameters, shape (k, p).
        non_negative: Which cannot be below zero, shape (k,).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    weights: Array
    non_negative: Array


def quantities_of(regressor: Regressor, structural: BaseParameters) -> Quantities:
    """The mass of all links and of each, combinations led by first moments, dry and viscous friction by joint."""
    parameters = regressor.parameters
    rows = [*_masses(parameters), *_moments(parameters, structural), *_friction(parameters)]
    names, units, weights, non_negative = zip(*rows, strict=True)
    return Quantities(names, units, frozen(np.array(weights)), frozen(np.array(non_negative)))


Row = tuple[str, str, Array, bool]


def _masses(parameters: Sequence[Parameter]) -> Iterator[Row]:
    mass = np.array([float(one.kind == "m") for one in parameters])
    yield "mass of all links", "kg", mass, True
    for one, alone in zip(parameters, np.eye(len(parameters)), strict=True):
        if one.kind == "m":
            yield f"mass of {one.owner}", "kg", alone, True


def _moments(parameters: Sequence[Parameter], structural: BaseParameters) -> Iterator[Row]:
    for leading, words, weights in zip(structural.independent, structural.words(), structural.transform, strict=True):
        if parameters[int(leading)].kind in FIRST_MOMENTS:
            yield words, parameters[int(leading)].unit, weights, False


def _friction(parameters: Sequence[Parameter]) -> Iterator[Row]:
    """Of every owner once it slides: all dry friction but that of the load, as in the result's tables."""
    owners = dict.fromkeys(one.owner for one in parameters if one.kind == VISCOUS or is_dry(one.kind))
    for words, belongs in (("dry friction", is_dry), (VISCOUS, VISCOUS.__eq__)):
        for owner in owners:
            chosen = [one.owner == owner and bool(belongs(one.kind)) for one in parameters]
            if any(chosen):
                yield f"{words} of {owner}", parameters[chosen.index(True)].unit, np.array(chosen, dtype=float), True

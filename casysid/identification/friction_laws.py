"""What friction cannot be otherwise: no coefficient is negative, and no direction of motion is driven by it."""

from __future__ import annotations

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import Armature, Regressor
from casysid.projection import LinearKnowledge

ROUNDING = 1e-6
"""A law is kept when it is missed by no more than this share of its joint's largest coefficient: a solver's digits."""


def friction_laws(regressor: Regressor) -> tuple[LinearKnowledge, ...]:
    """What friction obeys beside the signs of its coefficients: no direction of motion is driven by it."""
    return tuple(
        LinearKnowledge(coefficients=law.coefficients, lower=0.0, name=law.name) for law in regressor.friction_laws
    )


def physics_rows(regressor: Regressor) -> Array:
    """Rows ``A`` of ``A θ ≥ 0``, shape (r, p), that friction obeys: no negative coefficients, no motion that is driven.

    Armature is left out: what it shares with a link's inertia cannot be told apart.
    """
    places = {parameter.name: k for k, parameter in enumerate(regressor.parameters)}
    signs = [
        {parameter.name: 1.0}
        for parameter in regressor.parameters[regressor.robot.inertial_parameters.size :]
        if parameter.non_negative and parameter.kind != Armature.kind
    ]
    laws = [*signs, *(dict(law.coefficients) for law in regressor.friction_laws)]
    rows = np.zeros((len(laws), len(places)))
    for row, law in enumerate(laws):
        for name, coefficient in law.items():
            rows[row, places[name]] = coefficient
    return rows


def broken_laws(regressor: Regressor, parameters: Array) -> tuple[str, ...]:
    """Names of the laws of :func:`friction_laws` that parameters of shape (p,) break."""
    values = dict(zip(regressor.names, parameters, strict=True))
    owners = {parameter.name: parameter.owner for parameter in regressor.parameters}
    largest: dict[str, float] = {}
    for name, value in values.items():
        largest[owners[name]] = max(largest.get(owners[name], 0.0), abs(float(value)))
    broken = [
        law.name
        for law in regressor.friction_laws
        if sum(weight * values[name] for name, weight in law.coefficients.items())
        < -ROUNDING * max(largest[owners[name]] for name in law.coefficients)
    ]
    return tuple(dict.fromkeys(broken))

"""What is known beside the data: weighed links, a total mass, where a centre of mass can be.

All of it is linear in the parameters, so the convex problem stays convex.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.projection.layout import Layout

TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, kw_only=True)
class LinearKnowledge:
    """``lower ≤ Σ coefficient · parameter ≤ upper``; an equality when both are the same.

    Attributes:
        coefficients: By parameter name, such as ``{"link_1.m": 1.0, "link_2.m": 1.0}``.
        lower: May be -inf.
        upper: May be inf.
        name: By which the result speaks of it; the parameters' names when empty.
    """

    coefficients: Mapping[str, float]
    lower: float = -math.inf
    upper: float = math.inf
    name: str = ""

    def __post_init__(self) -> None:
        if not self.lower <= self.upper:
            raise ParameterError(f"projection: {dict(self.coefficients)} cannot lie in [{self.lower}, {self.upper}]")


@dataclass(frozen=True)
class KeptLink:
    """A link that stays exactly as the prior has it."""

    link: str


Knowledge = LinearKnowledge | KeptLink


def parameter_within(name: str, lower: float = -math.inf, upper: float = math.inf) -> LinearKnowledge:
    """Bounds on one parameter, by its name."""
    return LinearKnowledge(coefficients={name: 1.0}, lower=lower, upper=upper)


def link_mass(link: str, lower: float, upper: float | None = None) -> LinearKnowledge:
    """The mass of a weighed link [kg], or the range it lies in."""
    return parameter_within(f"{link}.m", lower, lower if upper is None else upper)


def total_mass(links: Iterable[str], lower: float, upper: float | None = None) -> LinearKnowledge:
    """The mass of several links together [kg], or the range it lies in."""
    masses = {f"{link}.m": 1.0 for link in links}
    highest = lower if upper is None else upper
    return LinearKnowledge(coefficients=masses, lower=lower, upper=highest, name="total mass")


def center_of_mass_within(link: str, lower: Sequence[float], upper: Sequence[float]) -> tuple[LinearKnowledge, ...]:
    """The centre of mass inside a box of the link's joint frame [m]: ``lower m ≤ m c ≤ upper m``, which is linear."""
    return tuple(
        LinearKnowledge(
            coefficients={f"{link}.mc{axis}": sign, f"{link}.m": -sign * bound},
            lower=0.0,
            name=f"{link} centre of mass {axis}",
        )
        for axis, low, high in zip("xyz", lower, upper, strict=True)
        for sign, bound in ((1.0, low), (-1.0, high))
    )


@dataclass(frozen=True, eq=False)
class Constraints:
    """Knowledge as matrices.

    Attributes:
        matrix: ``A`` of ``lower ≤ A θ ≤ upper``, shape (c, p).
        lower: Shape (c,).
        upper: Shape (c,).
        names: What each row is about.
        kept: Which of the p parameters stay at the prior, shape (p,).
    """

    matrix: Array
    lower: Array
    upper: Array
    names: tuple[str, ...]
    kept: npt.NDArray[np.bool_]

    def in_coordinates(self, transform: Array) -> tuple[Array, Array, Array]:
        """``A T``, lower and upper for ``θ = T φ``, every row divided by its length."""
        rows = self.matrix @ transform
        length = np.maximum(np.linalg.norm(rows, axis=1), TINY)
        return rows / length[:, None], self.lower / length, self.upper / length

    def violation(self, parameters: Array) -> float:
        """By how much ``A θ`` leaves its bounds at most, relative to the sizes of the terms; 0 if nowhere."""
        value = self.matrix @ parameters
        excess = np.maximum(np.maximum(self.lower - value, value - self.upper), 0.0)
        return float(np.max(excess / (np.abs(self.matrix) @ np.abs(parameters) + excess + TINY), initial=0.0))


def constraints_of(layout: Layout, knowledge: Sequence[Knowledge]) -> Constraints:
    """Knowledge as matrices.

    Raises:
        ParameterError: A parameter or link does not exist.
    """
    kept = np.zeros(len(layout), dtype=np.bool_)
    rows = [item for item in knowledge if isinstance(item, LinearKnowledge)]
    for item in knowledge:
        if isinstance(item, KeptLink):
            kept[layout.columns_of_link(item.link)] = True
    matrix = np.zeros((len(rows), len(layout)))
    for row, item in enumerate(rows):
        for name, coefficient in item.coefficients.items():
            if name not in layout.places:
                raise ParameterError(f"projection: no parameter is called {name!r}; names are like {layout.names[0]!r}")
            matrix[row, layout.places[name]] = coefficient
    lower, upper = (frozen([getattr(item, side) for item in rows]) for side in ("lower", "upper"))
    return Constraints(
        matrix=frozen(matrix),
        lower=lower,
        upper=upper,
        names=tuple(item.name or " + ".join(item.coefficients) for item in rows),
        kept=kept,
    )

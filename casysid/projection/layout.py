"""Which columns of the regressor are links, and which numbers cannot be negative."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from casysid.errors import ParameterError
from casysid.inertia import KINDS


class ParameterLike(Protocol):
    """What the projection has to know of one column of the regressor."""

    @property
    def name(self) -> str:
        """Unique, such as ``link_1.m``."""

    @property
    def owner(self) -> str:
        """The link or joint it belongs to."""

    @property
    def kind(self) -> str:
        """``m`` ... ``Izz`` for links, anything else for joints."""

    @property
    def non_negative(self) -> bool:
        """Whether it cannot be negative; links are looked after by their consistency."""


@dataclass(frozen=True)
class Layout:
    """The order of the parameters: ten for each link, then single numbers of the joints.

    Attributes:
        names: Of all p parameters.
        links: Of the links.
        non_negative: Of the p parameters, the single numbers that cannot be negative.
    """

    names: tuple[str, ...]
    links: tuple[str, ...]
    non_negative: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.names)

    @property
    def inertial(self) -> int:
        """Number of parameters that belong to links."""
        return 10 * len(self.links)

    @cached_property
    def places(self) -> dict[str, int]:
        """Column by name."""
        return {name: place for place, name in enumerate(self.names)}

    def columns_of_link(self, link: str) -> range:
        """The ten columns of a link.

        Raises:
            ParameterError: There is no such link.
        """
        if link not in self.links:
            raise ParameterError(f"projection: no link is called {link!r}; there are {', '.join(self.links)}")
        start = 10 * self.links.index(link)
        return range(start, start + 10)


def layout_of(parameters: Sequence[ParameterLike]) -> Layout:
    """Read the layout off the regressor's parameters.

    Raises:
        ParameterError: Links are not ten consecutive parameters in Pinocchio's order, before all others.
    """
    kinds = tuple(parameter.kind for parameter in parameters)
    bodies = sum(kind in KINDS for kind in kinds) // 10
    if kinds[: 10 * bodies] != KINDS * bodies or any(kind in KINDS for kind in kinds[10 * bodies :]):
        raise ParameterError(
            f"projection: wanted links first, each {', '.join(KINDS)} in this order; got the kinds {', '.join(kinds)}"
        )
    single = range(10 * bodies, len(parameters))
    return Layout(
        tuple(parameter.name for parameter in parameters),
        tuple(parameters[10 * body].owner for body in range(bodies)),
        tuple(place for place in single if parameters[place].non_negative),
    )


def as_vector(name: str, values: npt.ArrayLike, size: int) -> npt.NDArray[np.float64]:
    """A float vector of the given size.

    Raises:
        ParameterError: It has another shape, or numbers that are not finite.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise ParameterError(f"projection: {name} must be {size} finite numbers; got shape {array.shape}")
    return array

"""What makes one information matrix better than another, each as a smooth function with its derivative."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy.linalg

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError


class Criterion(ABC):
    """A function of the base parameters' information matrix ``F``, to be minimised."""

    name: ClassVar[str]

    @abstractmethod
    def evaluate(self, information: Array) -> tuple[float, Array]:
        """Value, and derivative with respect to ``F``, symmetric, shape (r, r); inf when ``F`` is singular."""


@dataclass(frozen=True)
class DOptimal(Criterion):
    """``-log det F``: the volume of the confidence ellipsoid. Does not depend on units and scales of the parameters."""

    name: ClassVar[str] = "D"

    def evaluate(self, information: Array) -> tuple[float, Array]:
        """``-log det F`` and ``-F⁻¹``."""
        try:
            factor = scipy.linalg.cho_factor(information, lower=True)
        except np.linalg.LinAlgError:
            return np.inf, np.zeros_like(information)
        inverse = scipy.linalg.cho_solve(factor, np.eye(len(information)))
        return -2.0 * float(np.log(np.diag(factor[0])).sum()), -(inverse + inverse.T) / 2.0


@dataclass(frozen=True)
class ConditionNumber(Criterion):
    """``log ‖F‖_p + log ‖F⁻¹‖_p``, which tends to ``log cond F`` as p grows, and is smooth where that has kinks.

    Attributes:
        power: p of the Schatten norms.
        weight: Of the factor in the objective, so that solvers see a change of one hundredth.
    """

    power: float = 8.0
    weight: float = 10.0
    name: ClassVar[str] = "condition"

    def __post_init__(self) -> None:
        if not self.power >= 1.0:
            raise ParameterError(f"condition number: power must be at least 1; got {self.power}")

    def evaluate(self, information: Array) -> tuple[float, Array]:
        """The smooth bound, and its derivative through the eigenvalues."""
        values, vectors = np.linalg.eigh(information)
        if values[0] <= 0.0:
            return np.inf, np.zeros_like(information)
        p = self.power
        large, small = values / values[-1], values[0] / values  # at most 1, so that no power overflows
        upper, lower = (large**p).sum(), (small**p).sum()
        value = np.log(values[-1] / values[0]) + (np.log(upper) + np.log(lower)) / p
        slopes = (large**p / upper - small**p / lower) / values
        return self.weight * float(value), self.weight * (vectors * slopes) @ vectors.T


@dataclass(frozen=True)
class Balanced(Criterion):
    """``-log det F + w log cond F``, the condition number's logarithm smooth as in :class:`ConditionNumber`.

    The volume of the confidence ellipsoid alone cares little for its longest axis. With the second term, which counts
    the best and the worst known direction ``w`` times more, motions have nearly the same volume and are several times
    better conditioned; they are also found more reliably.

    Attributes:
        weight: ``w``; 0 is D-optimality.
        power: Of the Schatten norms.
    """

    weight: float = 3.0
    power: float = 8.0
    name: ClassVar[str] = "balanced"

    def __post_init__(self) -> None:
        if not 0.0 <= self.weight < np.inf:
            raise ParameterError(f"balanced criterion: weight must be a number from 0 up; got {self.weight}")

    def evaluate(self, information: Array) -> tuple[float, Array]:
        """The sum of both, and its derivative."""
        volume, first = DOptimal().evaluate(information)
        if not np.isfinite(volume):
            return np.inf, first
        shape, second = ConditionNumber(self.power, self.weight).evaluate(information)
        return volume + shape, first + second


@dataclass(frozen=True, eq=False)
class AOptimal(Criterion):
    """``r log tr(W F⁻¹)``: the mean variance of chosen parameters or of predicted torque, by the matrix ``W``.

    Attributes:
        weights: ``W``, shape (r, r), positive semidefinite, in the scaled coordinates of ``F``.
    """

    weights: Array = field(repr=False)
    name: ClassVar[str] = "A"

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", frozen(self.weights))

    def evaluate(self, information: Array) -> tuple[float, Array]:
        """``r log tr(W F⁻¹)`` and ``-r F⁻¹ W F⁻¹ / tr(W F⁻¹)``."""
        try:
            factor = scipy.linalg.cho_factor(information, lower=True)
        except np.linalg.LinAlgError:
            return np.inf, np.zeros_like(information)
        half = scipy.linalg.cho_solve(factor, self.weights)  # F⁻¹ W
        trace, size = float(np.trace(half)), len(information)
        slope = -scipy.linalg.cho_solve(factor, half.T) * (size / trace)
        return size * float(np.log(trace)), (slope + slope.T) / 2.0

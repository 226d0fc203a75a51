"""Finite Fourier series that start at rest, and the motion of all joints along them.

A joint moves as ``q(t) = s + Σ_k a_k sin kωt + b_k (cos kωt - 1)`` (Swevers, Ganseman, Tükel, de Schutter, van Brussel
1997, Eq. (10), there without the demand for rest). It starts at ``s``; velocity and acceleration vanish there when
``Σ k a_k = 0`` and ``Σ k² b_k = 0``. The coefficients that obey these two equations are coordinates in their null
space, so every vector of coordinates is a motion from rest to rest, as often as wanted.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.robot import Robot
from casysid.robot.coordinates import State, state_from_channels

ORDERS = 4
"""Position, velocity, acceleration, jerk."""


class Motion(NamedTuple):
    """Joint positions [rad, m] and their first three derivatives in time, each of shape (N, n)."""

    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array


@dataclass(frozen=True)
class FourierSeries:
    """The basis of one joint's motion.

    Attributes:
        period: After which the motion repeats, at rest [s].
        harmonics: Multiples of the base frequency ``1/period``, at least 2.
    """

    period: float
    harmonics: int

    def __post_init__(self) -> None:
        if not (np.isfinite(self.period) and self.period > 0.0):
            raise ParameterError(f"Fourier series: period must be a positive number of seconds; got {self.period}")
        if self.harmonics != int(self.harmonics) or self.harmonics < 2:
            raise ParameterError(
                "Fourier series: harmonics must be a whole number, at least 2, as one alone cannot start at rest; "
                f"got {self.harmonics}"
            )

    @property
    def size(self) -> int:
        """Number of coordinates beside the start."""
        return 2 * (self.harmonics - 1)

    @property
    def frequencies(self) -> Array:
        """Of the harmonics [Hz], shape (harmonics,)."""
        return np.arange(1, self.harmonics + 1) / self.period

    @cached_property
    def rest(self) -> tuple[Array, Array]:
        """Orthonormal bases of the sines' and the cosines' coefficients at rest, each (harmonics, harmonics - 1)."""
        k = np.arange(1.0, self.harmonics + 1.0)
        return tuple(frozen(np.linalg.qr((k**power)[:, None], mode="complete")[0][:, 1:]) for power in (1, 2))  # type: ignore[return-value]

    def basis(self, time: npt.ArrayLike, order: int = 0) -> Array:
        """Derivative of that order of all coordinates' functions at times (N,), shape (N, size)."""
        w = 2.0 * np.pi * self.frequencies
        angle = np.multiply.outer(np.asarray(time, dtype=np.float64), w) + order * np.pi / 2.0  # d/dt turns by 90°
        sine, cosine = w**order * np.sin(angle), w**order * np.cos(angle)
        if order == 0:
            cosine = cosine - 1.0
        return np.asarray(np.hstack([sine @ self.rest[0], cosine @ self.rest[1]]))

    def coefficients(self, coordinates: Array) -> tuple[Array, Array]:
        """Coefficients ``a`` of the sines and ``b`` of the cosines, each (n, harmonics), of coordinates (n, size)."""
        half = self.harmonics - 1
        return coordinates[:, :half] @ self.rest[0].T, coordinates[:, half:] @ self.rest[1].T

    def grid(self, samples: int) -> Array:
        """So many instants of one period at equal distances, shape (samples,), [s]."""
        return np.asarray(np.arange(samples) * (self.period / samples), dtype=np.float64)


@dataclass(frozen=True, eq=False, kw_only=True)
class ExcitationTrajectory:
    """The motion of all joints, from rest to rest.

    Attributes:
        robot: Whose joints move.
        series: The basis.
        start: Positions at the start, and after every period, shape (n,), [rad, m].
        coordinates: Of each joint along the basis, shape (n, series.size), [rad, m].
        periods: How often the motion is repeated.
    """

    robot: Robot
    series: FourierSeries
    start: Array
    coordinates: Array
    periods: int = 1

    def __post_init__(self) -> None:
        for name in ("start", "coordinates"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        n = len(self.robot.dofs)
        if self.start.shape != (n,) or self.coordinates.shape != (n, self.series.size):
            raise ParameterError(
                f"trajectory: wanted start ({n},) and coordinates ({n}, {self.series.size}); "
                f"got {self.start.shape} and {self.coordinates.shape}"
            )
        if self.periods != int(self.periods) or self.periods < 1:
            raise ParameterError(f"trajectory: periods must be a positive whole number; got {self.periods}")

    @property
    def duration(self) -> float:
        """Of all periods [s]."""
        return self.periods * self.series.period

    def motion(self, time: npt.ArrayLike) -> Motion:
        """Positions and derivatives at times (N,), [s]."""
        parts = [self.series.basis(time, order) @ self.coordinates.T for order in range(ORDERS)]
        return Motion(self.start + parts[0], *parts[1:])

    def state(self, time: npt.ArrayLike) -> State:
        """Pinocchio's q, v, a at times (N,), [s]."""
        return state_of(self.robot, self.motion(time))

    @property
    def offset(self) -> Array:
        """The series' constant term, about which the joints swing, shape (n,), [rad, m]."""
        return np.asarray(self.start - self.series.coefficients(self.coordinates)[1].sum(axis=1))


def state_of(robot: Robot, motion: Motion) -> State:
    """Pinocchio's q, v, a of joint positions and their derivatives."""
    return state_from_channels(robot, motion.position, motion.velocity, motion.acceleration)

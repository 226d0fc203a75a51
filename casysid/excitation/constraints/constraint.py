"""A constraint: bounded functions of the motion at one instant, with their derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.excitation.motion.fourier import Motion

Slopes = dict[int, Array]
"""Derivatives with respect to position (0), velocity (1), acceleration (2) or jerk (3), each (N, m, n)."""


class Constraint(ABC):
    """``lower <= measure(motion) <= upper`` at every instant.

    Attributes:
        kind: Of quantity.
        labels: Of each of the m functions, for messages.
        units: Of each.
        lower: Shape (m,).
        upper: Shape (m,).
        scale: What a violation is large or small against, shape (m,).
        dense: Whether it can be violated and kept again within a short time.
    """

    kind: str
    labels: tuple[str, ...]
    units: tuple[str, ...]
    lower: Array
    upper: Array
    scale: Array
    dense: ClassVar[bool] = False

    @abstractmethod
    def measure(self, motion: Motion) -> Array:
        """Values at all instants, shape (N, m)."""

    @abstractmethod
    def constrain(self, motion: Motion) -> Array:
        """What an optimiser sees, in units of the scale, shape (N, k)."""

    @abstractmethod
    def slopes(self, motion: Motion) -> Slopes:
        """Derivatives of :meth:`constrain`."""

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of :meth:`constrain`, each (k,)."""
        return self.lower / self.scale, self.upper / self.scale

    @property
    @abstractmethod
    def depends(self) -> npt.NDArray[np.bool_]:
        """Which joints each function of :meth:`constrain` can depend on, shape (k, n)."""

    def slack(self, motion: Motion) -> Array:
        """How far the values stay within their bounds, shape (N, m); negative where they do not."""
        values = self.measure(motion)
        return np.minimum(values - self.lower, self.upper - values)

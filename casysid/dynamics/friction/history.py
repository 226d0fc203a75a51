"""What friction remembers: signals that come from the course of a motion, not from its state at one instant."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array


class History(ABC):
    """A signal along a direction, from the samples so far in order of time."""

    @abstractmethod
    def values(self, time: Array, position: Array) -> Array:
        """The signal at every sample, shape (N,).

        Args:
            time: [s], or the samples' numbers, shape (N,).
            position: Along the direction, shape (N,); an angle goes on beyond a turn.
        """

    def slid(self, velocity: Any) -> Any:
        """The signal after a long way in the direction of a velocity, CasADi expressions; zero unless a kind says else.

        It stands for what is remembered where a state is given without those before it.
        """
        return 0.0 * velocity

    def moved(self, signal: Any, way: Any) -> Any:
        """The signal one sample later, after a way along the direction, CasADi expressions; the same if not said."""
        return signal


@dataclass(frozen=True)
class Play(History):
    """How far a spring with a slider is stretched, in [-1, 1]: ``ds = dq / displacement`` until it slides.

    It starts slack. Between two samples, across a gap as well, the motion counts as going one way.

    Attributes:
        displacement: From slack to sliding [rad or m], positive.

    Source: the elasto-slide element of Maxwell's slip model (Al-Bender, Lampaert and Swevers 2005).
    """

    displacement: float

    def values(self, time: Array, position: Array) -> Array:
        """The stretch.

        Between two reversals it is a clipped linear function of position, so that a loop over the reversals is enough.
        """
        x = np.asarray(position, dtype=np.float64) / self.displacement
        turns = _reversals(x)
        stretch = [0.0]
        for moved in np.diff(x[turns]).tolist():
            stretch.append(min(max(stretch[-1] + moved, -1.0), 1.0))
        turned = np.zeros(len(x), dtype=np.intp)
        turned[turns] = 1
        last = np.cumsum(turned) - 1
        return np.asarray(np.clip(np.array(stretch)[last] + x - x[turns[last]], -1.0, 1.0))

    def slid(self, velocity: Any) -> Any:
        """Stretched as far as it goes; slack at rest."""
        return ca.sign(velocity)

    def moved(self, signal: Any, way: Any) -> Any:
        """The stretch one sample later."""
        return ca.fmin(ca.fmax(signal + way / self.displacement, -1.0), 1.0)


@dataclass(frozen=True)
class Trend(History):
    """Time itself, from -1 at the first sample to 1 at the last."""

    def values(self, time: Array, position: Array) -> Array:
        """The trend; zero where no time passes."""
        half = 0.5 * float(time[-1] - time[0])
        return np.asarray((time - time[0]) / half - 1.0 if half > 0.0 else np.zeros(len(time)))


def _reversals(x: Array) -> npt.NDArray[np.intp]:
    """Indices of the first sample and of those where the way changes: no two ways lie between two of them."""
    ways = np.sign(np.diff(x))
    moving = np.flatnonzero(ways)
    turned = moving[1:][ways[moving[1:]] != ways[moving[:-1]]]
    return np.concatenate([[0], turned]).astype(np.intp)

"""Distances to keep between links, and to obstacles."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.excitation.constraints.clearance import Clearance, Found
from casysid.excitation.constraints.constraint import Constraint, Slopes
from casysid.excitation.constraints.kinematics import Frames
from casysid.excitation.motion.fourier import Motion

SOFTNESS = 150.0
"""Sharpness of the smooth least distance, times the robot's reach."""


@dataclass(frozen=True, eq=False)
class ClearanceConstraint(Constraint):
    """Distances to keep. The optimiser sees one smooth function of them all, never above the least one.

    Attributes:
        every: All distances.
        near: Those that an optimiser needs to look at.
        margin: Distance to keep [m].
        reach: Length against which a violation counts [m].
    """

    every: Clearance
    near: Clearance
    margin: float
    reach: float
    _last: list[tuple[Array, Frames, Found]] = field(default_factory=list, repr=False)

    @property
    def kind(self) -> str:  # type: ignore[override]
        """Of quantity."""
        return "distance"

    dense: ClassVar[bool] = True

    @property
    def labels(self) -> tuple[str, ...]:  # type: ignore[override]
        """Who with whom."""
        return self.every.labels

    @property
    def units(self) -> tuple[str, ...]:  # type: ignore[override]
        """Metres."""
        return ("m",) * len(self.every)

    @property
    def lower(self) -> Array:  # type: ignore[override]
        """The margin."""
        return np.full(len(self.every), self.margin)

    @property
    def upper(self) -> Array:  # type: ignore[override]
        """None."""
        return np.full(len(self.every), np.inf)

    @property
    def scale(self) -> Array:  # type: ignore[override]
        """The reach."""
        return np.full(len(self.every), self.reach)

    def measure(self, motion: Motion) -> Array:
        """All distances."""
        return self.every.distances(motion.position)

    def constrain(self, motion: Motion) -> Array:
        """One function: Kreisselmeier and Steinhauser's (1979) smooth greatest violation, an upper bound."""
        if not len(self.near):
            return np.full((len(motion.position), 1), -1.0)
        return self._soft(self._at(motion.position)[1].near.distance)[0]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Not above 0."""
        return np.array([-np.inf]), np.zeros(1)

    def slopes(self, motion: Motion) -> Slopes:
        """The distances' derivatives, weighted by how near each is."""
        if not len(self.near):
            return {0: np.zeros((len(motion.position), 1, motion.position.shape[1]))}
        frames, found = self._at(motion.position)
        weights = self._soft(found.near.distance)[1] / -self.reach
        return {0: self.near.pull_back(frames, found, weights)[:, None]}

    def _at(self, position: Array) -> tuple[Frames, Found]:
        """What is near; the slopes are asked for where the values were."""
        if not self._last or self._last[0][0] is not position:
            frames = self.near.points.frames(position)
            self._last[:] = [(position, frames, self.near.closest(frames))]
        return self._last[0][1:]

    def _soft(self, distances: Array) -> tuple[Array, Array]:
        exponent = SOFTNESS * (self.margin - distances) / self.reach
        top = exponent.max(axis=1, keepdims=True)
        powers = np.exp(exponent - top)
        total = powers.sum(axis=1, keepdims=True)
        return (np.log(total) + top) / SOFTNESS, powers / total

    @cached_property
    def depends(self) -> npt.NDArray[np.bool_]:
        """All joints."""
        return np.ones((1, len(self.every.points.robot.joints)), dtype=np.bool_)

"""Constraints on where the links are: distances to keep, a box to stay in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation.blocks import Block, Slopes
from casysid.excitation.clearance import Clearance
from casysid.excitation.kinematics import Kinematics
from casysid.excitation.series import Motion

SOFTNESS = 150.0
"""Sharpness of the smooth least distance, times the robot's reach."""


@dataclass(frozen=True, eq=False)
class ClearanceBlock(Block):
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
        return self._soft(self.near.distances(motion.position))[0]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Not above 0."""
        return np.array([-np.inf]), np.zeros(1)

    def slopes(self, motion: Motion) -> Slopes:
        """The distances' derivatives, weighted by how near each is."""
        if not len(self.near):
            return {0: np.zeros((len(motion.position), 1, motion.position.shape[1]))}
        distances, slopes = self.near.slopes(motion.position)
        weights = self._soft(distances)[1] / -self.reach
        return {0: np.einsum("nm,nmj->nj", weights, slopes)[:, None]}

    def _soft(self, distances: Array) -> tuple[Array, Array]:
        exponent = SOFTNESS * (self.margin - distances) / self.reach
        top = exponent.max(axis=1, keepdims=True)
        powers = np.exp(exponent - top)
        total = powers.sum(axis=1, keepdims=True)
        return (np.log(total) + top) / SOFTNESS, powers / total

    @cached_property
    def depends(self) -> npt.NDArray[np.bool_]:
        """All joints."""
        return np.ones((1, len(self.every.kinematics.robot.joints)), dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class KeepInBlock(Block):
    """A point of a link stays in a box along the world's axes.

    Attributes:
        kinematics: Of the robot.
        frame: Name of the link, for messages.
        joint: That moves the point.
        point: In that joint's child frame, shape (3,), [m].
        lower: Shape (3,), [m].
        upper: Shape (3,), [m].
    """

    kinematics: Kinematics
    frame: str
    joint: int
    point: Array
    lower: Array
    upper: Array

    @property
    def kind(self) -> str:  # type: ignore[override]
        """Of quantity."""
        return "keep-in box"

    def __post_init__(self) -> None:
        for name in ("point", "lower", "upper"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if (
            any(getattr(self, name).shape != (3,) for name in ("point", "lower", "upper"))
            or not (self.lower < self.upper).all()
        ):
            raise ParameterError(
                f"keep-in box of '{self.frame}': wanted two corners of three numbers, lower before upper; "
                f"got {self.lower} and {self.upper}"
            )

    @property
    def labels(self) -> tuple[str, ...]:  # type: ignore[override]
        """By axis."""
        return tuple(f"frame '{self.frame}' along {axis}" for axis in "xyz")

    @property
    def units(self) -> tuple[str, ...]:  # type: ignore[override]
        """Metres."""
        return ("m",) * 3

    @property
    def scale(self) -> Array:  # type: ignore[override]
        """Half the box, at most a metre."""
        return np.minimum((self.upper - self.lower) / 2.0, 1.0)

    def measure(self, motion: Motion) -> Array:
        """Where the point is."""
        frames = self.kinematics.frames(motion.position)
        return self.kinematics.points(frames, np.array([self.joint]), self.point[None])[:, 0]

    def constrain(self, motion: Motion) -> Array:
        """The same in units of the scale."""
        return np.asarray(self.measure(motion) / self.scale)

    def slopes(self, motion: Motion) -> Slopes:
        """The point's Jacobian."""
        frames, joint = self.kinematics.frames(motion.position), np.full(3, self.joint)
        point = self.kinematics.points(frames, joint, np.tile(self.point, (3, 1)))
        rows = self.kinematics.slopes(frames, joint, point, np.broadcast_to(np.eye(3), point.shape))
        return {0: rows / self.scale[:, None]}

    @cached_property
    def depends(self) -> npt.NDArray[np.bool_]:
        """Joints before it."""
        return np.tile(self.kinematics.moved_by[self.joint], (3, 1))

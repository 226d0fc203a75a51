"""A box in which a point of a link stays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation.constraints.constraint import Constraint, Slopes
from casysid.excitation.constraints.kinematics import Points
from casysid.excitation.motion.fourier import Motion
from casysid.robot import Robot


@dataclass(frozen=True, eq=False)
class KeepInConstraint(Constraint):
    """A point of a link stays in a box along the world's axes.

    Attributes:
        points: Of the robot.
        frame: Name of the link, for messages.
        joint: That moves the point.
        point: In that joint's child frame, shape (3,), [m].
        lower: Shape (3,), [m].
        upper: Shape (3,), [m].
    """

    points: Points
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
        return self.points.places(self.points.frames(motion.position), np.array([self.joint]), self.point[None])[
            ..., 0
        ].T

    def constrain(self, motion: Motion) -> Array:
        """The same in units of the scale."""
        return np.asarray(self.measure(motion) / self.scale)

    def slopes(self, motion: Motion) -> Slopes:
        """The point's Jacobian."""
        frames, joint = self.points.frames(motion.position), np.array([self.joint])
        place = self.points.places(frames, joint, self.point[None])
        along = [np.broadcast_to(axis[:, None, None], place.shape) for axis in np.eye(3)]
        rows = np.stack([self.points.pull_back(frames, joint, place, axis) for axis in along], axis=1)
        return {0: rows / self.scale[:, None]}

    @cached_property
    def depends(self) -> npt.NDArray[np.bool_]:
        """Joints before it."""
        return np.tile(self.points.moved_by[self.joint], (3, 1))


def keep_in(
    robot: Robot, link: str, lower: npt.ArrayLike, upper: npt.ArrayLike, point: npt.ArrayLike = (0.0, 0.0, 0.0)
) -> KeepInConstraint:
    """The demand that a point of a link stays in a box along the world's axes.

    Args:
        robot: Whose link it is.
        link: One of ``robot.links``.
        lower: Least corner, shape (3,), -inf for none [m].
        upper: Greatest corner, inf for none [m].
        point: In the link's joint frame, shape (3,), [m].

    Raises:
        ParameterError: There is no such link, or the corners are no box.
    """
    carriers = {joint.link: i for i, joint in enumerate(robot.joints)}
    if link not in robot.links:
        raise ParameterError(f"keep-in box: no link is named '{link}'; links are {', '.join(robot.links)}")
    values = [np.asarray(one, dtype=np.float64) for one in (point, lower, upper)]
    return KeepInConstraint(Points(robot), link, carriers[link], *values)

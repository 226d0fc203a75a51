"""What stands around a robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError


@dataclass(frozen=True, eq=False)
class HalfSpace:
    """Where the robot may be: ``normal · x >= offset``; a floor has the normal (0, 0, 1).

    Attributes:
        name: For messages.
        normal: Points to where the robot may be, shape (3,).
        offset: [m].
    """

    name: str
    normal: Array
    offset: float

    def __post_init__(self) -> None:
        normal = np.asarray(self.normal, dtype=np.float64)
        length = float(np.linalg.norm(normal)) if normal.shape == (3,) else 0.0
        if not (0.0 < length < np.inf and np.isfinite(self.offset)):
            raise ParameterError(f"half space '{self.name}': wanted a normal of three numbers and a finite offset")
        object.__setattr__(self, "normal", frozen(normal / length))
        object.__setattr__(self, "offset", float(self.offset) / length)


@dataclass(frozen=True, eq=False)
class Box:
    """An obstacle along the world's axes.

    Attributes:
        name: For messages.
        lower: Its least corner, shape (3,), [m].
        upper: Its greatest corner.
    """

    name: str
    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if self.lower.shape != (3,) or self.upper.shape != (3,) or not (self.lower < self.upper).all():
            raise ParameterError(
                f"box '{self.name}': wanted two corners of three numbers, lower before upper; "
                f"got {self.lower} and {self.upper}"
            )


Obstacle = HalfSpace | Box

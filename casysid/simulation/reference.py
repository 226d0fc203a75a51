"""What a controller is asked to follow: the motion at every tick, in Pinocchio's coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.robot import Robot
from casysid.robot.coordinates import state_from_channels


@dataclass(frozen=True, eq=False, kw_only=True)
class Reference:
    """A motion, sampled.

    Attributes:
        time: Shape (N,), [s].
        channels: Positions as a log has them, shape (N, channels).
        q: Configuration, shape (N, nq).
        v: Velocity, shape (N, nv).
        a: Acceleration, shape (N, nv).
    """

    time: Array
    channels: Array
    q: Array
    v: Array
    a: Array

    def __post_init__(self) -> None:
        for name in ("time", "channels", "q", "v", "a"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @classmethod
    def from_channels(
        cls, robot: Robot, time: npt.ArrayLike, position: npt.ArrayLike, first: npt.ArrayLike, second: npt.ArrayLike
    ) -> Reference:
        """The reference of logged positions (N, channels) and their two derivatives in time."""
        q, v, a = state_from_channels(robot, position, first, second)
        return cls(time=np.asarray(time), channels=np.asarray(position), q=q, v=v, a=a)

    def first(self, count: int) -> Reference:
        """The first ``count`` samples."""
        if count == len(self):
            return self
        rows = slice(count)
        return Reference(
            time=self.time[rows], channels=self.channels[rows], q=self.q[rows], v=self.v[rows], a=self.a[rows]
        )

    def __len__(self) -> int:
        return len(self.time)


class Trajectory(Protocol):
    """Anything that can be sampled at given times."""

    def sample(self, time: Array) -> Reference:
        """The motion at times (N,), [s] from the start."""
        ...

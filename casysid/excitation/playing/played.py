"""The whole of what is played: to the start of the designed motion, along it, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.excitation.motion.fourier import ExcitationTrajectory, Motion
from casysid.excitation.playing.way import Way


@dataclass(frozen=True, eq=False)
class PlayedMotion:
    """A designed motion, with a way to its start and the same way back.

    Attributes:
        trajectory: The designed motion.
        approach: The way; None if the robot is at the start already.
    """

    trajectory: ExcitationTrajectory
    approach: Way | None = None

    @property
    def begin(self) -> float:
        """When the designed motion begins [s]."""
        return 0.0 if self.approach is None else self.approach.duration

    @property
    def duration(self) -> float:
        """Of all [s]."""
        return self.trajectory.duration + 2.0 * self.begin

    def motion(self, time: npt.ArrayLike) -> Motion:
        """Positions and derivatives at times (N,), [s]."""
        t = np.asarray(time, dtype=np.float64)
        moved = self.trajectory.motion(np.clip(t - self.begin, 0.0, self.trajectory.duration))
        if self.approach is None:
            return moved
        end = self.begin + self.trajectory.duration
        there, back = self.approach.motion(t), self.approach.back().motion(t - end)
        choice = (t >= self.begin).astype(int) + (t >= end)
        return Motion(*(np.choose(choice[:, None], parts) for parts in zip(there, moved, back, strict=True)))

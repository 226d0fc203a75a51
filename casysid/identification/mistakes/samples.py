"""Some samples of a log, and the log read otherwise."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.robot import Robot
from casysid.robot.coordinates import channels_from_configuration, configuration_from_channels
from casysid.signals import Motion, low_passed

Indices = npt.NDArray[np.intp]
SAMPLES, BLOCKS = 800, 12
"""Samples of all recordings that are read anew for every reading, and contiguous blocks of them: a standard error of a
mean over twelve is itself known to a fifth."""
SHARPNESS = 0.01
"""Width of Coulomb friction's smooth sign in root mean square velocities."""


@dataclass(frozen=True, eq=False)
class Samples:
    """A log's samples, one row an instant: positions by channel, the rest by degree of freedom.

    Attributes:
        position: Shape (N, channels).
        v: Shape (N, nv).
        a: Shape (N, nv).
        tau: Behind a low-pass, shape (N, nv).
        independent: Of the torque's samples so many do not follow from their neighbours.
    """

    position: Array
    v: Array
    a: Array
    tau: Array
    independent: float

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """Positions, velocities, accelerations and torques."""
        return self.position, self.v, self.a, self.tau

    def rows(self, chosen: Indices) -> Samples:
        """Some of the samples."""
        return dataclasses.replace(
            self, position=self.position[chosen], v=self.v[chosen], a=self.a[chosen], tau=self.tau[chosen]
        )

    def configuration(self, robot: Robot) -> Array:
        """Pinocchio's, shape (N, nq)."""
        return configuration_from_channels(robot, self.position)


def pick_samples(robot: Robot, motions: Sequence[Motion], cutoff: float | None) -> Samples:
    """Some samples, evenly over the motions, their torque behind a low-pass.

    A signal below the cut-off has one independent value in half a period; half of these are counted, as the low-pass
    falls slowly.
    """
    each = max(SAMPLES // len(motions), BLOCKS)
    parts = []
    for motion in motions:
        tau = motion.tau if cutoff is None else low_passed(motion.time, motion.tau, cutoff)
        rows = np.unique(np.linspace(0, len(motion) - 1, each).astype(np.intp))
        position = channels_from_configuration(robot, motion.q[rows])
        parts.append((position, motion.v[rows], motion.a[rows], tau[rows]))
    position, v, a, tau = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    duration = sum(float(motion.time[-1] - motion.time[0]) for motion in motions)
    most = float(len(tau))
    return Samples(position, v, a, tau, most if cutoff is None else min(max(cutoff * duration, 1.0), most))

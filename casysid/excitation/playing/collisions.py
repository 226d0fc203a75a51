"""The last look before a motion is played: the file's own shapes, not the capsules of the optimiser."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.excitation.design.problem import ExcitationProblem
from casysid.excitation.playing.played import PlayedMotion

STEP = 0.01
"""Seconds between looks: a link at 2 m/s moves 2 cm, two clearances as they are by default."""


@dataclass(frozen=True)
class CollisionCheck:
    """How near shapes come to each other and to obstacles.

    Attributes:
        pairs: Looked at.
        samples: Instants.
        nearest: Who with whom.
        instant: When [s].
        distance: Least [m]; negative where they meet.
    """

    pairs: int
    samples: int
    nearest: str
    instant: float
    distance: float

    def __str__(self) -> str:
        return (
            f"the file's own collision geometry at {self.samples} instants, {self.pairs} pairs: nearest are "
            f"{self.nearest}, {self.distance:.3g} m at {self.instant:.4g} s"
        )


def check_collisions(problem: ExcitationProblem, played: PlayedMotion) -> CollisionCheck | None:
    """All that is played, on the shapes of the robot's file; None where it has none that could meet."""
    if problem.solids is None or not problem.solids.labels:
        return None
    time = np.linspace(0.0, played.duration, 1 + int(np.ceil(played.duration / STEP)))
    distances = problem.solids.distances(played.motion(time).position)
    row, column = np.unravel_index(int(distances.argmin()), distances.shape)
    return CollisionCheck(
        pairs=distances.shape[1],
        samples=len(time),
        nearest=problem.solids.labels[column],
        instant=float(time[row]),
        distance=float(distances[row, column]),
    )

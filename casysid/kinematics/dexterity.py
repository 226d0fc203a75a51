"""How freely a frame can move: ranks of its Jacobian, and manipulability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.kinematics.frames import Frame
from casysid.kinematics.kinematics import Kinematics
from casysid.kinematics.sampling import random_configurations

SINGULAR = 1e-6
"""A singular value below this share of the largest is none: a motion a million times slower than the fastest."""
_SAMPLES = 32  # configurations: that all are singular by chance has probability zero


@dataclass(frozen=True, kw_only=True)
class Dexterity:
    """Of one frame at one configuration, for position, rotation and both.

    Manipulability is the product of as many singular values of the Jacobian as it usually has, ``√det(J Jᵀ)`` for a
    Jacobian of full rank (Yoshikawa, "Manipulability of robotic mechanisms", 1985); zero where the frame is singular.

    Attributes:
        ranks: Of the Jacobian's linear rows, its angular rows, and all.
        usual: The same at most configurations.
        manipulability: Of linear rows [m], angular rows, both taken to their usual rank.
    """

    ranks: tuple[int, int, int]
    usual: tuple[int, int, int]
    manipulability: tuple[float, float]

    @property
    def is_singular(self) -> bool:
        """Whether the frame cannot move here as it usually can."""
        return self.ranks != self.usual


def usual_ranks(kinematics: Kinematics, frame: str | Frame) -> tuple[int, int, int]:
    """Ranks of a frame's linear rows, its angular rows and all, as they are at most configurations."""
    q = random_configurations(kinematics.robot, np.random.default_rng(0), _SAMPLES)
    found = [_ranks(jacobian) for jacobian in kinematics.jacobians(frame, q)]
    linear, angular, both = (max(column) for column in zip(*found, strict=True))
    return linear, angular, both


def dexterity_at(kinematics: Kinematics, frame: str | Frame, q: Array) -> Dexterity:
    """How freely a frame can move at a configuration (nq,)."""
    jacobian, usual = kinematics.jacobians(frame, q), usual_ranks(kinematics, frame)
    products = [
        float(np.prod(np.linalg.svd(rows, compute_uv=False)[:rank])) if rank else 0.0
        for rows, rank in zip((jacobian[:3], jacobian[3:]), usual[:2], strict=True)
    ]
    return Dexterity(ranks=_ranks(jacobian), usual=usual, manipulability=(products[0], products[1]))


def _ranks(jacobian: Array) -> tuple[int, int, int]:
    linear, angular, both = (_rank(rows) for rows in (jacobian[:3], jacobian[3:], jacobian))
    return linear, angular, both


def _rank(rows: Array) -> int:
    values = np.linalg.svd(rows, compute_uv=False)
    return int(np.sum(values > SINGULAR * values[0])) if values[0] > 0.0 else 0

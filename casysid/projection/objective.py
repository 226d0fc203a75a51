"""What is minimised: the data's misfit, and very lightly the distance to the prior where the data do not see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from casysid.arrays import Array, frozen
from casysid.projection.frame import Frame
from casysid.projection.misfit import DataMisfit

SCALE = 1e4
"""Solvers see the objective multiplied by this: near the optimum about 1e-4 of the residual energy is left of it."""


@dataclass(frozen=True, eq=False)
class Objective:
    """``‖C φ - d‖²`` in the frame's coordinates, ``C`` square and regular.

    Attributes:
        factor: ``C``, upper triangular, shape (p, p).
        target: ``d``, shape (p,).
        prior_weight: Of the squared distance to the prior, in units of the residual energy.
    """

    factor: Array
    target: Array
    prior_weight: float

    def __post_init__(self) -> None:
        for name in ("factor", "target"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __call__(self, scaled: Array) -> float:
        """The value at ``φ``, shape (p,)."""
        return float(np.sum((self.factor @ scaled - self.target) ** 2))

    def minimum(self, frame: Frame, weight: float = 0.0) -> Array:
        """The unconstrained minimum ``φ``, in all directions drawn to the prior by ``weight``, shape (p,)."""
        pull = np.sqrt(weight) * frame.strain
        rows, target = np.vstack([self.factor, pull]), np.concatenate([self.target, pull @ frame.scaled_prior])
        Q, R = np.linalg.qr(rows)
        return np.asarray(solve_triangular(R, Q.T @ target))


def objective_of(misfit: DataMisfit, frame: Frame, prior_weight: float) -> Objective:
    """``‖R T φ - r‖² + w ‖K (φ - φ_0)‖²``, ``K`` the part of the strain that the data do not see.

    ``K`` leaves out what the data see, so that the prior pulls at no direction that the data decide.
    """
    hidden = frame.strain @ np.linalg.solve(frame.transform, misfit.unseen)
    K = np.linalg.qr(hidden)[0].T @ frame.strain  # (p - r, p)
    weight = np.sqrt(prior_weight)
    rows = np.vstack([misfit.seen @ frame.transform, weight * K])
    Q, C = np.linalg.qr(rows)
    return Objective(C, Q.T @ np.concatenate([misfit.target, weight * (K @ frame.scaled_prior)]), prior_weight)

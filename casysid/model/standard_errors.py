"""Standard errors of what a model says, from the covariance of its parameters.

Every torque is linear in the parameters, ``τ = J θ``, with the regressor's rows at suitable motions for ``J``; so is a
column of the mass matrix. The acceleration under a torque changes by ``-M⁻¹ Y δθ``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Regressor
from casysid.estimation.base import LEVERAGE_TOLERANCE
from casysid.model.functions import friction_columns

CHUNK = 1_000
"""States whose regressors are in memory at once."""


@dataclass(frozen=True, eq=False, repr=False)
class Scatter:
    """How far the parameters are known.

    Attributes:
        covariance: Finite, shape (p, p).
        hidden: Basis of the directions that nothing tells, shape (p, k), orthonormal in units of ``scale``.
        scale: Of each parameter, shape (p,).
    """

    covariance: Array
    hidden: Array
    scale: Array

    def std(self, gradients: Array) -> Array:
        """Standard errors of quantities with gradients (..., p), shape (...); infinite for what nothing tells."""
        variance = np.einsum("...p,...p->...", gradients @ self.covariance, gradients)
        scaled = gradients * self.scale
        lost = np.sum((scaled @ self.hidden) ** 2, axis=-1)
        told = lost <= LEVERAGE_TOLERANCE * np.sum(scaled**2, axis=-1)
        return np.where(told, np.sqrt(np.maximum(variance, 0.0)), np.inf)


@dataclass(frozen=True, eq=False)
class StandardErrors:
    """Of what a model says at one state (n,), or at many (N, n); inputs and shapes are those of its functions.

    Attributes:
        regressor: The model's.
        scatter: Of its parameters.
    """

    regressor: Regressor
    scatter: Scatter

    def torque(self, q: Array, v: Array, a: Array, memory: Array | None) -> Array:
        """Of the torque."""
        return self._of_rows(q, v, a, memory, np.ones(len(self.regressor.parameters), dtype=bool))

    def friction(self, q: Array, v: Array, memory: Array | None) -> Array:
        """Of the friction."""
        return self._of_rows(q, v, np.zeros_like(v), memory, friction_columns(self.regressor))

    def bias(self, q: Array, v: Array) -> Array:
        """Of Coriolis, centrifugal and gravity torques."""
        return self._of_rows(q, v, np.zeros_like(v), None, ~friction_columns(self.regressor))

    def gravity(self, q: Array) -> Array:
        """Of what holds the robot still."""
        return self.bias(q, np.zeros((*np.shape(q)[:-1], self.regressor.robot.nv)))

    def mass_matrix(self, q: Array) -> Array:
        """Of each entry."""
        rows, still = np.atleast_2d(q), np.zeros(self.regressor.robot.nv)
        out = np.empty((len(rows), len(still), len(still)))
        for piece in _pieces(len(rows)):
            rest = self._rows(rows[piece], still, still, None)
            for k, push in enumerate(np.eye(len(still))):
                out[piece, :, k] = self.scatter.std(self._rows(rows[piece], still, push, None) - rest)
        return out if np.ndim(q) == 2 else out[0]

    def forward_dynamics(self, q: Array, v: Array, a: Array, mass: Array, memory: Array | None) -> Array:
        """Of the acceleration ``a`` that a torque makes, where the mass matrix is ``mass``."""
        out = np.empty(np.atleast_2d(a).shape)
        q_rows, v_rows, a_rows, remembered = (_spread(one, len(out)) for one in (q, v, a, memory))
        inertia = np.broadcast_to(mass, (len(out), *mass.shape[-2:]))
        for piece in _pieces(len(out)):
            known = None if memory is None else remembered[piece]
            Y = self._rows(q_rows[piece], v_rows[piece], a_rows[piece], known)
            out[piece] = self.scatter.std(np.asarray(np.linalg.solve(inertia[piece], Y), dtype=np.float64))
        return out if np.ndim(a) == 2 else out[0]

    def _of_rows(self, q: Array, v: Array, a: Array, memory: Array | None, kept: npt.NDArray[np.bool_]) -> Array:
        count = max(len(np.atleast_2d(one)) for one in (q, v, a))
        rows, v_rows, a_rows, remembered = (_spread(one, count) for one in (q, v, a, memory))
        out = np.empty((count, self.regressor.robot.nv))
        for piece in _pieces(count):
            known = None if memory is None else remembered[piece]
            out[piece] = self.scatter.std(self._rows(rows[piece], v_rows[piece], a_rows[piece], known) * kept)
        return out if max(np.ndim(one) for one in (q, v, a)) == 2 else out[0]

    def _rows(self, q: Array, v: Array, a: Array, memory: Array | None) -> Array:
        count = self.regressor.history_count
        known = np.zeros(count) if memory is None else memory
        return self.regressor.evaluate(q, v, a, histories=(known,) if count else ())


def _spread(values: Array | None, count: int) -> Array:
    """One state's values, or those of each of so many, for each."""
    if values is None:
        return np.zeros((count, 0))
    rows = np.asarray(values)
    return rows if len(rows) == count and rows.ndim > 1 else np.broadcast_to(rows, (count, *rows.shape[-1:]))


def _pieces(count: int) -> list[slice]:
    return [slice(start, start + CHUNK) for start in range(0, count, CHUNK)]

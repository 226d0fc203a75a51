"""The nearest consistent parameters by cutting planes from a point that is known to be consistent and near.

In coordinates in which the metric is the unit matrix, the nearest point of a convex set is asked for. The laws are
half-spaces there: those that touch the set at the known point, and, wherever a point is still outside, the one through
the eigenvector that says so. The nearest point of some tens of half-spaces is a small non-negative least-squares
problem, far cheaper than the semidefinite program.

Source: Lawson and Hanson (1974), *Solving Least Squares Problems*, ch. 23 (least distance programming).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from casysid.arrays import Array
from casysid.projection.convex import Cone

ROUNDS = 30
"""Cuts of a sample are renewed so many times before the convex solver takes over."""
OUTSIDE = 1e-4
"""A point is inside when no eigenvalue is further below zero, in the frame's units: a tenth of the floor."""
NEAR = 0.3
"""Eigenvalues at the answer below this are cut from the start."""


class HalfSpaces(NamedTuple):
    """``rows θ >= lower``, shapes (k, p) and (k,)."""

    rows: Array
    lower: Array


@dataclass(frozen=True, eq=False)
class Cuts:
    """The feasible set in whitened coordinates ``z = C φ``, as far as it is known at the answer.

    Attributes:
        cone: The feasible set.
        factor: ``C``, upper triangular, shape (p, p).
        basis: Of the coordinates that equalities leave free, orthonormal, shape (p, f).
        origin: The answer in whitened coordinates, shape (p,).
        rows: ``N``, half-spaces ``N (z - origin) >= -slack``, shape (k, p).
        slack: Shape (k,).
    """

    cone: Cone
    factor: Array
    basis: Array
    origin: Array
    rows: Array
    slack: Array

    def nearest(self, target: Array) -> Array | None:
        """The feasible ``φ`` nearest to a point in whitened coordinates, shape (p,); None when cuts do not settle."""
        free = self.basis.T @ (target - self.origin)
        rows, slack = self.rows @ self.basis, self.slack
        for _ in range(ROUNDS):
            near = nearest_in_half_spaces(free, rows, -slack)
            if near is None:
                return None
            inside, _ = near
            scaled = solve_triangular(self.factor, self.origin + self.basis @ inside)
            normals, values = _eigenvalue_cuts(self.cone, scaled, -OUTSIDE)
            if not len(values):
                return np.asarray(scaled)
            more = _whitened(normals, self.factor) @ self.basis
            rows, slack = np.vstack([rows, more]), np.append(slack, values - more @ inside)
        return None


def cuts_at(cone: Cone, factor: Array, answer: Array) -> Cuts:
    """The half-spaces that bound a feasible set near a feasible ``φ``.

    Args:
        cone: The feasible set.
        factor: ``C``, upper triangular, the root of the metric, shape (p, p).
        answer: ``φ``, shape (p,).
    """
    matrix = cone.matrix.toarray()
    basis = np.eye(len(answer))
    if cone.equalities:
        _, size, directions = np.linalg.svd(_whitened(matrix[: cone.equalities], factor))
        basis = directions[int((size > 1e-9 * size[0]).sum()) :].T
    linear = slice(cone.equalities, cone.equalities + cone.inequalities)
    normals, values = _eigenvalue_cuts(cone, answer, NEAR)
    rows = np.vstack([_whitened(-matrix[linear], factor), _whitened(normals, factor)])
    slack = np.concatenate([cone.offset[linear] - matrix[linear] @ answer, values])
    return Cuts(cone, factor, basis, factor @ answer, rows, np.maximum(slack, 0.0))


def half_spaces_at(cone: Cone, answer: Array) -> HalfSpaces:
    """Half-spaces of ``φ`` that hold a feasible set, and bound it near a feasible ``φ``, shape (p,)."""
    matrix = cone.matrix.toarray()[: cone.equalities + cone.inequalities]
    offset = cone.offset[: len(matrix)]
    normals, values = _eigenvalue_cuts(cone, answer, NEAR)
    same = matrix[: cone.equalities]
    rows = np.vstack([-matrix, same, normals])
    return HalfSpaces(rows, np.concatenate([-offset, offset[: len(same)], normals @ answer - values]))


def _whitened(normals: Array, factor: Array) -> Array:
    """Gradients with respect to ``z`` of what has gradients ``normals`` with respect to ``φ``, shape (k, p)."""
    return np.asarray(solve_triangular(factor, normals.T, trans="T").T)


def _eigenvalue_cuts(cone: Cone, scaled: Array, below: float) -> tuple[Array, Array]:
    """Gradients (k, p) and values (k,) of the links' eigenvalues at ``φ`` that lie below a bound."""
    values, vectors = np.linalg.eigh(cone.matrices(scaled))
    body, place = np.nonzero(values < below)
    v = vectors[body, :, place]
    return cone.gradients(body, v), values[body, place]


def nearest_in_half_spaces(target: Array, rows: Array, lower: Array) -> tuple[Array, Array] | None:
    """The nearest ``x`` to a target with ``rows x >= lower``, and the rows that hold it; None when none is found.

    Args:
        target: Shape (f,).
        rows: Shape (k, f).
        lower: Shape (k,).
    """
    lacking = lower - rows @ target
    if not (lacking > 0.0).any():
        return target, rows[:0]
    length = np.linalg.norm(rows, axis=1)
    sound = length > 0.0
    unit, lacking = rows[sound] / length[sound, None], lacking[sound] / length[sound]
    size = float(np.abs(lacking).max())
    stacked = np.vstack([unit.T, lacking / size])
    try:
        weights, _ = nnls(stacked, np.append(np.zeros(len(target)), 1.0), maxiter=20 * len(lacking))
    except RuntimeError:
        return None
    residual = stacked @ weights - np.append(np.zeros(len(target)), 1.0)
    return None if not residual[-1] < 0.0 else (target - size * residual[:-1] / residual[-1], unit[weights > 0.0])

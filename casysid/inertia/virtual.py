"""Virtual parameters: coordinates in which every real vector is a consistent body.

Both maps are polynomials, written once for NumPy and CasADi, vectorised over bodies:

- ``Consistency.INERTIA``: the paper's Eq. (5), root of the mass, centre of mass, Cholesky factor of the inertia about
  it;
- ``Consistency.FULL``: a triangular factor ``U`` of the pseudo-inertia, ``P = U Uᵀ``, which adds the triangle
  inequality.

Plain factors, not their logarithms: a massless or flat body has finite coordinates. Friction that cannot be negative is
the square of its coordinate: a body's eleventh number, where given, is the root of its viscous friction, as in the
paper.

Source: Ting, Mistry, Peters, Schaal, Nakanishi (2006), Eq. (5).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.inertia.parameters import Consistency, as_bodies, mass_properties, pseudo_inertia

SIGNLESS = {Consistency.INERTIA: (0, 4, 7, 9), Consistency.FULL: (0, 4, 6, 9)}
"""The factors' diagonals: coordinates that may be held non-negative without losing a body."""


def parameters_from_virtual(virtual: npt.ArrayLike, consistency: Consistency = Consistency.FULL) -> Array:
    """Inertial parameters of virtual ones, shapes (..., 10) or, with viscous friction, (..., 11)."""
    u = as_bodies(virtual, 10, 11)
    columns = _MAPS[consistency](tuple(np.moveaxis(u[..., :10], -1, 0)))
    return np.stack([*columns, *(np.moveaxis(u[..., 10:], -1, 0) ** 2)], axis=-1)


def symbolic_parameters_from_virtual(virtual: Any, consistency: Consistency = Consistency.FULL) -> Any:
    """The same in CasADi: (10, bodies) or (11, bodies) of virtual parameters to as many inertial ones."""
    rows = ca.vertsplit(virtual)
    return ca.vertcat(*_MAPS[consistency](rows[:10]), *(row * row for row in rows[10:]))


def virtual_from_parameters(parameters: npt.ArrayLike, consistency: Consistency = Consistency.FULL) -> Array:
    """Virtual parameters of consistent inertial ones, shapes (..., 10) or (..., 11); diagonals are not negative.

    Of an inconsistent body the negative part is dropped: eigenvalues, masses and frictions below zero count as zero.
    """
    theta = as_bodies(parameters, 10, 11)
    u = _INVERSES[consistency](theta[..., :10])
    return np.concatenate([u, np.sqrt(np.maximum(theta[..., 10:], 0.0))], axis=-1)


def _factor_of_inertia(u: Sequence[Any]) -> tuple[Any, ...]:
    """The paper's Eq. (5), its inertia ``xx xy xz yy yz zz`` put into Pinocchio's order."""
    root, x, y, z, r1, r2, r3, r4, r5, r6 = u
    m = root * root
    return (
        m,
        x * m,
        y * m,
        z * m,
        r1 * r1 + (z * z + y * y) * m,
        r1 * r2 - x * y * m,
        r2 * r2 + r4 * r4 + (x * x + z * z) * m,
        r1 * r3 - x * z * m,
        r2 * r3 + r4 * r5 - y * z * m,
        r3 * r3 + r5 * r5 + r6 * r6 + (x * x + y * y) * m,
    )


def _factor_of_pseudo_inertia(u: Sequence[Any]) -> tuple[Any, ...]:
    """``P = U Uᵀ``, ``U = [[U3, t], [0, w]]`` upper triangular, ``u = (w, t, U3 by columns)``; ``I = tr(Σ) 1 - Σ``."""
    w, x, y, z, u11, u12, u22, u13, u23, u33 = u
    xx = u11 * u11 + u12 * u12 + u13 * u13 + x * x
    yy = u22 * u22 + u23 * u23 + y * y
    zz = u33 * u33 + z * z
    xy, xz, yz = u12 * u22 + u13 * u23 + x * y, u13 * u33 + x * z, u23 * u33 + y * z
    return w * w, w * x, w * y, w * z, yy + zz, -xy, xx + zz, -xz, -yz, xx + yy


def _virtual_inertia(parameters: Array) -> Array:
    body = mass_properties(parameters)
    R = _lower_factor(body.inertia)  # I = R Rᵀ: the transpose of the paper's upper factor
    factor = [R[..., i, j] for i, j in ((0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2))]
    center = np.moveaxis(body.center_of_mass, -1, 0)
    return np.stack([np.sqrt(np.maximum(body.mass, 0.0)), *center, *factor], axis=-1)


def _virtual_pseudo_inertia(parameters: Array) -> Array:
    flipped = pseudo_inertia(parameters)[..., ::-1, ::-1]
    U = _lower_factor(flipped)[..., ::-1, ::-1]  # a lower factor, both axes reversed, is an upper one
    places = ((3, 3), (0, 3), (1, 3), (2, 3), (0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
    return np.stack([U[..., i, j] for i, j in places], axis=-1)


def _lower_factor(matrix: Array) -> Array:
    """``L`` lower triangular, diagonal ≥ 0, ``L Lᵀ`` the matrix less its negative eigenvalues; may be singular."""
    values, vectors = np.linalg.eigh(matrix)
    root = vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
    upper = np.linalg.qr(np.swapaxes(root, -1, -2), mode="r")
    lower = np.swapaxes(upper, -1, -2)
    signs = np.where(np.diagonal(lower, axis1=-2, axis2=-1) < 0.0, -1.0, 1.0)
    return np.asarray(lower * signs[..., None, :])


_MAPS = {Consistency.INERTIA: _factor_of_inertia, Consistency.FULL: _factor_of_pseudo_inertia}
_INVERSES = {Consistency.INERTIA: _virtual_inertia, Consistency.FULL: _virtual_pseudo_inertia}

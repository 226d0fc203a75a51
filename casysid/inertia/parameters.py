"""One rigid body's inertial parameters, and the matrices that say whether a body can have them.

The ten parameters, at the joint frame, in Pinocchio's order: ``m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz``.
Two matrices are linear in them, and each is positive semidefinite exactly when the body is consistent in one sense:

- the spatial inertia (6×6): non-negative mass, positive semidefinite inertia about the centre of mass;
- the pseudo-inertia (4×4): the triangle inequality besides, so that some distribution of mass has these parameters.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError

KINDS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_ROW, _COLUMN = np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2])  # where the six entries of I stand
_AXES = np.arange(3)
MASSLESS = 1e-100
"""Masses [kg] below this are zero: one cannot divide by them."""


class Consistency(enum.Enum):
    """What is asked of a body; the value is the word on the command line."""

    INERTIA = "inertia"
    FULL = "full"


@dataclass(frozen=True, eq=False)
class MassProperties:
    """The physical quantities of bodies.

    Attributes:
        mass: Shape (...,), [kg].
        center_of_mass: In the joint frame, shape (..., 3), [m]; the frame's origin where the mass is zero.
        inertia: About the centre of mass, along the joint frame's axes, shape (..., 3, 3), [kg m²].
    """

    mass: Array
    center_of_mass: Array
    inertia: Array

    def __post_init__(self) -> None:
        for name in ("mass", "center_of_mass", "inertia"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


def as_bodies(values: npt.ArrayLike, *widths: int) -> Array:
    """Values as a float array whose last axis holds one body's numbers, ``widths`` of them (default 10).

    Raises:
        ParameterError: The last axis has another length.
    """
    array, wanted = np.asarray(values, dtype=np.float64), widths or (10,)
    if array.ndim == 0 or array.shape[-1] not in wanted:
        raise ParameterError(
            f"bodies: the last axis must hold one body's {' or '.join(map(str, wanted))} numbers; "
            f"got shape {array.shape}. Reshape a flat vector of several bodies to (-1, {wanted[0]})"
        )
    return array


def _inertia_basis() -> Array:
    basis = np.zeros((10, 3, 3))
    basis[4 + np.arange(6), _ROW, _COLUMN] = basis[4 + np.arange(6), _COLUMN, _ROW] = 1.0
    return basis


def _pseudo_inertia_basis() -> Array:
    """``[[Σ, h], [hᵀ, m]]``, ``Σ = ½ tr(I) 1 - I``."""
    inertia, basis = _inertia_basis(), np.zeros((10, 4, 4))
    basis[:, :3, :3] = 0.5 * np.trace(inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3) - inertia
    basis[0, 3, 3] = 1.0
    basis[1 + _AXES, _AXES, 3] = basis[1 + _AXES, 3, _AXES] = 1.0
    return frozen(basis)


def _spatial_inertia_basis() -> Array:
    """``[[m 1, [h]×ᵀ], [[h]×, I]]``."""
    basis = np.zeros((10, 6, 6))
    basis[0, :3, :3] = np.eye(3)
    basis[:, 3:, 3:] = _inertia_basis()
    i, j = (_AXES + 1) % 3, (_AXES + 2) % 3
    basis[1 + _AXES, 3 + i, j], basis[1 + _AXES, 3 + j, i] = -1.0, 1.0
    basis[:, :3, 3:] = basis[:, 3:, :3].transpose(0, 2, 1)
    return frozen(basis)


CONSISTENCY_BASIS = {Consistency.FULL: _pseudo_inertia_basis(), Consistency.INERTIA: _spatial_inertia_basis()}
"""``B`` of shape (10, n, n): a body is consistent when ``Σ θ_k B_k`` is positive semidefinite."""


def consistency_matrix(parameters: npt.ArrayLike, consistency: Consistency = Consistency.FULL) -> Array:
    """The matrix that has to be positive semidefinite, (..., n, n), n = 4 or 6, of parameters of shape (..., 10)."""
    return np.tensordot(as_bodies(parameters), CONSISTENCY_BASIS[consistency], axes=1)


def pseudo_inertia(parameters: npt.ArrayLike) -> Array:
    """``P = [[Σ, h], [hᵀ, m]]``, ``Σ = ½ tr(I) 1 - I``, shape (..., 4, 4), of parameters of shape (..., 10)."""
    return consistency_matrix(parameters, Consistency.FULL)


def parameters_from_pseudo_inertia(matrix: npt.ArrayLike) -> Array:
    """Parameters (..., 10) of pseudo-inertias (..., 4, 4), whose upper triangle is read: ``I = tr(Σ) 1 - Σ``."""
    P = np.asarray(matrix, dtype=np.float64)
    if P.shape[-2:] != (4, 4):
        raise ParameterError(f"pseudo-inertia: the last two axes must be (4, 4); got shape {P.shape}")
    second = P[..., _ROW, _COLUMN]
    inertia = np.trace(P[..., :3, :3], axis1=-2, axis2=-1)[..., None] * (_ROW == _COLUMN) - second
    return np.concatenate([P[..., 3, 3, None], P[..., :3, 3], inertia], axis=-1)


def smallest_eigenvalue(parameters: npt.ArrayLike, consistency: Consistency = Consistency.FULL) -> Array:
    """Smallest eigenvalue of the consistency matrix of each body, shape (...,); it mixes kg and kg m²."""
    return np.asarray(np.linalg.eigvalsh(consistency_matrix(parameters, consistency))[..., 0])


def is_consistent(
    parameters: npt.ArrayLike, consistency: Consistency = Consistency.FULL, tolerance: float = 0.0
) -> npt.NDArray[np.bool_]:
    """Whether each body of ``parameters`` (..., 10) is consistent, shape (...,).

    ``tolerance`` is relative: an eigenvalue may fall below zero by that fraction of the largest. Zeros are consistent.
    """
    values = np.linalg.eigvalsh(consistency_matrix(parameters, consistency))
    return np.asarray(values[..., 0] >= -tolerance * np.abs(values).max(axis=-1))


def mass_properties(parameters: npt.ArrayLike) -> MassProperties:
    """Mass, centre of mass and inertia about it, of parameters (..., 10), consistent or not (parallel-axis theorem)."""
    theta = as_bodies(parameters)
    mass, first = theta[..., 0], theta[..., 1:4]
    heavy = np.abs(mass[..., None]) > MASSLESS
    center = np.divide(first, mass[..., None], out=np.zeros_like(first), where=heavy)
    inertia = np.tensordot(theta, _inertia_basis(), axes=1)
    return MassProperties(mass, center, inertia - _parallel_axis(mass, center))


def inertial_parameters(mass: npt.ArrayLike, center_of_mass: npt.ArrayLike, inertia: npt.ArrayLike) -> Array:
    """Parameters (..., 10) of bodies of given mass (...,), centre of mass (..., 3) and inertia about it (..., 3, 3)."""
    m, c, about_center = (np.asarray(value, dtype=np.float64) for value in (mass, center_of_mass, inertia))
    about_origin = (about_center + _parallel_axis(m, c))[..., _ROW, _COLUMN]
    return np.concatenate([m[..., None], m[..., None] * c, about_origin], axis=-1)


def _parallel_axis(mass: Array, center: Array) -> Array:
    """``m (cᵀc 1 - c cᵀ)``, shape (..., 3, 3)."""
    squared = np.sum(center**2, axis=-1)[..., None, None] * np.eye(3)
    return np.asarray(mass[..., None, None] * (squared - center[..., :, None] * center[..., None, :]))

"""What the data say, split into the directions that they see and those that they do not.

``(θ - θ_est)ᵀ G (θ - θ_est)`` of the paper's Eq. (8) becomes ``‖R θ - r‖²`` with ``R`` of full row rank, whatever the
rank of ``G``, which is decided on the metric with unit diagonal, so that it does not depend on units.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.moments import NormalEquations

RANK_TOLERANCE = 1e-9
"""Relative eigenvalues below this (singular values 3e-5) are rounding of the robot's geometry, not rank."""
INDEFINITE = 1e-6
"""A metric with eigenvalues further below zero than this fraction of the largest is no metric."""
ENERGY_TOLERANCE = 1e-24
"""A column with less than this fraction of the strongest column's energy is not seen."""
FINEST_FIT = 1e-8
"""Residual energy is not taken as less than this fraction of what the parameters explain."""
ASSUMED_FIT = 1e-3
"""The same where nothing is said of the residuals: torque explained to 3 %."""


@dataclass(frozen=True, eq=False)
class DataMisfit:
    """``‖R θ - r‖²``: energy of the residuals above the unconstrained fit's, as a fraction of the latter.

    Attributes:
        seen: ``R``, shape (r, p).
        target: ``r``, shape (r,).
        unseen: Basis of the directions that the data do not see, shape (p, p - r).
        minimum: A ``θ`` without misfit, nothing in it of the unseen directions, shape (p,).
        residual_energy: The unit of the misfit, in the metric's units.
    """

    seen: Array
    target: Array
    unseen: Array
    minimum: Array
    residual_energy: float

    def __post_init__(self) -> None:
        for name in ("seen", "target", "unseen", "minimum"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __call__(self, parameters: Array) -> float:
        """The misfit of parameters of shape (p,)."""
        return float(np.sum((self.seen @ parameters - self.target) ** 2))


def misfit_of_estimate(metric: Array, estimate: Array, residual_energy: float | None) -> DataMisfit:
    """The misfit ``(θ - θ_est)ᵀ G (θ - θ_est)`` as a fraction of the residual energy (paper, Eq. (8)).

    Args:
        metric: ``G``, shape (p, p).
        estimate: ``θ_est``, shape (p,).
        residual_energy: ``Σ w (y - xᵀθ_est)²`` in the metric's units; None takes a fit to 3 % of the explained torque.
    """
    spectrum = _spectrum(metric)
    target = spectrum.root @ estimate
    explained = float(target @ target)
    return _misfit(spectrum, target, ASSUMED_FIT * explained if residual_energy is None else residual_energy)


def misfit_of_equations(equations: NormalEquations) -> DataMisfit:
    """The misfit of plain least squares, ``Σ w (y - xᵀθ)²`` above its unconstrained minimum, as a fraction of that."""
    spectrum = _spectrum(equations.xx)
    target = spectrum.inverse.T @ equations.xy
    return _misfit(spectrum, target, equations.yy - float(target @ target))


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """``G = rootᵀ root`` up to rounding, ``root inverse = 1``, and a basis of the null space of ``G``."""

    root: Array
    inverse: Array
    unseen: Array


def _misfit(spectrum: _Spectrum, target: Array, residual_energy: float) -> DataMisfit:
    energy = max(residual_energy, FINEST_FIT * float(target @ target), float(np.sqrt(np.finfo(np.float64).tiny)))
    unit = np.sqrt(energy)
    return DataMisfit(spectrum.root / unit, target / unit, spectrum.unseen, spectrum.inverse @ target, energy)


def _spectrum(metric: Array) -> _Spectrum:
    energy = np.diag(metric)
    strongest = energy.max(initial=0.0)
    live = energy > ENERGY_TOLERANCE * strongest
    scale = np.where(live, 1.0 / np.sqrt(np.where(live, energy, 1.0)), 1.0)
    values, vectors = np.linalg.eigh(0.5 * (metric + metric.T) * np.outer(scale * live, scale * live))
    if values[0] < -INDEFINITE * values[-1] or energy.min() < -INDEFINITE * strongest:
        raise ParameterError(
            "projection: the metric must be positive semidefinite; scaled to unit diagonal, its smallest eigenvalue is "
            f"{values[0] / max(values[-1], 1e-300):.1e} of the largest. Correct the moments less before projecting"
        )
    seen = values > RANK_TOLERANCE * values[-1]
    root = np.sqrt(values[seen])[:, None] * vectors[:, seen].T
    return _Spectrum(
        root * np.where(live, 1.0 / scale, 0.0),
        (scale * live)[:, None] * vectors[:, seen] / np.sqrt(values[seen]),
        scale[:, None] * vectors[:, ~seen],
    )

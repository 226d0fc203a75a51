"""Partial least squares: regression on the few directions of the columns that go together with the target.

Wold (1975). The columns have no intercept (a joint's offset is a column), so nothing is centred; scikit-learn's
``PLSRegression`` always centres and needs rows, hence the kernel algorithm, which needs moments only: Dayal and
MacGregor (1997), "Improved PLS algorithms", *J. Chemometrics* 11, modified kernel algorithm 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Estimator
from casysid.estimation.cross_validation import cross_validate
from casysid.estimation.selection import mean_variance
from casysid.estimation.standardise import SPECTRUM_TOLERANCE, standardise
from casysid.moments import Moments, NormalEquations
from casysid.threads import single_threaded


@dataclass(frozen=True, kw_only=True)
class PartialLeastSquares(Estimator):
    """Partial least squares with one target (PLS1) in standardised columns, relative to the prior.

    Attributes:
        components: Number of directions. None: chosen by cross-validation over blocks of time.
        max_components: The most that cross-validation may choose.
        folds: Number of folds, contiguous in time.
    """

    name: ClassVar[str] = "pls"

    components: int | None = None
    max_components: int = 40
    folds: int = 5

    def __post_init__(self) -> None:
        if (self.components is not None and self.components < 1) or self.max_components < 1 or self.folds < 2:
            raise ParameterError(
                "pls: wanted components >= 1 (or None), max_components >= 1 and folds >= 2; "
                f"got {self.components}, {self.max_components} and {self.folds}"
            )

    @single_threaded()
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Coefficients in the span of the components, with the covariance of least squares given the components.

        Raises:
            ParameterError: The number of components is to be chosen and there is a single block.
        """
        problem = standardise(moments, prior)
        if problem.is_degenerate:
            return problem.degenerate_estimate(self.name)
        normal = problem.normal
        most = min(self.components or self.max_components, len(normal.xy))
        rotations, energies = extract_components(normal, most)
        used = len(energies)
        if self.components is None:
            errors = cross_validate(problem, self.folds, lambda part: _paths(part, used), choice="pls")
            used = int(errors.argmin())
        rotations, energies = rotations[:, :used], energies[:used]
        coefficients = (rotations / energies) @ (rotations.T @ normal.xy)
        covariance = (rotations / energies) @ rotations.T * mean_variance(problem, coefficients, used)
        return problem.to_estimate(self.name, coefficients, covariance, diagnostics={"components": float(used)})


def extract_components(normal: NormalEquations, most: int) -> tuple[Array, Array]:
    """Rotations ``R`` (d, k), whose scores ``xᵀR`` are uncorrelated, and the scores' energies (k,); ``k <= most``."""
    xx, covariance = normal.xx, normal.xy.copy()
    start = float(np.linalg.norm(covariance))
    rotations, loadings = np.zeros((2, len(covariance), most))
    energies = np.zeros(most)
    for k in range(most):
        length = np.linalg.norm(covariance)
        if length <= SPECTRUM_TOLERANCE * start or length == 0.0:
            return rotations[:, :k], energies[:k]
        weight = covariance / length
        rotation = weight - rotations[:, :k] @ (loadings[:, :k].T @ weight)
        image = xx @ rotation
        energies[k] = rotation @ image
        if energies[k] <= SPECTRUM_TOLERANCE * (rotation @ rotation):
            return rotations[:, :k], energies[:k]
        rotations[:, k], loadings[:, k] = rotation, image / energies[k]
        covariance -= loadings[:, k] * (rotation @ normal.xy)
    return rotations, energies


def _paths(normal: NormalEquations, most: int) -> Array:
    """Coefficients with 0, 1, ..., ``most`` components, shape (most + 1, d); the last repeats where none is left."""
    rotations, energies = extract_components(normal, most)
    steps = (rotations * (rotations.T @ normal.xy / energies)).T
    path = np.vstack([np.zeros((1, len(normal.xy))), steps.cumsum(axis=0)])
    return np.vstack([path, np.repeat(path[-1:], most + 1 - len(path), axis=0)])

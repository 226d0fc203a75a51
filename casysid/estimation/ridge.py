"""Ridge towards the prior, its strength chosen by cross-validation over blocks of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Status
from casysid.estimation.covariance import covariance_from_blocks
from casysid.estimation.cross_validation import cross_validate
from casysid.estimation.standardise import StandardisedProblem, seen_directions, standardise
from casysid.moments import Moments, NormalEquations

STRENGTHS: tuple[float, ...] = tuple(np.geomspace(1e-8, 1e1, 28).tolist())


@dataclass(frozen=True)
class Ridge:
    """Weighted least squares with ``strength ‖β‖²`` on the standardised distance ``β`` from the prior.

    Attributes:
        strength: Penalty on columns and target scaled to unit root mean square; None chooses it by cross-validation.
        folds: Contiguous folds of blocks in the cross-validation.
        standard_errors: Whether the covariance is computed, which takes longer than the fit; infinite without.
    """

    strength: float | None = None
    folds: int = 5
    standard_errors: bool = True
    name: ClassVar[str] = "ridge"

    def __post_init__(self) -> None:
        if self.strength is not None and not (np.isfinite(self.strength) and self.strength >= 0):
            raise ParameterError(f"ridge: strength must be a finite number >= 0 or None; got {self.strength}")
        if self.folds < 2:
            raise ParameterError(f"ridge: cross-validation wants at least 2 folds; got {self.folds}")

    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Parameters between the prior and weighted least squares, as far as the data's own prediction error asks.

        The metric of the estimate holds the pull to the prior too, so that a projection does not undo it.

        Raises:
            ParameterError: The strength is to be chosen and there is a single block.
        """
        problem = standardise(moments, prior)
        if problem.is_degenerate:
            return problem.degenerate_estimate(self.name)
        strength = self.strength if self.strength is not None else choose_strength(problem, self.folds)
        normal = problem.normal
        values, vectors = seen_directions(normal.xx)
        shrunk = values + strength
        coefficients = vectors @ ((vectors.T @ normal.xy) / shrunk)
        pull = strength * np.diag(np.diag(problem.metric))
        theta = problem.restore(coefficients)
        spread = None
        if self.standard_errors:
            shifted, weights = moments.shifted(problem.prior), problem.noise_std**-2.0
            spread = covariance_from_blocks(shifted, theta - problem.prior, weights, pull)
        return Estimate(
            method=self.name,
            parameters=theta,
            covariance=np.diag(np.full(len(theta), np.inf)) if spread is None else spread.marked,
            spread=spread,
            metric=problem.metric + pull,
            noise_std=problem.noise_std,
            rank=len(values),
            status=Status.CONVERGED,
            diagnostics={"strength": strength, "effective_parameters": float((values / shrunk).sum())},
        )


def choose_strength(problem: StandardisedProblem, folds: int) -> float:
    """The strength of least squared error on blocks left out, folds being contiguous in time."""
    error = cross_validate(problem, folds, _ridge_path, choice="ridge strength")
    return STRENGTHS[int(np.argmin(error))]


def _ridge_path(normal: NormalEquations) -> Array:
    """Coefficients for all strengths, shape (strengths, d), by one eigendecomposition."""
    values, vectors = seen_directions(normal.xx)
    shrunk = values + np.array(STRENGTHS)[:, None]
    return np.asarray(((vectors.T @ normal.xy) / shrunk) @ vectors.T)

"""Ridge towards the prior, in the geometry of what the prior describes; its strength is decided by the data.

Least squares with a Gaussian prior about the model file. Its covariance has the shape of how model files are wrong
(:mod:`casysid.estimation.prior_covariance`) and a size that is found from the data in two ways, each of which errs
towards too strong a prior in its own case: cross-validation over blocks of time where a block shows what the others do
not, and the evidence where residuals are the model's fault and not noise. The weaker of the two answers is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Status
from casysid.estimation.covariance import covariance_from_blocks
from casysid.estimation.cross_validation import cross_validate
from casysid.estimation.prior_covariance import prior_covariance
from casysid.estimation.standardise import StandardisedProblem, seen_directions, standardise
from casysid.moments import Moments, NormalEquations
from casysid.threads import single_threaded

STRENGTHS: tuple[float, ...] = tuple(np.geomspace(1e-10, 1e1, 34).tolist())


@dataclass(frozen=True)
class Ridge:
    """Weighted least squares with ``strength`` times the squared distance from the prior.

    Attributes:
        strength: Penalty on columns and target scaled to unit root mean square; None lets the data choose.
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

    @single_threaded()
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Parameters between the prior and weighted least squares, as far as the data's own prediction error asks.

        What the data do not see follows what they do as the prior's bodies would. The metric of the estimate holds the
        pull to the prior too, so that a projection does not undo it.

        Raises:
            ParameterError: The strength is to be chosen and there is a single block.
        """
        problem = standardise(moments, prior)
        if problem.is_degenerate:
            return problem.degenerate_estimate(self.name)
        ridge = _RidgeProblem(problem, prior_covariance(problem, moments.columns))
        strength = self.strength if self.strength is not None else ridge.choose_strength(self.folds)
        theta = ridge.solve(strength)
        spread = None
        if self.standard_errors:
            shifted, weights = moments.shifted(problem.prior), problem.noise_std**-2.0
            spread = covariance_from_blocks(shifted, theta - problem.prior, weights, ridge.prior(strength))
        return Estimate(
            method=self.name,
            parameters=theta,
            covariance=np.diag(np.full(len(theta), np.inf)) if spread is None else spread.marked,
            spread=spread,
            metric=problem.metric + ridge.pull(strength),
            noise_std=problem.noise_std,
            rank=len(seen_directions(problem.normal.xx)[0]),
            status=Status.CONVERGED,
            diagnostics={"strength": strength, "effective_parameters": ridge.effective_parameters(strength)},
        )


@dataclass(frozen=True, eq=False)
class _RidgeProblem:
    """A standardised problem with its prior's covariance ``K``, up to the strength, shape (p, p)."""

    problem: StandardisedProblem
    covariance: Array

    @cached_property
    def root(self) -> Array:
        """``A`` with ``A Aᵀ`` the standardised covariance of the live columns, shape (d, d)."""
        problem = self.problem
        live = self.covariance[np.ix_(problem.live, problem.live)]
        return np.asarray(np.linalg.cholesky(live / np.outer(problem.scale, problem.scale)))

    @cached_property
    def spectrum(self) -> tuple[Array, Array, Array]:
        """Energies and directions of the data in units of the prior, and the target along them."""
        return self._spectrum(self.problem.normal)

    def _spectrum(self, normal: NormalEquations) -> tuple[Array, Array, Array]:
        energy, directions = seen_directions(self.root.T @ normal.xx @ self.root)
        return energy, directions, directions.T @ (self.root.T @ normal.xy)

    def path(self, normal: NormalEquations) -> Array:
        """Standardised coefficients for all strengths, shape (strengths, d)."""
        energy, directions, target = self._spectrum(normal)
        return np.asarray((target / (energy + np.array(STRENGTHS)[:, None])) @ (self.root @ directions).T)

    def solve(self, strength: float) -> Array:
        """``θ`` of shape (p,), unseen columns moved along with the seen as their covariance says."""
        energy, directions, target = self.spectrum
        weights = directions @ (target / (energy + strength))  # of the roots' columns
        problem = self.problem
        dual = np.linalg.solve(self.root.T, weights) / problem.scale
        return np.asarray(problem.prior + self.covariance[:, problem.live] @ dual)

    def prior(self, strength: float) -> Array | None:
        """The prior's covariance in units of the weighted rows' noise, shape (p, p); None without strength."""
        unit = strength * float(self.problem.count.sum()) * self.problem.target_rms**2
        return self.covariance / unit if unit > 0.0 else None

    def pull(self, strength: float) -> Array:
        """What the prior adds to the weighted ``S_xx``, its inverse, shape (p, p)."""
        unit = strength * float(self.problem.count.sum()) * self.problem.target_rms**2
        size = np.sqrt(np.diag(self.covariance))
        inverse = np.linalg.inv(self.covariance / np.outer(size, size)) / np.outer(size, size)
        return np.asarray(0.5 * unit * (inverse + inverse.T))

    def effective_parameters(self, strength: float) -> float:
        """How many directions the data decide."""
        energy = self.spectrum[0]
        return float(np.sum(energy / (energy + strength)))

    def choose_strength(self, folds: int) -> float:
        """The weaker of the strengths of least error on folds left out and of most evidence."""
        error = cross_validate(self.problem, folds, self.path, choice="ridge strength")
        return STRENGTHS[min(int(np.argmin(error)), int(np.argmax(self.evidence())))]

    def evidence(self) -> Array:
        """Logarithm of the evidence of every strength, up to a constant, shape (strengths,).

        Along each direction the target is Gaussian with variance ``κ e (1 + e / strength)``, ``e`` its energy and
        ``κ`` the noise of least squares, from what differs between blocks.
        """
        energy, _, target = self.spectrum
        noise = self._noise()
        variance = noise * energy * (1.0 + energy / np.array(STRENGTHS)[:, None])
        return np.asarray(-0.5 * np.sum(np.log(variance) + target**2 / variance, axis=1))

    def _noise(self) -> float:
        """Variance of least squares along directions of unit information, under residuals of any colour."""
        problem = self.problem
        energy, directions, target = self.spectrum
        whitening = self.root @ directions / np.sqrt(energy)
        fitted = whitening @ (target / np.sqrt(energy))
        residual = problem.moments.scores(fitted)
        shares = (whitening.T @ block[:-1, :-1] @ whitening for block in problem.moments.by_block())
        expected = len(energy) - sum(float(np.sum(information**2)) for information in shares)
        white = problem.normal.residual_energy(fitted) / max(float(problem.count.sum()), 1.0)
        floor = max(white, np.finfo(np.float64).eps ** 2)
        return max(float(np.sum((residual @ whitening) ** 2)) / expected, floor) if expected > 0.0 else floor

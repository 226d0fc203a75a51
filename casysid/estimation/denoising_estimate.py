"""From moments to an estimate by a de-noising regression: what Bayesian de-noising and Joint Factor Analysis share.

Every joint's rows are weighted by its own noise, which is re-estimated from the fit until it settles; rows are taken
relative to the prior, columns standardised, the model fitted, and all of it undone.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate
from casysid.estimation.denoising import STARTS, Start, denoise, state_from
from casysid.estimation.denoising_em import DenoisingModel, GammaPrior, State
from casysid.estimation.denoising_posterior import DenoisingPosterior
from casysid.estimation.selection import conditional_covariance
from casysid.estimation.standardise import (
    NOISE_FLOOR,
    StandardisedProblem,
    check_prior,
    estimate_noise_std,
    seen_directions,
    standardise,
)
from casysid.moments import Moments, NormalEquations

SETTLED = 0.01
"""Relative change of the joints' noise at which their weights have settled."""


@dataclass(frozen=True, eq=False)
class Scale:
    """In what units the model sees a standardised problem.

    Attributes:
        rows: Independent rows that the data are worth.
        output: Factor of the output.
    """

    rows: float
    output: float

    def apply(self, means: NormalEquations) -> NormalEquations:
        """Sums over so many rows of so large an output, from means over rows."""
        xx, xy = self.rows * means.xx, self.rows * self.output * means.xy
        return NormalEquations(frozen(xx), frozen(xy), self.rows * self.output**2 * means.yy, self.rows)


@dataclass(frozen=True, kw_only=True)
class DenoisingEstimator(ABC):
    """Hyperparameters of both methods.

    Attributes:
        vector: ``noiseless`` gives the paper's ``b_true`` (Eq. 4), the parameters of the robot; ``noisy`` its
            ``b_noise`` (Eq. 3), which predicts best from inputs as noisy as these.
        starts: Where EM begins; the largest bound is kept.
        reweightings: How often the joints' weights are re-estimated at most.
        tolerance: Relative gain of the bound over ten accelerated iterations at which it has come to rest.
        max_iterations: Accelerated iterations of each start at most.
    """

    name: ClassVar[str]

    vector: Literal["noiseless", "noisy"] = "noiseless"
    starts: tuple[Start, ...] = STARTS
    reweightings: int = 5
    tolerance: float = 1e-9
    max_iterations: int = 20_000

    def __post_init__(self) -> None:
        if self.vector not in ("noiseless", "noisy"):
            raise ParameterError(f"{self.name}: vector must be 'noiseless' or 'noisy'; got {self.vector!r}")
        if not self.starts or self.reweightings < 0 or self.max_iterations < 1 or not 0.0 < self.tolerance < 1.0:
            raise ParameterError(
                f"{self.name}: wanted a start, reweightings >= 0, max_iterations >= 1 and 0 < tolerance < 1; got "
                f"{len(self.starts)} starts, {self.reweightings}, {self.max_iterations} and {self.tolerance}"
            )

    @property
    @abstractmethod
    def precision_prior(self) -> GammaPrior | None:
        """Of the weights' precisions."""

    @abstractmethod
    def scale(self, problem: StandardisedProblem) -> Scale:
        """The units in which the model sees the problem."""

    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """The chosen vector; columns without energy and directions that the data do not see stay at ``prior``."""
        theta0 = check_prior(moments, prior)
        noise_std = estimate_noise_std(moments.shifted(theta0))
        problem = standardise(_pool_joints(moments, noise_std), theta0)
        if problem.is_degenerate:
            return dataclasses.replace(problem.degenerate_estimate(self.name), noise_std=noise_std)
        first = fit = self._fit(problem, None)
        for _ in range(self.reweightings if len(noise_std) > 1 else 0):
            update = fit.residual_std(moments)
            if np.abs(np.log(update / noise_std)).max() <= SETTLED:
                break
            noise_std = update
            fit = self._fit(standardise(_pool_joints(moments, noise_std), theta0), fit)
        return self._to_estimate(fit, first.posterior.start_bounds, noise_std)

    def _fit(self, problem: StandardisedProblem, before: DenoisingFit | None) -> DenoisingFit:
        """From all starts, or on from the fit before."""
        scale = self.scale(problem)
        normal = scale.apply(problem.normal)
        starts: Sequence[Start | State] = self.starts
        if before is not None:
            starts = [before.carry_over(problem, scale, DenoisingModel(normal, self.precision_prior))]
        posterior = denoise(
            normal,
            prior=self.precision_prior,
            starts=starts,
            tolerance=self.tolerance,
            max_iterations=self.max_iterations,
        )
        return DenoisingFit(problem, scale, posterior)

    def _to_estimate(self, fit: DenoisingFit, start_bounds: Array, noise_std: Array) -> Estimate:
        posterior = fit.posterior
        relevant = posterior.is_relevant
        estimate = fit.problem.to_estimate(
            self.name,
            fit.seen_part(fit.noiseless if self.vector == "noiseless" else fit.noisy),
            fit.covariance(np.where(relevant, fit.amplification, 1.0) if self.vector == "noiseless" else None),
            status=posterior.status,
            diagnostics={
                "bound": posterior.bound,
                "bound_spread_of_starts": float(np.ptp(start_bounds)),
                "starts": float(len(start_bounds)),
                "iterations": float(len(posterior.bounds) - 1),
                "evaluations": float(posterior.evaluations),
                "relevant": float(relevant.sum()),
                "effective_rows": fit.scale.rows,
                "input_noise_fraction": float(np.median(fit.input_noise[relevant])) if relevant.any() else 1.0,
            },
        )
        return dataclasses.replace(estimate, noise_std=noise_std, metric=fit.metric)


@dataclass(frozen=True, eq=False)
class DenoisingFit:
    """A posterior with the problem it belongs to; arrays in the problem's standardised units.

    Attributes:
        problem: Joints weighted and pooled, relative to the prior, standardised.
        scale: Units in which the model saw it.
        posterior: What the model says.
    """

    problem: StandardisedProblem
    scale: Scale
    posterior: DenoisingPosterior

    @property
    def noisy(self) -> Array:
        """``b_noise``, shape (d,)."""
        return self.posterior.noisy_regression / self.scale.output

    @property
    def noiseless(self) -> Array:
        """``b_true``, shape (d,), with no more noise in a column than :attr:`largest_input_noise`."""
        return self.posterior.noiseless_regression_within(self.largest_input_noise) / self.scale.output

    @property
    def amplification(self) -> Array:
        """``b_true / b_noise``, shape (d,)."""
        return np.divide(self.noiseless, self.noisy, out=np.ones_like(self.noisy), where=self.noisy != 0.0)

    @cached_property
    def largest_input_noise(self) -> Array:
        """What the other columns leave unexplained of each, shape (d,): more independent noise it cannot have.

        ``S_xx`` less the noise is positive semidefinite only if ``ψx_m ≤ 1/(S_xx⁺)_mm`` (the Frisch scheme's bound).
        The model, which takes the ``t_m`` as independent, does not know that. Directions in which the columns depend on
        each other exactly bind the noise as well, hence the pseudo-inverse.
        """
        values, vectors = seen_directions(self.problem.normal.xx)
        return np.asarray(1.0 / ((vectors * vectors) @ (1.0 / values)))

    @property
    def input_noise(self) -> Array:
        """``ψx``, but never more than :attr:`largest_input_noise`, shape (d,)."""
        return np.minimum(self.posterior.input_noise, self.largest_input_noise)

    @property
    def metric(self) -> Array:
        """``G = Σ x xᵀ / σ² + N diag(ψx)`` as the paper's Eq. (8) prints it, in the regressor's units, shape (p, p).

        ψx is that of relevant columns. Of a column that is switched off ψx is the whole, which says that it is not used
        and not that it is noise; with it, a projection would give up torque to keep useless columns where they are.
        """
        metric: Array = self.problem.metric * self.problem.noise_std[0] ** 2  # pooled rows were divided by σ before
        live = self.problem.live
        metric[live, live] *= 1.0 + np.where(self.posterior.is_relevant, self.input_noise, 0.0)
        return metric

    def seen_part(self, coefficients: Array) -> Array:
        """Without what lies in directions that the data do not see, shape (d,)."""
        _, vectors = seen_directions(self.problem.normal.xx)
        return np.asarray(vectors @ (vectors.T @ coefficients))

    def residual_std(self, moments: Moments) -> Array:
        """Residual standard deviation of every joint when the noisy vector predicts, shape (joints,), [N m]."""
        theta = self.problem.restore(self.noisy)
        count = moments.count.sum(axis=0)
        freedom = np.maximum(count * (1.0 - self.posterior.is_relevant.sum() / max(count.sum(), 1.0)), 1.0)
        variance = moments.residual_energy(theta).sum(axis=0) / freedom
        target = moments.shifted(self.problem.prior).target_energy().sum(axis=0) / np.maximum(count, 1.0)
        floor = NOISE_FLOOR * np.sqrt(np.where(target > 0.0, target, max(target.max(initial=0.0), 1.0)))
        return np.asarray(np.maximum(np.sqrt(variance), floor))

    def covariance(self, amplification: Array | None) -> Array:
        """Of the coefficients, shape (d, d), given which columns are relevant and how much of each is noise.

        Relevant columns have the posterior of h under the prior that α puts on it; for the others see
        :func:`conditional_covariance`. ``b_true`` is the noisy vector times a factor that start and prior decide (the
        data do not), so its uncertainty is the noisy vector's times that factor.
        """
        posterior = self.posterior
        relevant = posterior.is_relevant
        ratio = np.divide(posterior.mean_square, posterior.input_weight, out=np.zeros_like(self.noisy), where=relevant)
        penalty = posterior.relevance * ratio**2 * posterior.conditional_variance / self.scale.rows
        covariance = conditional_covariance(self.problem, self.noisy, relevant, penalty=penalty)
        return covariance if amplification is None else covariance * np.outer(amplification, amplification)

    def carry_over(self, problem: StandardisedProblem, scale: Scale, model: DenoisingModel) -> State:
        """This fit as the start of one with other weights of the joints."""
        coefficients = self.noisy * self.problem.scale / problem.scale * scale.output
        return state_from(model, coefficients, self.posterior.noise_fraction)


def _pool_joints(moments: Moments, noise_std: Array) -> Moments:
    """All joints' rows divided by their noise, as if of one joint."""
    gram = np.einsum("j,bjmn->bmn", noise_std**-2.0, moments.gram)[:, None]
    return Moments(gram, moments.count.sum(axis=1, keepdims=True), moments.columns, ("pooled",))

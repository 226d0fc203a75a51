"""From moments to an estimate by a de-noising regression: what Bayesian de-noising and Joint Factor Analysis share.

Every joint's rows are weighted by its own noise, which is re-estimated from the fit until it settles; rows are taken
relative to the prior, columns standardised, exact mixtures of others left out, the model fitted, and all of it undone.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate
from casysid.estimation.denoising import STARTS, Start, denoise
from casysid.estimation.denoising_em import DenoisingModel, GammaPrior, State
from casysid.estimation.denoising_fit import DenoisingFit, Scale
from casysid.estimation.mixtures import find_parts
from casysid.estimation.standardise import StandardisedProblem, check_prior, estimate_noise_std, standardise
from casysid.moments import Moments
from casysid.threads import single_threaded

SETTLED = 0.01
"""Relative change of the joints' noise at which their weights have settled."""


@dataclass(frozen=True, kw_only=True)
class DenoisingEstimator(ABC):
    """Hyperparameters of both methods.

    Attributes:
        vector: ``noiseless`` gives the paper's ``b_true`` (Eq. 4, with the data's correlations), for noiseless inputs
            such as a reference motion; ``noisy`` its ``b_noise`` (Eq. 3), which predicts best from inputs as noisy as
            these. Where columns are as noisy as in the paper's experiment the difference is large (half of the error
            and more); on robots' smoothed logs it is a few per cent, mostly in favour of ``noisy`` on held-out logs.
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

    @single_threaded()
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """The chosen vector; columns without energy and directions that the data do not see stay at ``prior``."""
        theta0 = check_prior(moments, prior)
        noise_std = estimate_noise_std(moments.shifted(theta0))
        problem = standardise(_pool_joints(moments, noise_std), theta0)
        if problem.is_degenerate:
            return dataclasses.replace(problem.degenerate_estimate(self.name), noise_std=noise_std)
        first = fit = self._fit(problem, self._columns(problem, len(moments.joints)), None)
        for _ in range(self.reweightings if len(noise_std) > 1 else 0):
            update = fit.residual_std(moments)
            if np.abs(np.log(update / noise_std)).max() <= SETTLED:
                break
            noise_std = update
            fit = self._fit(standardise(_pool_joints(moments, noise_std), theta0), fit.chosen, fit)
        return self._to_estimate(fit, first.posterior.start_bounds, noise_std)

    def _columns(self, problem: StandardisedProblem, joints: int) -> npt.NDArray[np.intp]:
        """Without those that are mixtures of others; all, where there are too few rows to tell.

        Columns that depend on each other in the rows of several joints do so by the mechanism, and are no mixtures.
        """
        d = len(problem.live)
        return find_parts(problem.normal.xx) if joints == 1 and problem.normal.count > d else np.arange(d)

    def _fit(
        self, whole: StandardisedProblem, chosen: npt.NDArray[np.intp], before: DenoisingFit | None
    ) -> DenoisingFit:
        """From all starts, or on from the fit before."""
        problem = whole.restricted_to(chosen)
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
        return DenoisingFit(whole, chosen, scale, posterior)

    def _to_estimate(self, fit: DenoisingFit, start_bounds: Array, noise_std: Array) -> Estimate:
        posterior, noiseless = fit.posterior, self.vector == "noiseless"
        relevant = posterior.is_relevant
        estimate = fit.whole.to_estimate(
            self.name,
            fit.spread @ (fit.noiseless if noiseless else fit.noisy),
            fit.spread @ fit.covariance(noiseless=noiseless) @ fit.spread.T,
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


def _pool_joints(moments: Moments, noise_std: Array) -> Moments:
    """All joints' rows divided by their noise, as if of one joint."""
    squares = np.stack(list(moments.by_block(noise_std**-2.0)))
    rows, count = np.arange(len(moments.columns)), moments.count.sum(axis=1, keepdims=True)
    return Moments((squares,), (rows,), count, moments.columns, ("pooled",))

"""A de-noising regression of a robot's pooled rows: the two regression vectors, their covariance, the noise of columns.

The model takes the noiseless columns for independent. Then ``b_true`` is ``b_noise`` column by column, divided by the
share of signal (the paper's Eq. 4), and the share is up to the prior. The data know better: with their own second
moments S and noise of variance F, the vector for noiseless inputs is

    b_true = (S - F)⁻¹ S b_noise

which is Eq. (4) where S is diagonal, and S bounds F: :mod:`casysid.estimation.noise_split`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.estimation.denoising import state_from
from casysid.estimation.denoising_em import DenoisingModel, State
from casysid.estimation.denoising_posterior import DenoisingPosterior
from casysid.estimation.mixtures import weights_of
from casysid.estimation.noise_split import split_noise
from casysid.estimation.selection import conditional_covariance
from casysid.estimation.standardise import NOISE_FLOOR, StandardisedProblem, seen_directions
from casysid.moments import Moments, NormalEquations

ROUNDING = 1e-10
"""Added to the second moments of columns of mean square one before they are split."""
LEAST_RESIDUAL = 1e-12
"""Least unexplained variance of the output, as a fraction of its mean square."""


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


@dataclass(frozen=True, eq=False)
class DenoisingFit:
    """A posterior with the problem it belongs to, d columns of which the model saw r; arrays in standardised units.

    Attributes:
        whole: Joints weighted and pooled, relative to the prior, standardised.
        chosen: The columns that the model saw, shape (r,).
        scale: Units in which it saw them.
        posterior: What the model says.
    """

    whole: StandardisedProblem
    chosen: npt.NDArray[np.intp]
    scale: Scale
    posterior: DenoisingPosterior

    @cached_property
    def problem(self) -> StandardisedProblem:
        """The chosen columns only."""
        return self.whole.restricted_to(self.chosen)

    @property
    def noisy(self) -> Array:
        """``b_noise``, shape (r,)."""
        return self.posterior.noisy_regression / self.scale.output

    @property
    def noiseless(self) -> Array:
        """``b_true``, shape (r,)."""
        return self._amplification @ self.noisy

    @cached_property
    def input_noise(self) -> Array:
        """Share of every chosen column that is noise, shape (r,); zero where the column is not used.

        The output is one more column with noise of its own, so the columns' noise cannot outgrow its residual.
        """
        used = self.posterior.is_relevant
        noise = np.zeros(len(used))
        if used.any():
            xx, xy = self._used_moments, self.problem.normal.xy[used]
            explained = float(xy @ np.linalg.solve(xx, xy))
            yy = max(self.problem.normal.yy, explained + LEAST_RESIDUAL * self.problem.normal.yy)
            noise[used] = split_noise(np.block([[xx, xy[:, None]], [xy, np.array([yy])]]))[:-1]
        return noise

    @cached_property
    def spread(self) -> Array:
        """From coefficients of the chosen columns to the smallest of all that predict the same, shape (d, r)."""
        _, vectors = seen_directions(self.whole.normal.xx)
        return np.asarray(vectors @ vectors[self.chosen].T)

    @property
    def metric(self) -> Array:
        """``G = Σ x xᵀ / σ² + N E[noise noiseᵀ]``, the paper's Eq. (8) as printed, in the regressor's units, (p, p).

        Mixtures of other columns have the noise of their parts. The noise is that of relevant columns: in one that is
        switched off the model takes everything for noise, which says that it is not used and not that it is noise; with
        it, a projection would give up torque to keep useless columns where they are.
        """
        metric: Array = self.whole.metric * self.whole.noise_std[0] ** 2  # pooled rows were divided by σ before
        live = self.whole.live
        size = np.sqrt(np.diag(metric)[live])
        weights = weights_of(self.whole.normal.xx, self.chosen)
        metric[np.ix_(live, live)] += np.outer(size, size) * ((weights * self.input_noise) @ weights.T)
        return metric

    def residual_std(self, moments: Moments) -> Array:
        """Residual standard deviation of every joint when the noisy vector predicts, shape (joints,), [N m]."""
        theta = self.problem.restore(self.noisy)
        count = moments.count.sum(axis=0)
        freedom = np.maximum(count * (1.0 - self.posterior.is_relevant.sum() / max(count.sum(), 1.0)), 1.0)
        variance = moments.residual_energy(theta).sum(axis=0) / freedom
        target = moments.shifted(self.problem.prior).target_energy().sum(axis=0) / np.maximum(count, 1.0)
        floor = NOISE_FLOOR * np.sqrt(np.where(target > 0.0, target, max(target.max(initial=0.0), 1.0)))
        return np.asarray(np.maximum(np.sqrt(variance), floor))

    def covariance(self, *, noiseless: bool) -> Array:
        """Of either vector, shape (r, r), given which columns are relevant and how much of each is noise.

        Relevant columns have the posterior of h under the prior that α puts on it; for the others see
        :func:`conditional_covariance`. ``b_true`` is the noisy vector times a matrix whose uncertainty is left out.
        """
        posterior = self.posterior
        relevant = posterior.is_relevant
        ratio = np.divide(posterior.mean_square, posterior.input_weight, out=np.zeros_like(self.noisy), where=relevant)
        penalty = posterior.relevance * ratio**2 * posterior.conditional_variance / self.scale.rows
        covariance = conditional_covariance(self.problem, self.noisy, relevant, penalty=penalty)
        return self._amplification @ covariance @ self._amplification.T if noiseless else covariance

    def carry_over(self, problem: StandardisedProblem, scale: Scale, model: DenoisingModel) -> State:
        """This fit as the start of one with other weights of the joints."""
        coefficients = self.noisy * self.problem.scale / problem.scale * scale.output
        return state_from(model, coefficients, self.posterior.noise_fraction)

    @property
    def _used_moments(self) -> Array:
        used = self.posterior.is_relevant
        return self.problem.normal.xx[np.ix_(used, used)] + ROUNDING * np.eye(used.sum())

    @cached_property
    def _amplification(self) -> Array:
        """``(S - F)⁻¹ S`` of the relevant columns, the unit matrix for the others, shape (r, r)."""
        used, matrix = self.posterior.is_relevant, np.eye(len(self.chosen))
        xx = self._used_moments
        matrix[np.ix_(used, used)] = np.linalg.solve(xx - np.diag(self.input_noise[used]), xx)
        return matrix

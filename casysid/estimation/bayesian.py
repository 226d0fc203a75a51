"""Bayesian de-noising regression (Ting et al. 2006, §III and Fig. 1(c)) on moments."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.denoising_em import GammaPrior
from casysid.estimation.denoising_estimate import DenoisingEstimator
from casysid.estimation.denoising_fit import Scale
from casysid.estimation.selection import mean_variance
from casysid.estimation.standardise import StandardisedProblem, seen_directions

COLOUR_DEVIATIONS = 3.0
"""Residuals count as coloured as far as their colour exceeds chance by so many standard deviations."""
SMALLEST_RESIDUAL = 1e-12
"""Least residual variance that sets the output's units, as a fraction of its mean square."""


@dataclass(frozen=True, kw_only=True)
class BayesianDenoising(DenoisingEstimator):
    """Regression that takes input and output for noisy and finds out which columns matter.

    The model finds the noisy vector and which columns matter. Its output is measured in units in which every weight
    that the data can tell from zero is large beside the input weights; then the prior's idea of the noise is the same
    for weak and strong columns, and the start hardly matters. How much of the relevant columns is noise, and with it
    the noiseless vector, follows from the data's own correlations (:mod:`casysid.estimation.denoising_fit`).

    Attributes:
        prior: Of the precisions α of the weights.
        weight_error: The standard error of a lone column's weight in units in which input weights are at most one.
        count_effective_rows: Take the data for as few independent rows as the colour of the residuals between blocks
            of time makes them worth; else every row counts, and a robot's 10⁵ correlated rows keep every column.
    """

    name: ClassVar[str] = "bayes"

    prior: GammaPrior = field(default_factory=GammaPrior)
    weight_error: float = 3.0
    count_effective_rows: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.weight_error < np.inf:
            raise ParameterError(f"{self.name}: weight_error must be positive and finite; got {self.weight_error}")

    @property
    def precision_prior(self) -> GammaPrior:
        """Of the weights' precisions."""
        return self.prior

    def scale(self, problem: StandardisedProblem) -> Scale:
        """Effective rows, and an output in which least squares has a standard error of ``weight_error``."""
        normal = problem.normal
        values, vectors = seen_directions(normal.xx)
        coefficients = vectors @ ((vectors.T @ normal.xy) / values)
        variance = max(normal.residual_energy(coefficients), SMALLEST_RESIDUAL * normal.yy)
        rows = effective_rows(problem, coefficients, len(values)) if self.count_effective_rows else normal.count
        return Scale(rows, self.weight_error * float(np.sqrt(rows / variance)))


def effective_rows(problem: StandardisedProblem, coefficients: Array, used: int) -> float:
    """Independent rows that would leave the coefficients as uncertain as the coloured residuals do.

    Args:
        problem: The standardised problem.
        coefficients: Least squares, shape (d,).
        used: Degrees of freedom that it took.

    Returns:
        ``N/κ`` with the variance inflation ``κ`` of :func:`~casysid.estimation.selection.mean_variance`, less what
        chance makes of white residuals; N for a single block.
    """
    normal, blocks = problem.normal, len(problem.count)
    white = normal.residual_energy(coefficients) / max(normal.count - used, 1.0)
    if blocks < 2 or white == 0.0:
        return normal.count
    chance = 1.0 + COLOUR_DEVIATIONS * float(np.sqrt(2.0 / (used * (blocks - 1))))
    return normal.count / max(mean_variance(problem, coefficients, used) / white / chance, 1.0)

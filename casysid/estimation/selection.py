"""What is known about standardised coefficients once a method has chosen which columns to use."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.estimation.standardise import SPECTRUM_TOLERANCE, StandardisedProblem, seen_directions


def conditional_covariance(
    problem: StandardisedProblem,
    coefficients: Array,
    active: npt.NDArray[np.bool_],
    *,
    penalty: Array | None = None,
) -> Array:
    r"""Covariance of standardised coefficients given the choice of columns.

    Chosen columns A have the usual :math:`\hat\sigma^2 (N S_{AA})^{-1}`. A column k that was left out has the variance
    its coefficient would have if it entered alone, :math:`\hat\sigma^2 / (N S_{kk.A})` with the Schur complement
    :math:`S_{kk.A}`: how far from zero the data would let it be, so that "left out" is never mistaken for "known to be
    zero". That the same data made the choice is not accounted for.

    Args:
        problem: The standardised problem, d columns.
        coefficients: ``β``, shape (d,).
        active: Which columns were chosen, shape (d,).
        penalty: Prior precision of the chosen columns in the units of ``xx``, shape (d,); None for none.

    Returns:
        Shape (d, d); the left-out columns are uncorrelated with all others.
    """
    xx = problem.normal.xx
    inside = xx[np.ix_(active, active)] + np.diag(np.zeros(active.sum()) if penalty is None else penalty[active])
    values, vectors = seen_directions(inside)
    inverse = (vectors / values) @ vectors.T
    across = xx[np.ix_(active, ~active)]
    pivots = np.diag(xx)[~active] - np.einsum("ak,ab,bk->k", across, inverse, across)
    covariance = np.zeros_like(xx)
    covariance[np.ix_(active, active)] = inverse
    covariance[~active, ~active] = 1.0 / np.maximum(pivots, SPECTRUM_TOLERANCE)
    return covariance * mean_variance(problem, coefficients, int(active.sum()))


def mean_variance(problem: StandardisedProblem, coefficients: Array, used: int) -> float:
    r"""Variance of a mean over rows, :math:`κ \hat\sigma^2 / N`, after ``used`` degrees of freedom.

    Residuals of a robot are not white. ``κ`` is the variance of the scores :math:`\sum x (y - x^T β)` between blocks
    of time over that of white residuals, pooled over the seen directions; never below one, and one for a single block.
    Source: the cluster-robust sandwich (Liang and Zeger 1986), its meat modelled as ``κ σ² S``.
    """
    normal = problem.normal
    white = normal.residual_energy(coefficients) / max(normal.count - used, 1.0)
    blocks = len(problem.count)
    if blocks < 2 or white == 0.0:
        return white
    values, vectors = seen_directions(normal.xx)
    scores = problem.moments.scores(coefficients) @ (vectors / np.sqrt(values))
    between = float(((scores - scores.mean(axis=0)) ** 2).sum()) * blocks / (blocks - 1)
    return max(white, between / len(values))

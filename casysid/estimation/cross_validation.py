"""Cross-validation over blocks of time, on moments: the training Gram matrix is the total less the held-out fold."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimator
from casysid.estimation.standardise import StandardisedProblem
from casysid.moments import Moments, NormalEquations
from casysid.threads import single_threaded

MINIMUM_BLOCKS = 2


def contiguous_folds(blocks: int, folds: int) -> list[npt.NDArray[np.intp]]:
    """Indices of the blocks of each fold: neighbours in time together, at most ``folds`` folds, none empty."""
    return np.array_split(np.arange(blocks), min(folds, blocks))


def interleaved_folds(blocks: int, folds: int) -> list[npt.NDArray[np.intp]]:
    """Indices of the blocks of each fold, every so many: no fold has a part of the motion to itself."""
    count = min(folds, blocks)
    return [np.arange(k, blocks, count) for k in range(count)]


def cross_validate(
    problem: StandardisedProblem, folds: int, fit_candidates: Callable[[NormalEquations], Array], *, choice: str
) -> Array:
    """Mean squared error of each candidate on blocks that it was not fitted to, shape (candidates,).

    Args:
        problem: The standardised problem, in at least two blocks.
        folds: Number of folds; contiguous in time, because neighbouring samples are alike.
        fit_candidates: Coefficients of all candidates, shape (candidates, d), from training moments in means over rows.
        choice: What is being chosen and how it is given instead, for the error message.

    Raises:
        ParameterError: The moments have a single block.
    """
    if len(problem.count) < MINIMUM_BLOCKS:
        raise ParameterError(
            f"{choice}: cross-validation needs moments in at least {MINIMUM_BLOCKS} blocks of time; got "
            f"{len(problem.count)}. Accumulate the moments in more blocks, or give the value"
        )
    errors = []
    for held_out in contiguous_folds(len(problem.count), folds):
        training = np.setdiff1d(np.arange(len(problem.count)), held_out)
        test = problem.normal_of(held_out)
        errors.append([test.residual_energy(beta) for beta in fit_candidates(_means(problem, training))])
    total: Array = np.sum(errors, axis=0)
    return total


def _means(problem: StandardisedProblem, blocks: npt.NDArray[np.intp]) -> NormalEquations:
    """Training moments per training row, so that strengths mean the same in a fold as in the whole."""
    part = problem.normal_of(blocks)
    factor = problem.count.sum() / max(part.count, 1.0)
    return NormalEquations(part.xx * factor, part.xy * factor, part.yy * factor, part.count)


@single_threaded()
def cross_validated_energy(estimator: Estimator, moments: Moments, prior: Array | None, folds: int = 5) -> Array:
    """``Σ (y - xᵀθ)²`` by joint, shape (joints,), every block predicted by parameters fitted without its fold."""
    energy = np.zeros(len(moments.joints))
    for held_out in contiguous_folds(moments.blocks, folds):
        training = np.setdiff1d(np.arange(moments.blocks), held_out)
        estimate = estimator.estimate(moments.select_blocks(training), prior)
        energy += moments.select_blocks(held_out).residual_energy(estimate.parameters).sum(axis=0)
    return energy

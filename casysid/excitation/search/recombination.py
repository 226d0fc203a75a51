"""New motions from good ones: each joint moves as in one of them, perhaps mirrored, perhaps backwards in time.

What makes one joint's motion good depends on the other joints' motions only in part, so that among many mixtures some
are better to climb from than anything drawn at random.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from casysid.arrays import Array
from casysid.excitation.design.problem import ExcitationProblem
from casysid.excitation.search.program import Evaluation

MIXTURES = 150
"""Looked at."""
TURNED = 0.3
"""Chance that a joint's motion is mirrored, and that it is turned back in time."""
PENALTY = 200.0
"""On the largest violation, as a share of the limits, when mixtures are compared."""


def mixtures(
    problem: ExcitationProblem, evaluation: Evaluation, motions: Sequence[Array], rng: np.random.Generator, count: int
) -> list[Array]:
    """Variables of the best ``count`` of many mixtures; they may go beyond limits."""
    joints, half = len(problem.robot.dofs), problem.series.harmonics - 1
    parents = np.stack([x.reshape(joints, -1) for x in motions])
    lower, upper = evaluation.bounds(0.0)
    found: list[tuple[float, Array]] = []
    for _ in range(MIXTURES):
        child = parents[rng.integers(len(parents), size=joints), np.arange(joints)]
        mirrored, backwards = rng.random((2, joints)) < TURNED
        child[mirrored] = _mirrored(problem, child)[mirrored]
        child[backwards, 1 : 1 + half] *= -1.0
        x = child.ravel()
        values = evaluation.constraints(x)
        beyond = float(np.max([lower - values, values - upper], initial=0.0))
        found.append((evaluation.objective(x) + PENALTY * beyond, x))
    return [x for _, x in sorted(found, key=lambda one: one[0])[:count]]


def _mirrored(problem: ExcitationProblem, values: Array) -> Array:
    """About the middle of the limits, or about the start where that is given."""
    limits = problem.limits
    middle = (limits.middle if problem.start is None else problem.start) / limits.half_range
    answer = -values
    answer[:, 0] += 2.0 * middle
    return np.asarray(answer)

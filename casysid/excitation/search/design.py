"""Designing one motion, or a set of motions that complement each other."""

from __future__ import annotations

import numpy as np

from casysid.errors import ParameterError
from casysid.excitation.design.problem import ExcitationProblem
from casysid.excitation.design.result import DesignStatus, ExcitationDesign, Progress
from casysid.excitation.search.program import default_settings
from casysid.excitation.search.search import Search
from casysid.threads import single_threaded


@single_threaded()
def design_excitation(
    problem: ExcitationProblem,
    *,
    starts: int = 4,
    seed: int = 0,
    max_iterations: int = 300,
    max_seconds: float = np.inf,
    tolerance: float = 1e-2,
    progress: Progress | None = None,
) -> ExcitationDesign:
    """The best motion that several starts lead to. It keeps all limits, or there is an exception.

    The first start is a small motion about the middle of the limits, which is feasible for certain; others are the
    best of many random motions after some steps uphill, and the last one is a mixture of what was found until then. The
    best optima are polished: climbed from once more, close to the limits.

    Args:
        problem: From :func:`build_excitation`.
        starts: How many.
        seed: Of the random motions.
        max_iterations: Of each start.
        max_seconds: Of the whole design; the best motion so far is returned then.
        tolerance: On the optimality conditions; the criterion is then known to about this.
        progress: Called at every iteration. On Ctrl-C the best motion so far is returned.

    Raises:
        ParameterError: No motion keeps the limits; the message names what is in the way.
    """
    if starts < 1 or max_iterations < 1 or not max_seconds > 0.0:
        raise ParameterError(
            f"excitation: starts, max_iterations and max_seconds must be positive; got {starts}, {max_iterations}, "
            f"{max_seconds}"
        )
    settings = default_settings(max_iterations, max_seconds, tolerance)
    return Search(problem, starts, seed, settings, progress).run()


@single_threaded()
def design_set(
    problem: ExcitationProblem, count: int, *, starts: int = 4, seed: int = 0, progress: Progress | None = None
) -> tuple[ExcitationDesign, ...]:
    """Several motions that complement each other: each is designed knowing what those before it tell.

    All start, and end, where the first one does, so they can be played one after another.

    Raises:
        ParameterError: ``count`` is not positive, or no motion keeps the limits.
    """
    if count < 1:
        raise ParameterError(f"excitation: a set needs at least one trajectory; got {count}")
    designs: list[ExcitationDesign] = []
    for k in range(count):
        design = design_excitation(problem, starts=starts, seed=seed + k, progress=progress)
        designs.append(design)
        if design.status is DesignStatus.INTERRUPTED:
            break
        problem = problem.knowing(design.gained).starting_at(design.trajectory.start)
    return tuple(designs)

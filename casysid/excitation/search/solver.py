"""One solve after another for one design: time, progress, Ctrl-C, and the best feasible motion on the way."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from casysid.arrays import Array
from casysid.excitation.design.problem import ExcitationProblem
from casysid.excitation.design.result import DesignStep, Progress
from casysid.excitation.search.program import Evaluation, Program
from casysid.nlp import NlpIteration, NlpSettings, NlpStatus, solve_nlp

FEASIBLE = 1e-6
"""Largest violation, as a share of the limits and beyond the tightening, of what counts as keeping them."""


class Found(NamedTuple):
    """A motion that keeps the limits of some grid; an objective of inf says that there is none."""

    objective: float
    variables: Array
    converged: bool


class Solved(NamedTuple):
    """What came of one solve: the best motion on the way, and how it ended."""

    best: Found
    status: NlpStatus
    iterations: int
    seconds: float


class Solver:
    """Solves for one design, until it took long enough or is asked to stop.

    Attributes:
        problem: What is designed.
        evaluations: All that were made.
        stopped: Whether somebody asked to stop.
    """

    def __init__(
        self, problem: ExcitationProblem, starts: int, settings: NlpSettings, progress: Progress | None
    ) -> None:
        """Nothing solved yet."""
        self.problem, self._starts, self._settings, self._progress = problem, starts, settings, progress
        self._began, self.stopped, self._least = time.perf_counter(), False, np.inf
        self.evaluations: list[Evaluation] = []

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return time.perf_counter() - self._began

    @property
    def over(self) -> bool:
        """Whether to begin nothing new."""
        return self.stopped or self.seconds > self._settings.max_seconds

    def count(self, evaluation: Evaluation) -> Evaluation:
        """The same, counted."""
        self.evaluations.append(evaluation)
        return evaluation

    def solve(self, program: Program, number: int, x: Array) -> Solved:
        """The optimum, or else the best motion on the way that keeps the limits of the grid; Ctrl-C stops."""
        best = Found(np.inf, x, False)

        def tell(iteration: NlpIteration) -> bool:
            nonlocal best
            if iteration.infeasibility <= FEASIBLE and iteration.objective < best.objective:
                best = Found(iteration.objective, iteration.variables, False)
            self.stopped = self.stopped or self._tell(number, iteration, best.objective)
            return self.over

        began, (least, most) = time.perf_counter(), bounds(self.problem)
        lower, upper = program.evaluation.bounds(self.problem.tightening)
        try:
            solution = solve_nlp(
                program.nlp,
                x,
                lower=least,
                upper=most,
                constraint_lower=lower,
                constraint_upper=upper,
                progress=tell,
            )
        except KeyboardInterrupt:
            self.stopped = True
            return Solved(best, NlpStatus.STOPPED, 0, time.perf_counter() - began)
        if solution.success and solution.infeasibility <= FEASIBLE:
            best = Found(solution.objective, solution.variables, True)
        return Solved(best, solution.status, solution.iterations, solution.seconds)

    def _tell(self, number: int, iteration: NlpIteration, best: float) -> bool:
        if self._progress is None:
            return False
        self._least = min(self._least, best)
        step = DesignStep(
            start=number,
            starts=self._starts,
            step=iteration.step,
            objective=iteration.objective,
            infeasibility=iteration.infeasibility,
            best=self._least,
            seconds=self.seconds,
        )
        return bool(self._progress(step))


def bounds(problem: ExcitationProblem) -> tuple[Array, Array]:
    """Of the variables: a start that was given stays, everything else is free."""
    width = 1 + problem.series.size
    lower, upper = (np.full(len(problem.limits.lower) * width, side) for side in (-np.inf, np.inf))
    if problem.start is not None:
        lower[::width] = upper[::width] = problem.start / problem.limits.half_range
    return lower, upper

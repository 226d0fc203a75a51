"""The search behind a design: several starts, IPOPT from each, the best one repaired and checked on a fine grid."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from casysid.arrays import Array
from casysid.excitation.blocks import Block, TorqueBlock
from casysid.excitation.criteria import Balanced, DOptimal
from casysid.excitation.feasible import Standing, find_standing, random_start, small_start
from casysid.excitation.problem import ExcitationProblem
from casysid.excitation.program import Evaluation, Program
from casysid.excitation.repair import shrunk, violated_instants
from casysid.excitation.results import DesignStatus, DesignStep, ExcitationDesign, Progress, StartReport
from casysid.excitation.verification import Verification, verify
from casysid.nlp import NlpIteration, NlpSettings, NlpSolution, solve_nlp

DRAWS = 12
"""Random motions looked at for each start; the best become starts."""
STRIDE = 2
"""The optimiser looks at joints' limits at every so many instants of the design grid."""
WATCHED = 0.4
"""The optimiser looks at the torque of joints where random motions take more than this share of the limit."""
NEARLY = 0.997
"""A motion that passes the check when made smaller by this factor needs no repair."""
REPAIRS = 2
"""How often the best motion is optimised again, with more instants where it went beyond limits."""
FEASIBLE = 1e-6
"""Largest violation, as a share of the limits and beyond the tightening, of what counts as keeping them."""


class Found(NamedTuple):
    """A motion that keeps the limits of some grid."""

    objective: float
    variables: Array
    converged: bool


class Search:
    """One run: what was found so far, so that it can end at any time."""

    def __init__(
        self,
        problem: ExcitationProblem,
        starts: int,
        seed: int,
        settings: NlpSettings,
        progress: Progress | None,
    ) -> None:
        """Nothing found yet."""
        self.problem, self.starts, self.seed, self.settings = problem, starts, seed, settings
        self.progress, self.began, self.stopped = progress, time.perf_counter(), False
        self.reports: list[StartReport] = []
        self.evaluations: list[Evaluation] = []
        self.found: list[Found] = []

    def run(self) -> ExcitationDesign:
        """Search, then make sure of the limits."""
        standing = find_standing(self.problem, self.seed)
        safe = small_start(self.problem, standing, self.seed)
        every = self._evaluation(self.problem, self.problem.blocks)
        self.found.append(Found(every.objective(safe), safe, False))
        try:
            self._search(standing, safe, every)
        except KeyboardInterrupt:
            self.stopped = True
        best, shrink = self._best_within_limits(every)
        finished = DesignStatus.CONVERGED if best.converged and not self._over() else DesignStatus.UNFINISHED
        return ExcitationDesign(
            problem=self.problem,
            trajectory=self.problem.trajectory(best.variables),
            status=DesignStatus.INTERRUPTED if self.stopped else finished,
            starts=tuple(self.reports),
            evaluations={name: sum(one.counts[name] for one in self.evaluations) for name in every.counts},
            seconds=time.perf_counter() - self.began,
            shrink=shrink,
        )

    def _search(self, standing: Standing, safe: Array, every: Evaluation) -> None:
        """Every start, then the best again where it goes beyond limits between instants."""
        drawn = self._draw(standing, every) if self.starts > 1 else []
        blocks = self._watched([safe, *drawn])
        program = Program(self._evaluation(self.problem, blocks, STRIDE), self.settings)
        for k, x in enumerate([safe, *drawn[: self.starts - 1]]):
            self._solve(program, k + 1, self._prepared(k + 1, x, blocks))
        extra = np.empty(0)
        for _ in range(REPAIRS):
            best = min(self.found, key=lambda one: one.objective)
            if self._over() or shrunk(self.problem, best.variables, NEARLY) is not None:
                break
            checked = verify(self.problem, self.problem.trajectory(best.variables))
            extra = np.append(extra, violated_instants(self.problem, checked))
            self.found = [one for one in self.found if one is not best]
            self._keep_smaller(best, every)
            evaluation = self._evaluation(self.problem, self._watched([safe, *drawn], checked), 1, extra)
            self._solve(Program(evaluation, self._repairing), self.starts + 1, best.variables)

    def _prepared(self, number: int, x: Array, blocks: Sequence[Block]) -> Array:
        """The start; for a criterion that is hard to climb from there, first the balanced motion near it."""
        if isinstance(self.problem.criterion, (DOptimal, Balanced)):
            return x
        easier = self.problem.judged_by(Balanced())
        program = Program(self._evaluation(easier, blocks, STRIDE), self._preparing)
        best, solution = self._run(program, number, x)
        if solution is None:
            raise KeyboardInterrupt
        if np.isfinite(best.objective):
            every = self._evaluation(self.problem, blocks, STRIDE)
            self.found.append(Found(every.objective(best.variables), best.variables, False))
        return best.variables

    @property
    def _preparing(self) -> NlpSettings:
        return dataclasses.replace(self.settings, max_iterations=min(self.settings.max_iterations, 60))

    @property
    def _repairing(self) -> NlpSettings:
        return dataclasses.replace(self._preparing, barrier=1e-3)

    def _keep_smaller(self, one: Found, every: Evaluation) -> None:
        """Remember the motion made smaller until it passes, in case nothing better comes."""
        smaller = shrunk(self.problem, one.variables)
        if smaller is not None:
            self.found.append(Found(every.objective(smaller[0]), smaller[0], one.converged))

    def _evaluation(
        self, problem: ExcitationProblem, blocks: Sequence[Block], stride: int = 1, extra: Array | None = None
    ) -> Evaluation:
        self.evaluations.append(Evaluation(problem, blocks, stride, extra))
        return self.evaluations[-1]

    def _draw(self, standing: Standing, every: Evaluation) -> list[Array]:
        """Random motions, best first."""
        rng = np.random.default_rng(self.seed)
        drawn = [random_start(self.problem, every, standing, rng) for _ in range(DRAWS * (self.starts - 1))]
        feasible = [x for x in drawn if x is not None]
        values = [every.objective(x) for x in feasible]
        self.found += [Found(values[k], feasible[k], False) for k in np.argsort(values)[:1]]
        return [feasible[k] for k in np.argsort(values)]

    def _watched(self, motions: list[Array], checked: Verification | None = None) -> list[Block]:
        """All constraints but the torque of joints that stay far from their limits."""
        violated = {one.label for one in checked.violations if one.kind == "torque"} if checked else set()
        blocks: list[Block | None] = []
        for block in self.problem.blocks:
            if isinstance(block, TorqueBlock):
                grid = self.problem.series.grid(self.problem.samples)
                peak = [np.abs(block.measure(self.problem.trajectory(x).motion(grid))).max(axis=0) for x in motions[:8]]
                wanted = np.max(peak, axis=0) > WATCHED * block.limit
                blocks.append(block.watching(wanted | np.array([label in violated for label in block.labels])))
            else:
                blocks.append(block)
        return [block for block in blocks if block is not None]

    def _solve(self, program: Program, number: int, x: Array) -> None:
        """Run, and remember the best motion on the way and a report."""
        if self._over():
            return
        first = program.evaluation.objective(x)
        best, solution = self._run(program, number, x)
        if np.isfinite(best.objective):
            self.found.append(best)
        if solution is None:
            raise KeyboardInterrupt
        self.reports.append(
            StartReport(
                status=solution.status,
                first=first,
                objective=best.objective,
                iterations=solution.iterations,
                seconds=solution.seconds,
            )
        )

    def _run(self, program: Program, number: int, x: Array) -> tuple[Found, NlpSolution | None]:
        """The optimum, or else the best motion on the way that keeps the limits of the grid; None after Ctrl-C."""
        best = Found(np.inf, x, False)

        def tell(iteration: NlpIteration) -> bool:
            nonlocal best
            if iteration.infeasibility <= FEASIBLE and iteration.objective < best.objective:
                best = Found(iteration.objective, iteration.variables, False)
            self.stopped = self.stopped or self._tell(number, iteration, best.objective)
            return self._over()

        sides, limits = _bounds(self.problem), program.evaluation.bounds(self.problem.tightening)
        try:
            solution = solve_nlp(
                program.nlp,
                x,
                lower=sides[0],
                upper=sides[1],
                constraint_lower=limits[0],
                constraint_upper=limits[1],
                progress=tell,
            )
        except KeyboardInterrupt:
            return best, None
        if solution.success and solution.infeasibility <= FEASIBLE:
            best = Found(solution.objective, solution.variables, True)
        return best, solution

    def _over(self) -> bool:
        return self.stopped or time.perf_counter() - self.began > self.settings.max_seconds

    def _tell(self, number: int, iteration: NlpIteration, best: float) -> bool:
        if self.progress is None:
            return False
        step = DesignStep(
            start=number,
            starts=self.starts,
            step=iteration.step,
            objective=iteration.objective,
            infeasibility=iteration.infeasibility,
            best=min(best, *(one.objective for one in self.found)),
            seconds=time.perf_counter() - self.began,
        )
        return bool(self.progress(step))

    def _best_within_limits(self, every: Evaluation) -> tuple[Found, float]:
        """Of all that was found, made smaller where needed, the best that passes the check; in the end the safe one."""
        best, shrink = Found(np.inf, self.found[0].variables, False), 0.0
        for one in sorted(self.found, key=lambda one: one.objective):
            if one.objective >= best.objective:
                break
            smaller = shrunk(self.problem, one.variables)
            if smaller is not None and (value := every.objective(smaller[0])) < best.objective:
                best, shrink = Found(value, smaller[0], one.converged), smaller[1]
        return best, shrink


def _bounds(problem: ExcitationProblem) -> tuple[Array, Array]:
    """Bounds of the variables: a start that was given stays, everything else is free."""
    width = 1 + problem.series.size
    lower, upper = (np.full(len(problem.limits.lower) * width, side) for side in (-np.inf, np.inf))
    if problem.start is not None:
        lower[::width] = upper[::width] = problem.start / problem.limits.half_range
    return lower, upper

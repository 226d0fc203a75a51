"""The search behind a design: many motions looked at, several starts, the best ones polished and checked finely."""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np

from casysid.arrays import Array
from casysid.excitation.constraints.constraint import Constraint
from casysid.excitation.design.criteria import Balanced, DOptimal
from casysid.excitation.design.problem import ExcitationProblem
from casysid.excitation.design.result import DesignStatus, ExcitationDesign, Progress, StartReport
from casysid.excitation.search.constraint_sampling import NearLimits, Watched, busy_constraints, on_grid
from casysid.excitation.search.initial import Standing, find_standing, random_start, small_motion
from casysid.excitation.search.program import Evaluation, Program
from casysid.excitation.search.recombination import mixtures
from casysid.excitation.search.scaling import scaled_to_feasible
from casysid.excitation.search.solver import Found, Solved, Solver
from casysid.nlp import NlpSettings, NlpStatus

DRAWS = 6
"""Random motions drawn for each start."""
EXPLORED = 3
"""The best of them, so many for each start, are climbed from for a few steps; the best of these become starts."""
STEPS = 15
"""How many."""
COARSE, STRIDE = 4, 2
"""The optimiser looks at joints' limits at every so many instants of the design grid: while exploring, and later."""
MIXED = 3
"""So many mixtures of the motions found are climbed from for a few steps; the best of these becomes a start."""
POLISHED = 2
"""So many of the motions found are polished: climbed from within limits that are looked at often."""
ROUNDS = 2
"""How often, with more instants where a motion came near to limits."""
POLISHING = 60
"""Steps at most each time."""
BARRIER = 1e-3
"""IPOPT's first barrier parameter then."""
NEARLY = 0.999
"""A motion that passes the check when made smaller by this factor is not polished again."""
PREPARING = 60
"""Steps towards the balanced motion before a criterion that is hard to climb is climbed."""


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
        self.solver = Solver(problem, starts, settings, progress)
        self.reports: list[StartReport] = []
        self.found: list[Found] = []

    def run(self) -> ExcitationDesign:
        """Search, then make sure of the limits."""
        standing = find_standing(self.problem, self.seed)
        safe = small_motion(self.problem, standing, self.seed)
        every = self.solver.count(Evaluation(self.problem))
        self.found.append(Found(every.objective(safe), safe, False))
        try:
            self._search(standing, safe, every)
        except KeyboardInterrupt:
            self.solver.stopped = True
        best, shrink = self._best_within_limits(every)
        finished = best.converged and not self.solver.over
        end = DesignStatus.CONVERGED if finished else DesignStatus.UNFINISHED
        return ExcitationDesign(
            problem=self.problem,
            trajectory=self.problem.trajectory(best.variables),
            status=DesignStatus.INTERRUPTED if self.solver.stopped else end,
            starts=tuple(self.reports),
            evaluations={name: sum(one.counts[name] for one in self.solver.evaluations) for name in every.counts},
            seconds=self.solver.seconds,
            shrink=shrink,
        )

    def _search(self, standing: Standing, safe: Array, every: Evaluation) -> None:
        """Random motions; the best of them for some steps; the best of these to the end; the best of these polished."""
        drawn = self._draw(standing, every) if self.starts > 1 else []
        constraints = busy_constraints(self.problem, [safe, *drawn[:8]])
        explored = self._explored(drawn[: EXPLORED * (self.starts - 1)], constraints)
        plain = max(1, self.starts - 2)  # the last start comes from a mixture
        ends = self._climbed([safe, *explored[:plain]], constraints, every)
        if self.starts > 2 and not self.solver.over:
            good = [*(one.variables for one in ends), *explored[plain:]]
            mixed = mixtures(self.problem, every, good, np.random.default_rng(self.seed), MIXED)
            ends += self._climbed(self._explored(mixed, constraints)[:1], constraints, every, self.starts)
        for one in sorted(ends, key=lambda one: one.objective)[:POLISHED]:
            self._polish(one, constraints, every)

    def _draw(self, standing: Standing, every: Evaluation) -> list[Array]:
        """Random motions, best first."""
        rng = np.random.default_rng(self.seed)
        drawn = [random_start(self.problem, every, standing, rng) for _ in range(DRAWS * (self.starts - 1))]
        feasible = [x for x in drawn if x is not None]
        values = [every.objective(x) for x in feasible]
        self.found += [Found(values[k], feasible[k], False) for k in np.argsort(values)[:1]]
        return [feasible[k] for k in np.argsort(values)]

    def _explored(self, motions: list[Array], constraints: list[Constraint]) -> list[Array]:
        """Where some steps from each lead, best first; the motion itself where the steps did not keep the limits."""
        program = self._program(self.easier, on_grid(self.problem, COARSE, constraints), self._up_to(STEPS))
        ends = [self._solve(program, 0, x).best for x in motions]
        return [end.variables for end in sorted(ends, key=lambda one: one.objective)]

    def _climbed(
        self, starts: list[Array], constraints: list[Constraint], every: Evaluation, number: int = 1
    ) -> list[Found]:
        """The optimum from each; for a criterion that is hard to climb by way of the balanced motion near it."""
        watched, ends = on_grid(self.problem, STRIDE, constraints), []
        program = self._program(self.problem, watched, self.settings)
        before = self._program(self.easier, watched, self._up_to(PREPARING))
        for k, x in enumerate(starts, number):
            first = every.objective(x)
            near = x if self.easier is self.problem else self._solve(before, k, x).best.variables
            solved = self._solve(program, k, near)
            self._report(first, solved)
            if np.isfinite(solved.best.objective):
                ends.append(solved.best)
                self.found.append(solved.best)
        return ends

    def _polish(self, one: Found, constraints: list[Constraint], every: Evaluation) -> None:
        """Climb on within limits that are looked at often where the motion is near them, until the check is passed."""
        near, x = NearLimits(self.problem, constraints), one.variables
        settings = dataclasses.replace(self._up_to(POLISHING), barrier=BARRIER)
        for _ in range(ROUNDS):
            program = self._program(self.problem, near.see(x), settings)
            first, solved = every.objective(x), self._solve(program, self.starts + 1, x)
            if not np.isfinite(solved.best.objective):
                return
            self._report(first, solved)
            x = solved.best.variables
            smaller = scaled_to_feasible(self.problem, x)
            if smaller is not None:
                self.found.append(Found(every.objective(smaller[0]), smaller[0], solved.best.converged))
                if smaller[1] > NEARLY:
                    return

    @cached_property
    def easier(self) -> ExcitationProblem:
        """The problem by a criterion that is easy to climb."""
        easy = isinstance(self.problem.criterion, (DOptimal, Balanced))
        return self.problem if easy else self.problem.judged_by(Balanced())

    def _up_to(self, steps: int) -> NlpSettings:
        return dataclasses.replace(self.settings, max_iterations=min(steps, self.settings.max_iterations))

    def _program(self, problem: ExcitationProblem, watched: list[Watched], settings: NlpSettings) -> Program:
        return Program(self.solver.count(Evaluation(problem, watched)), settings)

    def _solve(self, program: Program, number: int, x: Array) -> Solved:
        """Nothing better than the start once it is over."""
        if self.solver.over:
            return Solved(Found(np.inf, x, False), NlpStatus.STOPPED, 0, 0.0)
        return self.solver.solve(program, number, x)

    def _report(self, first: float, solved: Solved) -> None:
        if solved.iterations:
            self.reports.append(
                StartReport(
                    status=solved.status,
                    first=first,
                    objective=solved.best.objective,
                    iterations=solved.iterations,
                    seconds=solved.seconds,
                )
            )

    def _best_within_limits(self, every: Evaluation) -> tuple[Found, float]:
        """Of all that was found, made smaller where needed, the best that passes the check; in the end the safe one."""
        best, shrink = Found(np.inf, self.found[0].variables, False), 0.0
        for one in sorted(self.found, key=lambda one: one.objective):
            if one.objective >= best.objective:
                break
            smaller = scaled_to_feasible(self.problem, one.variables)
            if smaller is not None and (value := every.objective(smaller[0])) < best.objective:
                best, shrink = Found(value, smaller[0], one.converged), smaller[1]
        return best, shrink

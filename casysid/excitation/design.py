"""Designing the motion: several starts, IPOPT from each, the best one checked on a fine grid."""

from __future__ import annotations

import dataclasses
import enum
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation.blocks import Block, TorqueBlock
from casysid.excitation.feasible import TIGHTENING, Standing, find_standing, random_start, small_start
from casysid.excitation.problem import REFINEMENT, ExcitationProblem
from casysid.excitation.program import Evaluation, Program, default_settings
from casysid.excitation.series import ExcitationTrajectory
from casysid.excitation.verification import Verification, verify
from casysid.nlp import NlpIteration, NlpSettings, NlpStatus, solve_nlp

DRAWS = 12
"""Random motions looked at for each start; the best become starts."""
STRIDE = 2
"""The optimiser looks at joints' limits at every so many instants of the design grid."""
WATCHED = 0.4
"""The optimiser looks at the torque of joints where random motions take more than this share of the limit."""
REPAIRS = 3
"""How often the best motion is optimised again, with more instants where it went beyond limits."""
FEASIBLE = 1e-6
"""Largest violation, as a share of the limits and beyond the tightening, of what counts as keeping them."""
SHRINKING = 1.2
"""A motion beyond its limits is made smaller by so many times the share by which it is, until it passes the check."""


class DesignStatus(enum.Enum):
    """How the design ended; the value is the sentence the user reads."""

    CONVERGED = "converged to the requested tolerance"
    UNFINISHED = "stopped before the tolerance was reached; the best motion found that keeps all limits is returned"
    INTERRUPTED = "interrupted; the best motion found until then that keeps all limits is returned"


@dataclass(frozen=True, kw_only=True)
class DesignStep:
    """One iteration, as a progress function sees it.

    Attributes:
        start: Number of the start, from 1; one more than ``starts`` while the best is repaired.
        starts: How many.
        step: Iteration from this start.
        objective: The criterion there.
        infeasibility: Largest violation, as a share of the limits.
        best: Least criterion of all motions so far that keep the limits of the design grid.
        seconds: Since the design began.
    """

    start: int
    starts: int
    step: int
    objective: float
    infeasibility: float
    best: float
    seconds: float


Progress = Callable[[DesignStep], bool | None]
"""Called at every iteration; an answer that is true stops the design, which then returns the best so far."""


@dataclass(frozen=True, kw_only=True)
class StartReport:
    """What came of one start.

    Attributes:
        status: Why IPOPT stopped.
        first: Criterion at the start.
        objective: At the end; inf if no motion that keeps the limits came of it.
        iterations: How many.
        seconds: Wall time.
    """

    status: NlpStatus
    first: float
    objective: float
    iterations: int
    seconds: float


@dataclass(frozen=True, eq=False, kw_only=True)
class ExcitationDesign:
    """A motion that keeps all limits, and what it tells. Checks itself.

    Attributes:
        problem: What was asked.
        trajectory: The answer.
        status: How the design ended.
        starts: What came of each start; repairs of the best one come last.
        evaluations: How often objective, gradient, constraints and Jacobian were evaluated.
        seconds: Wall time.
        shrink: Factor by which the optimiser's motion was made smaller so that it passes the check; 1 for none.
    """

    problem: ExcitationProblem
    trajectory: ExcitationTrajectory
    status: DesignStatus
    starts: tuple[StartReport, ...]
    evaluations: dict[str, int]
    seconds: float
    shrink: float

    @cached_property
    def gained(self) -> Array:
        """Information of all periods, without what was known, shape (r, r), scaled; by quadrature on the fine grid."""
        return frozen(self.problem.gained(self.trajectory, REFINEMENT))

    @cached_property
    def information(self) -> Array:
        """With what was known, shape (r, r), scaled."""
        return frozen(self.problem.known + self.gained)

    @property
    def log_det(self) -> float:
        """Of the information; -inf if it is singular."""
        sign, value = np.linalg.slogdet(self.information)
        return float(value) if sign > 0.0 else -np.inf

    @property
    def condition_number(self) -> float:
        """Of the information in its scaled units: the square of the regressor's."""
        values = np.linalg.eigvalsh(self.information)
        return float(values[-1] / values[0]) if values[0] > 0.0 else np.inf

    def check(self, samples: int | None = None) -> Verification:
        """All limits at so many instants of a period; None is ten times those of the design grid."""
        return verify(self.problem, self.trajectory, samples)


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

    The first start is a small motion about the middle of the limits, which is feasible for certain; the others are the
    best of many random motions.

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
    return _Design(problem, starts, seed, settings, progress).run()


def design_set(
    problem: ExcitationProblem, count: int, *, starts: int = 4, seed: int = 0, progress: Progress | None = None
) -> tuple[ExcitationDesign, ...]:
    """Several motions that complement each other: each is designed knowing what those before it tell.

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
        problem = problem.knowing(design.gained)
    return tuple(designs)


class _Design:
    """One run: what was found so far, so that it can end at any time."""

    def __init__(
        self,
        problem: ExcitationProblem,
        starts: int,
        seed: int,
        settings: NlpSettings,
        progress: Progress | None,
    ) -> None:
        self.problem, self.starts, self.seed, self.settings = problem, starts, seed, settings
        self.progress, self.began, self.stopped = progress, time.perf_counter(), False
        self.reports: list[StartReport] = []
        self.evaluations: list[Evaluation] = []
        self.found: list[tuple[float, Array]] = []  # the best of each start that keeps the limits of its grid

    def run(self) -> ExcitationDesign:
        standing = find_standing(self.problem, self.seed)
        safe = small_start(self.problem, standing, self.seed)
        every = self._evaluation(self.problem.blocks)
        self.found.append((every.objective(safe), safe))
        try:
            finished = self._search(standing, safe, every)
            status = DesignStatus.CONVERGED if finished else DesignStatus.UNFINISHED
        except KeyboardInterrupt:
            status = DesignStatus.INTERRUPTED
        if self.stopped:
            status = DesignStatus.INTERRUPTED
        trajectory, shrink = self._best_within_limits(every)
        return ExcitationDesign(
            problem=self.problem,
            trajectory=trajectory,
            status=status,
            starts=tuple(self.reports),
            evaluations={name: sum(one.counts[name] for one in self.evaluations) for name in every.counts},
            seconds=time.perf_counter() - self.began,
            shrink=shrink,
        )

    def _search(self, standing: Standing, safe: Array, every: Evaluation) -> bool:
        """Every start, then the best again where it goes beyond limits between instants; whether that converged."""
        drawn = self._draw(standing, every) if self.starts > 1 else []
        blocks = self._watched([safe, *drawn])
        program = Program(self._evaluation(blocks, STRIDE), self.settings)
        converged = [self._solve(program, k + 1, x) for k, x in enumerate([safe, *drawn[: self.starts - 1]])]
        finished = any(converged)
        extra = np.empty(0)
        for _ in range(REPAIRS):
            objective, x = min(self.found, key=lambda one: one[0])
            checked = verify(self.problem, self.problem.trajectory(x))
            if self._over() or checked.passed:
                break
            extra = np.append(extra, _instants(self.problem, checked))
            blocks = self._watched([safe, *drawn], checked)
            self.found = [one for one in self.found if one[1] is not x]
            fallback = _shrunk(self.problem, x, 0.9)
            if fallback is not None:
                self.found.append((every.objective(fallback[0]), fallback[0]))
            program = Program(
                self._evaluation(blocks, STRIDE, extra), dataclasses.replace(self.settings, barrier=1e-3, max_iterations=60)
            )
            self._solve(program, self.starts + 1, x)
        return finished and not self._over()

    def _evaluation(self, blocks: Sequence[Block], stride: int = 1, extra: Array | None = None) -> Evaluation:
        self.evaluations.append(Evaluation(self.problem, blocks, stride, extra))
        return self.evaluations[-1]

    def _draw(self, standing: Standing, every: Evaluation) -> list[Array]:
        """Random motions, best first."""
        rng = np.random.default_rng(self.seed)
        drawn = [random_start(self.problem, every, standing, rng) for _ in range(DRAWS * (self.starts - 1))]
        feasible = [x for x in drawn if x is not None]
        values = [every.objective(x) for x in feasible]
        self.found += [(values[k], feasible[k]) for k in np.argsort(values)[:1]]
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

    def _solve(self, program: Program, number: int, x: Array) -> bool:
        """Whether IPOPT converged; the best motion on its way that keeps the limits is remembered."""
        if self._over():
            return False
        best: tuple[float, Array] = np.inf, x

        def tell(iteration: NlpIteration) -> bool:
            nonlocal best
            if iteration.infeasibility <= FEASIBLE and iteration.objective < best[0]:
                best = iteration.objective, iteration.variables
            self.stopped = self.stopped or self._tell(number, iteration, best[0])
            return self._over()

        start_lower, start_upper = _bounds(self.problem)
        lower, upper = program.evaluation.bounds(TIGHTENING)
        first = program.evaluation.objective(x)
        try:
            solution = solve_nlp(
                program.nlp,
                x,
                lower=start_lower,
                upper=start_upper,
                constraint_lower=lower,
                constraint_upper=upper,
                progress=tell,
            )
            if solution.infeasibility <= FEASIBLE and solution.objective < best[0]:
                best = solution.objective, solution.variables
        finally:
            if np.isfinite(best[0]):
                self.found.append(best)
        self.reports.append(
            StartReport(
                status=solution.status,
                first=first,
                objective=best[0],
                iterations=solution.iterations,
                seconds=solution.seconds,
            )
        )
        return solution.success

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
            best=min(best, *(objective for objective, _ in self.found)),
            seconds=time.perf_counter() - self.began,
        )
        return bool(self.progress(step))

    def _best_within_limits(self, every: Evaluation) -> tuple[ExcitationTrajectory, float]:
        """Of all that was found, made smaller where needed, the best that passes the check; in the end the safe one."""
        best: tuple[float, Array, float] = np.inf, self.found[0][1], 0.0
        for objective, x in sorted(self.found, key=lambda one: one[0]):
            if objective >= best[0]:
                break
            smaller = _shrunk(self.problem, x)
            if smaller is not None and (value := every.objective(smaller[0])) < best[0]:
                best = value, *smaller
        return self.problem.trajectory(best[1]), best[2]


def _shrunk(problem: ExcitationProblem, x: Array, least: float = 0.5) -> tuple[Array, float] | None:
    """The motion, made smaller about its own middle until it passes the check, and by what factor; None if it never does."""
    n = len(problem.robot.dofs)
    values = x.reshape(n, -1)
    anchor = np.zeros_like(values)
    anchor[:, 0] = values[:, 0]
    if problem.start is None:
        position = problem.trajectory(x).motion(problem.series.grid(problem.samples)).position
        anchor[:, 0] = (position.max(axis=0) + position.min(axis=0)) / 2.0 / problem.limits.half_range
    factor = 1.0
    while factor >= least:
        smaller = (anchor + factor * (values - anchor)).ravel()
        checked = verify(problem, problem.trajectory(smaller))
        if checked.passed:
            return smaller, factor
        factor *= 1.0 - min(SHRINKING * -checked.violations[0].share + 5e-4, 0.2)
    return None


def _instants(problem: ExcitationProblem, checked: Verification) -> Array:
    """Where limits are violated, and just before and after."""
    step = problem.series.period / (4 * problem.samples)
    worst = np.array([one.instant for one in checked.violations])
    return np.unique(np.concatenate([worst - step, worst, worst + step]) % problem.series.period)


def _bounds(problem: ExcitationProblem) -> tuple[Array, Array]:
    """Bounds of the variables: a start that was given stays, everything else is free."""
    width = 1 + problem.series.size
    lower, upper = (np.full(len(problem.limits.lower) * width, side) for side in (-np.inf, np.inf))
    if problem.start is not None:
        lower[::width] = upper[::width] = problem.start / problem.limits.half_range
    return lower, upper

"""Inverse kinematics: by restarted descents, or by IPOPT where more than the joints' limits is to be kept."""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterator, Sequence
from itertools import islice

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.excitation import Capsule
from casysid.excitation.constraints.obstacles import Obstacle
from casysid.kinematics import Kinematics
from casysid.kinematics.checks import checked_states
from casysid.reaching.constrained import ConstrainedProblem
from casysid.reaching.guard import Guard
from casysid.reaching.iterative import Descent, descend, is_there
from casysid.reaching.problem import Problem
from casysid.reaching.results import Reach, ReachSettings, ReachStatus
from casysid.reaching.targets import Target
from casysid.robot import Robot
from casysid.robot.coordinates import channels_from_configuration
from casysid.threads import single_threaded

CLEAR_STARTS = 12
"""Of IPOPT, at most: effort."""
SLACK = 1e-6
"""A distance that is short by less [m] is kept: tolerance."""
PATIENCE = 10
"""Times the steps of a start, for the nearest of all that do not arrive: effort."""
NEAREST = 8
"""Of these, which are followed to where nothing gets nearer: effort."""


class InverseKinematics:
    """Postures of one robot in which frames reach their targets. Not to be shared by threads.

    Attributes:
        kinematics: Of the robot.
        settings: How postures are looked for.
    """

    def __init__(self, robot: Robot | Kinematics, settings: ReachSettings | None = None) -> None:
        """Expressions are made with the first targets of a form, and serve all others of it."""
        self.kinematics = robot if isinstance(robot, Kinematics) else Kinematics(robot)
        self.settings = settings or ReachSettings()
        self._problems: dict[tuple[object, ...], Problem] = {}
        self._guards: dict[tuple[Hashable, ...], Guard] = {}
        self._constraineds: dict[tuple[Hashable, ...], ConstrainedProblem] = {}

    @single_threaded()
    def reach(self, *targets: Target, start: npt.ArrayLike | None = None) -> Reach:
        """A posture within the joints' limits that reaches all targets, or comes nearest to them.

        Args:
            targets: All at once.
            start: Configuration (nq,) to start from; the answer is near it where one is. None starts from postures in
                which the frames are near their targets already.

        Raises:
            ParameterError: No targets, no such frame, or a start that is no configuration.
        """
        began, problem = time.perf_counter(), self._problem(targets)
        ends: list[Descent] = []
        for q in islice(self._starts(problem, start), self.settings.starts):
            ends.append(self._descend(problem, q))
            if ends[-1].is_there:
                break
        tried, best = len(ends), ends[-1]
        if not best.is_there:
            most = PATIENCE * self.settings.steps
            near = sorted(ends, key=lambda end: end.at.cost)[:NEAREST]
            ends += [descend(problem, end.q, self.settings.tolerance, most, patient=True) for end in near]
            best = min(ends, key=lambda end: end.at.cost)
        steps = sum(end.steps for end in ends)
        status = ReachStatus.REACHED if best.is_there else ReachStatus.NEAREST
        return self._reach(best, status, tried, steps, time.perf_counter() - began)

    def reach_path(self, targets: Sequence[Sequence[Target]], *, start: npt.ArrayLike | None = None) -> list[Reach]:
        """One posture after another, each started from the last, so that they follow each other as a motion.

        Args:
            targets: For every point of the path, all targets at once.
            start: As for :meth:`reach`, of the first.

        Raises:
            ParameterError: As :meth:`reach`.
        """
        found: list[Reach] = []
        for one in targets:
            found.append(self.reach(*one, start=found[-1].configuration if found else start))
        return found

    @single_threaded()
    def reach_clear(
        self,
        *targets: Target,
        start: npt.ArrayLike | None = None,
        rest: npt.ArrayLike | None = None,
        obstacles: Sequence[Obstacle] = (),
        capsules: Sequence[Capsule] | None = None,
        margin: float = 0.01,
    ) -> Reach:
        """A posture that reaches all targets, clear of links and obstacles, and near a posture to rest in.

        Args:
            targets: All at once.
            start: As for :meth:`reach`.
            rest: Configuration (nq,): of the postures that reach the targets, one near it; None is the start, or the
                joints at zero.
            obstacles: Around the robot.
            capsules: Around its links; None takes them from the file's geometry, or makes them up between joints. An
                empty sequence looks at no distances.
            margin: Distance to keep [m].

        Raises:
            ParameterError: As :meth:`reach`; the margin is negative, or distances are asked for where joints have
                several degrees of freedom.
        """
        began, problem = time.perf_counter(), self._problem(targets)
        guard, within = self._constrained(
            problem, tuple(obstacles), None if capsules is None else tuple(capsules), margin
        )
        given = None if start is None else self._one("start", start)
        middle = problem.limits.middle() if given is None else given
        home = middle if rest is None else problem.limits.clamp(self._one("rest", rest))
        best: tuple[tuple[bool, bool, float], Descent] | None = None
        tried = steps = 0
        for q in islice(self._clear_starts(problem, home if given is None else given), CLEAR_STARTS):
            attempt = within.solve(q, home, margin + SLACK)
            tried, steps, at = tried + 1, steps + attempt.steps, problem.at(attempt.q)
            closer = self._descend(problem, attempt.q)
            for found in (Descent(attempt.q, at, 0, is_there(at, self.settings.tolerance)), closer):
                rank = (guard.least(found.q)[0] < margin - SLACK, not found.is_there, found.at.cost)
                best = (rank, found) if best is None or rank < best[0] else best
            if best is not None and best[1].is_there and not best[0][0]:
                break
        assert best is not None  # there is at least one start
        (is_blocked, _, _), answer = best
        status = ReachStatus.REACHED if answer.is_there else ReachStatus.NEAREST
        status = ReachStatus.IN_THE_WAY if is_blocked else status
        return self._reach(answer, status, tried, steps, time.perf_counter() - began, guard.least(answer.q))

    def _problem(self, targets: Sequence[Target]) -> Problem:
        """The least-squares problem of these targets, aimed at them."""
        if not targets:
            raise ParameterError("targets: wanted at least one; got none")
        key = tuple(target.form for target in targets)
        if key not in self._problems:
            self._problems[key] = Problem(self.kinematics, targets)
        self._problems[key].aim(targets)
        return self._problems[key]

    def _constrained(
        self, problem: Problem, obstacles: tuple[Obstacle, ...], capsules: tuple[Capsule, ...] | None, margin: float
    ) -> tuple[Guard, ConstrainedProblem]:
        """What is kept at a distance, and the problem that keeps it; made once for the same."""
        key = (obstacles, capsules, margin)
        if key not in self._guards:
            self._guards[key] = Guard(self.kinematics.robot, obstacles, capsules, margin)
        if (problem, key) not in self._constraineds:
            self._constraineds[problem, key] = ConstrainedProblem(problem, self._guards[key].near)
        return self._guards[key], self._constraineds[problem, key]

    def _descend(self, problem: Problem, q: Array) -> Descent:
        return descend(problem, q, self.settings.tolerance, self.settings.steps, patient=False)

    def _starts(self, problem: Problem, start: npt.ArrayLike | None) -> Iterator[Array]:
        if start is not None:
            yield problem.limits.clamp(self._one("start", start))
        yield from problem.nearest_of_cloud()

    def _clear_starts(self, problem: Problem, home: Array) -> Iterator[Array]:
        """Where the targets are reached from home, home itself, where they are reached from elsewhere."""
        yield self._descend(problem, problem.limits.clamp(home)).q
        yield problem.limits.clamp(home)
        for q in problem.nearest_of_cloud():
            yield self._descend(problem, q).q

    def _one(self, name: str, configuration: npt.ArrayLike) -> Array:
        rows, single = checked_states(self.kinematics.robot, configuration)
        if not single:
            raise ParameterError(f"{name}: wanted one configuration ({self.kinematics.robot.nq},); got several")
        return np.asarray(rows[0][0])

    def _reach(
        self,
        best: Descent,
        status: ReachStatus,
        starts: int,
        steps: int,
        seconds: float,
        least: tuple[float, str] = (np.inf, ""),
    ) -> Reach:
        return Reach(
            status=status,
            configuration=best.q,
            position=channels_from_configuration(self.kinematics.robot, best.q[None])[0],
            distance=best.at.lengths[:, 0],
            angle=best.at.lengths[:, 1],
            clearance=least[0],
            nearest=least[1],
            starts=starts,
            steps=steps,
            seconds=seconds,
        )

"""Quasi-Newton acceleration of EM, the bound being the safeguard.

Every iteration of EM raises its bound, by less and less. Limited-memory BFGS (Nocedal and Wright 2006, §7.2) learns the
curvature that makes it slow (Jamshidian and Jennrich 1997, *J. R. Statist. Soc. B* 59). A quasi-Newton step is taken
only if the bound grows; where it would not, EM's own step is, which cannot lower it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from casysid.arrays import Array

MEMORY = 8
"""Steps from which the curvature is learnt."""
CYCLE = 10
"""Iterations over which the gain of the bound is judged."""
SUFFICIENT = 1e-4
"""Least share of the gain promised by the gradient (Armijo)."""
LENGTHS = (1.0, 0.2, 0.04, 0.008, 0.0016)
"""Of the quasi-Newton step, tried in this order."""


class Point(Protocol):
    """The bound at one vector, and what is needed to climb on."""

    @property
    def vector(self) -> Array:
        """Where this is."""
        ...

    @property
    def bound(self) -> float:
        """``-inf`` where the vector is not admissible."""
        ...

    @property
    def rounding(self) -> float:
        """How far the bound can be off for rounding."""
        ...

    @property
    def gradient(self) -> Array:
        """Of the bound."""
        ...

    def metric(self) -> Callable[[Array], Array]:
        """The approximate inverse of the bound's negative Hessian, as a function of a vector."""
        ...

    def em_step(self) -> Array:
        """The vector after one EM iteration."""
        ...


@dataclass(frozen=True, eq=False)
class Ascent:
    """Where the climb ended.

    Attributes:
        vector: The last vector.
        bounds: The bound at the start and after every iteration; it never falls.
        evaluations: How often the bound was computed.
        em_steps: Iterations that were EM's.
        converged: Whether the bound had come to rest; if not, iterations ran out or no step raises it although the
            gradient promises more than rounding can hide.
    """

    vector: Array
    bounds: tuple[float, ...]
    evaluations: int
    em_steps: int
    converged: bool


def ascend(
    evaluate: Callable[[Array], Point],
    start: Array,
    limits: tuple[Array, Array],
    *,
    tolerance: float,
    max_iterations: int,
    metric_age: int,
) -> Ascent:
    """Climb until the bound's relative gain over a cycle of iterations is below ``tolerance``.

    Args:
        evaluate: The bound and its surroundings at a vector.
        start: First vector.
        limits: Lowest and highest admissible vector.
        tolerance: Relative gain of the bound over a cycle.
        max_iterations: Iterations at most.
        metric_age: Iterations for which a metric is kept.
    """
    climber = _Climber(evaluate, evaluate(start), limits, metric_age)
    while len(climber.bounds) <= max_iterations:
        if not (climber.quasi_newton_step() or climber.quasi_newton_step() or climber.em_step()):
            return climber.ended(converged=climber.promises_no_more_than(tolerance))
        recent = climber.bounds[-CYCLE - 1 :]
        if len(recent) > CYCLE and recent[-1] - recent[0] <= tolerance * abs(recent[-1]):
            return climber.ended(converged=True)
    return climber.ended(converged=False)


class _Climber:
    """The state of one climb."""

    def __init__(
        self, evaluate: Callable[[Array], Point], point: Point, limits: tuple[Array, Array], metric_age: int
    ) -> None:
        self.bounds = [point.bound]
        self._evaluate, self._point, self._limits, self._metric_age = evaluate, point, limits, metric_age
        self._evaluations, self._em_steps, self._promise = 1, 0, np.inf
        self._forget()

    def ended(self, *, converged: bool) -> Ascent:
        """The result."""
        return Ascent(self._point.vector, tuple(self.bounds), self._evaluations, self._em_steps, converged)

    def promises_no_more_than(self, tolerance: float) -> bool:
        """Whether the gradient along the last direction promises less than ``tolerance`` (relative), or rounding."""
        return abs(self._promise) <= max(tolerance * abs(self.bounds[-1]), self._point.rounding)

    def em_step(self) -> bool:
        """EM's step, after which nothing learnt holds; False if it does not raise the bound."""
        self._forget()
        self._em_steps += 1
        self._evaluations += 1
        trial = self._evaluate(np.clip(self._point.em_step(), *self._limits))
        if trial.bound > self._point.bound:
            self._move_to(trial)
            return True
        return False

    def quasi_newton_step(self) -> bool:
        """A step that raises the bound by enough; False, and nothing learnt is kept, if there is none."""
        x, direction = self._point.vector, self._direction()
        lowest, highest = self._limits
        direction[((x <= lowest) & (direction < 0.0)) | ((x >= highest) & (direction > 0.0))] = 0.0
        self._promise = slope = float(self._point.gradient @ direction)
        for length in LENGTHS if 0.0 < slope < np.inf else ():
            with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
                trial = self._evaluate(np.clip(x + length * direction, lowest, highest))
                self._evaluations += 1
                enough = trial.bound >= self._point.bound + SUFFICIENT * length * slope
            if enough:
                self._learn(trial.vector - x, self._point.gradient - trial.gradient)
                self._move_to(trial)
                return True
        self._forget()
        return False

    def _move_to(self, point: Point) -> None:
        self._point = point
        self.bounds.append(point.bound)

    def _forget(self) -> None:
        self._pairs: deque[tuple[Array, Array, float]] = deque(maxlen=MEMORY)
        self._age = self._metric_age

    def _learn(self, step: Array, change: Array) -> None:
        """Take in a step and by how much the gradient fell along it."""
        product = float(step @ change)
        if product > 1e-10 * np.sqrt(float(step @ step) * float(change @ change)):
            self._pairs.append((step, change, 1.0 / product))

    def _direction(self) -> Array:
        """Nocedal and Wright, Algorithm 7.4, the metric in place of a multiple of the unit matrix."""
        if self._age >= self._metric_age:
            self._metric, self._age = self._point.metric(), 0
        self._age += 1
        q, shares = self._point.gradient.copy(), []
        for step, change, rho in reversed(self._pairs):
            shares.append(rho * float(step @ q))
            q -= shares[-1] * change
        q = self._metric(q)
        for (step, change, rho), share in zip(self._pairs, reversed(shares), strict=True):
            q += step * (share - rho * float(change @ q))
        return q

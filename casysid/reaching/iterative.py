"""Damped least squares: from one configuration to the nearest minimum of the distance to the targets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from casysid.arrays import Array
from casysid.reaching.problem import Normal, Problem

FLOOR = 1e-12
"""Damping that is always there, as a share of the largest diagonal entry: rounding."""
HARDER = 8.0
"""Times the damping when a step fails: effort."""
STALE = 8
"""Steps that must bring what is left below :data:`PROGRESS` of before: effort."""
PROGRESS = 0.9
STILL = 1e-9
"""A step of all joints below this, [rad] or [m], is none: tolerance."""


class Descent(NamedTuple):
    """Where a descent ended."""

    q: Array
    at: Normal
    steps: int
    is_there: bool


def descend(problem: Problem, start: Array, tolerance: tuple[float, float], most: int, *, patient: bool) -> Descent:
    """Levenberg-Marquardt from a configuration (nq,) within the limits.

    The damping is the squared error itself, "error damping" of Sugihara, "Solvability-unconcerned inverse kinematics
    by the Levenberg-Marquardt method", IEEE Transactions on Robotics 27 (2011), Eq. (20): far away steps are short and
    safe in any singularity, near a target they become Newton's. A step that does not lead nearer is tried again with
    more damping, so that unreachable targets end at the nearest pose. Joints that are pushed against their limits are
    held.

    Args:
        problem: Aimed at the targets.
        start: Within the limits.
        tolerance: Linear [m] and angular [rad] error of every target that count as reached.
        most: Steps.
        patient: Whether to go on as long as anything moves; else a descent that hardly gets nearer is given up.
    """
    q, here, factor = start, problem.at(start), 1.0
    before = [here.cost]
    for step in range(most):
        if is_there(here, tolerance):
            return Descent(q, here, step, True)
        if not patient and len(before) > STALE and here.cost > PROGRESS * before[-STALE - 1]:
            return Descent(q, here, step, False)
        free = ~problem.limits.held(q, here.descent)
        move = _damped(here, free, factor)
        ahead = problem.limits.step(q, move)
        there = problem.at(ahead)
        if there.cost < here.cost:
            q, here, factor = ahead, there, max(factor / HARDER, 1.0)
            before.append(here.cost)
        elif np.abs(move).max(initial=0.0) < STILL:
            return Descent(q, here, step, False)
        else:
            factor *= HARDER
    return Descent(q, here, most, is_there(here, tolerance))


def _damped(here: Normal, free: np.ndarray, factor: float) -> Array:
    """The step of the joints that are free."""
    H = here.hessian * np.outer(free, free)
    diagonal = np.einsum("ii->i", H)
    floor = FLOOR * max(float(diagonal.max(initial=0.0)), FLOOR)
    diagonal += np.where(free, factor * here.cost + floor, 1.0)
    _, move, failed = lapack.dposv(H, here.descent * free)
    return np.zeros(len(free)) if failed else move


def is_there(here: Normal, tolerance: tuple[float, float]) -> bool:
    """Whether every target is reached."""
    return bool((here.lengths <= tolerance).all())

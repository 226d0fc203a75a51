"""What to do with a motion that goes a little beyond its limits: how much smaller it keeps them."""

from __future__ import annotations

import numpy as np

from casysid.arrays import Array
from casysid.excitation.design.problem import BETWEEN, ExcitationProblem
from casysid.excitation.design.verification import verify

SHRINKING = 1.2
"""A motion beyond its limits is made smaller by so many times the share by which it is, until it passes the check."""


def scaled_to_feasible(problem: ExcitationProblem, x: Array, least: float = 0.5) -> tuple[Array, float] | None:
    """The motion, made smaller about its middle until it passes the check, and the factor; None if it never does."""
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
        room = min((one.share for one in checked.margins), default=np.inf) - BETWEEN
        if room >= 0.0:
            return smaller, factor
        factor *= 1.0 - min(SHRINKING * -room + 5e-4, 0.2)
    return None

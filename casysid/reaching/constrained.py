"""Inverse kinematics by IPOPT: limits, distances to links and obstacles, and a posture to stay near."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from casysid.arrays import Array
from casysid.excitation.constraints.clearance import Clearance
from casysid.kinematics.sampling import position_range
from casysid.nlp import NlpSettings, NonlinearProgram, build_nlp, solve_nlp
from casysid.reaching.distances import distances
from casysid.reaching.problem import Problem
from casysid.robot import JointKind

REST = (1e-3, 1e-6)
"""What half a joint's range away from the rest posture counts as, beside a squared metre: first to choose among
postures, then so little that a target is missed by micrometres for it, which a descent makes up for: tolerance."""
SETTINGS = NlpSettings(tolerance=1e-10, constraint_tolerance=1e-9, acceptable_tolerance=1e-9, max_iterations=200)
_UNITS = {
    JointKind.CONTINUOUS: slice(0, 2),
    JointKind.PLANAR: slice(2, 4),
    JointKind.SPHERICAL: slice(0, 4),
    JointKind.FREE_FLYER: slice(3, 7),
}


class Attempt(NamedTuple):
    """Where IPOPT stopped."""

    q: Array
    steps: int


class ConstrainedProblem:
    """The least-squares problem of some targets, within limits and at a distance from what a clearance looks at.

    Attributes:
        problem: Aimed at the targets.
        clearance: What is kept at a distance; None for nothing.
    """

    def __init__(self, problem: Problem, clearance: Clearance | None) -> None:
        """Nothing is built yet."""
        self.problem, self.clearance = problem, clearance if clearance is not None and len(clearance) else None
        self.robot = problem.kinematics.robot

    def solve(self, start: Array, rest: Array, margin: float) -> Attempt:
        """From a configuration (nq,), staying near the rest posture (nq,), at least ``margin`` [m] from everything."""
        lower, upper = self._bounds
        count = self._program.constraints - len(self._unit_norms)
        ones = np.ones(len(self._unit_norms))
        q, steps = start, 0
        for weight in REST:
            found = solve_nlp(
                self._program,
                q,
                parameters=np.concatenate([*self.problem.aimed, self._nearer_sign(rest, q), [weight]]),
                lower=lower,
                upper=upper,
                constraint_lower=np.concatenate([ones, np.full(count, margin)]),
                constraint_upper=np.concatenate([ones, np.full(count, np.inf)]),
            )
            q, steps = self._units_again(np.clip(found.variables, lower, upper)), steps + found.iterations
        return Attempt(q, steps)

    @cached_property
    def _program(self) -> NonlinearProgram:
        q, numbers, weights = self.problem.symbols
        rest, weight = ca.SX.sym("rest", self.robot.nq), ca.SX.sym("weight")
        squares = ca.vertcat(*(ca.vertcat(*residual.smooth) for residual in self.problem.residuals))
        stray = ca.sumsqr((q - rest) / self._scales.tolist())
        keep = [] if self.clearance is None else [distances(self.robot, q, self.clearance)]
        return build_nlp(
            q,
            ca.dot(weights**2, squares) + weight * stray,
            parameters=ca.vertcat(numbers, weights, rest, weight),
            constraints=ca.vertcat(*(ca.sumsqr(q[part]) for part in self._unit_norms), *keep),
            settings=SETTINGS,
        )

    @cached_property
    def _unit_norms(self) -> list[slice]:
        """Places in q of quaternions and of (cos, sin)."""
        found = []
        for joint in self.robot.joints:
            if joint.kind in _UNITS:
                part = _UNITS[joint.kind]
                found.append(slice(joint.q.start + part.start, joint.q.start + part.stop))
        return found

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        lower, upper = np.full(self.robot.nq, -np.inf), np.full(self.robot.nq, np.inf)
        in_q, in_v = self.problem.limits.places
        lower[in_q], upper[in_q] = (side[in_v] for side in self.problem.limits.bounds)
        return lower, upper

    @cached_property
    def _scales(self) -> Array:
        """Half the range of every position; one for what has none."""
        scales = np.ones(self.robot.nq)
        for joint in self.robot.joints:
            if joint.q.stop - joint.q.start == 1:
                low, high = position_range(self.robot, joint)
                scales[joint.q] = max((high - low) / 2.0, np.finfo(float).tiny)
        return scales

    def _nearer_sign(self, rest: Array, q: Array) -> Array:
        """The rest posture with the sign of its quaternions that is nearer to q."""
        nearer = np.array(rest)
        for part in self._unit_norms:
            if part.stop - part.start == 4 and nearer[part] @ q[part] < 0.0:
                nearer[part] *= -1.0
        return nearer

    def _units_again(self, q: Array) -> Array:
        for part in self._unit_norms:
            q[part] /= np.linalg.norm(q[part])
        return q

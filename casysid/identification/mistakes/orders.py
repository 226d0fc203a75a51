"""Orders of a log's columns, judged by bodies that are fitted to each.

What the file's own prediction, times a factor, proposes (:class:`OrderSearch`) is judged by the evidence of bodies near
the file's, and improved by turning signs.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from casysid.arrays import Array
from casysid.identification.mistakes.gravity import CLEAR_TURN, GravityChoice, GravityFit
from casysid.identification.mistakes.order import Assignment, OrderSearch, Predict, reordered
from casysid.identification.mistakes.samples import Samples
from casysid.robot import Joint, Robot

ROWS = 100
"""Samples by which proposed orders are compared."""
MOST_IMPROVED = 2
"""Orders whose signs are turned."""
WORTH = 1.0
"""Evidence [nats] that turning a sign must bring."""
MOST_TURNED = 3
"""Rounds over all joints at most."""


class OrderJudge:
    """Orders of the columns of joints with one degree of freedom."""

    def __init__(
        self, robot: Robot, joints: tuple[Joint, ...], samples: Samples, gravity: Array | None, predict: Predict
    ) -> None:
        """Nothing is searched yet.

        Args:
            robot: Its bodies are the prior.
            joints: That may be exchanged.
            samples: As read so far.
            gravity: In which the robot stands; None is the file's.
            predict: The file's torque for samples, shape (N, nv).
        """
        self._robot, self._joints, self._samples, self._gravity = robot, joints, samples, gravity
        self._few = samples.rows(np.unique(np.linspace(0, len(samples.tau) - 1, ROWS).astype(np.intp)))
        self._search = OrderSearch(joints, samples, predict)

    def as_logged(self) -> Assignment:
        """The order as logged, torques with the signs that the file explains better."""
        return self._search.turned()

    def fit(self, assignment: Assignment) -> GravityChoice:
        """Bodies for all samples read in an order."""
        return GravityFit(self._robot, reordered(self._samples, self._joints, assignment), self._gravity).file

    def best(self) -> Iterator[list[Assignment]]:
        """Other orders of torques alone, of positions alone, and of both together, those with the best bodies first."""
        for proposed, turned in zip(self._search.best(), ("torque", "position", "both"), strict=True):
            moved = sorted((one for one in proposed if not one.is_as_logged), key=self._cost)
            near = [one for one in moved[:MOST_IMPROVED] if self._cost(one) < self._cost(moved[0]) + CLEAR_TURN]
            yield sorted((self._with_signs(one, turned) for one in near), key=self._cost)

    def _cost(self, assignment: Assignment) -> float:
        return GravityFit(self._robot, reordered(self._few, self._joints, assignment), self._gravity).file.cost

    def _with_signs(self, assignment: Assignment, turned: str) -> Assignment:
        """With the signs that bodies want, turned one by one."""
        cost = self._cost(assignment)
        last, place = 0, 0
        while place - last < len(self._joints) and place < MOST_TURNED * len(self._joints):
            near = [_turned(assignment, place % len(self._joints), signs) for signs in _SIGNS[turned]]
            costs = [self._cost(one) for one in near]
            place += 1
            if min(costs) < cost - WORTH:
                assignment, cost, last = near[int(np.argmin(costs))], min(costs), place
        return assignment


_SIGNS: dict[str, Sequence[tuple[float, float]]] = {
    "torque": [(1.0, -1.0)],
    "position": [(-1.0, 1.0), (-1.0, -1.0)],
    "both": [(1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)],
}
"""Of position and torque, by which those of one joint are multiplied."""


def _turned(assignment: Assignment, joint: int, signs: tuple[float, float]) -> Assignment:
    position, torque = assignment.position_sign.copy(), assignment.torque_sign.copy()
    position[joint] *= signs[0]
    torque[joint] *= signs[1]
    return dataclasses.replace(assignment, position_sign=position, torque_sign=torque)

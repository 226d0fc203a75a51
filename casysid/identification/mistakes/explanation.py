"""How well the model file explains a log, as it is or read otherwise.

Every joint's torque is explained by what the file predicts for it, times a factor that is not negative, with friction,
armature and an offset beside it. That asks little of the file's masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from casysid.arrays import Array
from casysid.dynamics import Armature, Regressor, build_regressor
from casysid.identification.mistakes.bodies import friction_basis
from casysid.identification.mistakes.gravity import gravity_torque
from casysid.identification.mistakes.samples import BLOCKS, SHARPNESS, Samples
from casysid.robot import Robot

FEW_ROWS = 160
"""By which a reading is found to be hopeless."""
RESOLUTION = 1e-4
"""Of a joint's torque energy: smaller residues are alike."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """How well the file explains samples.

    Attributes:
        residue: Squared residuals by block and joint, shape (blocks, nv).
        factor: Of the file's prediction by joint, not negative, shape (nv,).
        floor: Below which squared residuals are alike, shape (nv,).
    """

    residue: Array
    factor: Array
    floor: Array

    @property
    def energy(self) -> Array:
        """Squared residuals by joint, shape (nv,)."""
        return np.asarray(self.residue.sum(axis=0))


class Witness:
    """What the model file says about samples of a log."""

    def __init__(self, robot: Robot, samples: Samples) -> None:
        """Nothing is computed yet.

        Args:
            robot: As its file has it.
            samples: As logged; their speeds set how sharply friction turns.
        """
        self._robot = robot
        self._regressor: Regressor = build_regressor(robot, friction=(Armature(),))
        self._blocks = np.array_split(np.arange(len(samples.tau)), BLOCKS)
        self._width = SHARPNESS * np.sqrt(np.mean(samples.v**2, axis=0)) + 1e-12

    def predict(self, samples: Samples, gravity: Array | None = None) -> Array:
        """The file's torque, shape (N, nv), in its own gravity or another."""
        q = samples.configuration(self._robot)
        own = self._regressor.predict(self._regressor.prior, q, samples.v, samples.a)
        return own if gravity is None else own + gravity_torque(self._robot, q, gravity - self._robot.gravity)

    def most_explained(self, readings: Sequence[Samples], gravity: Array | None = None) -> Array:
        """Least share of torque energy that any factor and any friction leave of some rows, shape (readings, nv).

        What :meth:`explain` leaves is no less but for the choice of rows; much cheaper. No reading may exchange joints.
        """
        rows = np.unique(np.linspace(0, len(readings[0].tau) - 1, FEW_ROWS).astype(np.intp))
        few = [one.rows(rows) for one in readings]
        position, v, a, torque = (np.concatenate(x) for x in zip(*(one.arrays for one in few), strict=True))
        stacked = Samples(position, v, a, torque, 0.0)
        predicted = self.predict(stacked, gravity).reshape(len(few), len(rows), -1)
        left = np.empty((len(few), self._robot.nv))
        for dof in range(self._robot.nv):
            basis = friction_basis(few[0].v[:, dof], few[0].a[:, dof], self._width[dof])
            tau, p = few[0].tau[:, dof], predicted[:, :, dof]
            p = p - (p @ basis) @ basis.T
            own = float(tau @ tau - np.sum((tau @ basis) ** 2))
            power = np.maximum(np.sum(p**2, axis=1), 1e-300)
            left[:, dof] = (own - (p @ tau) ** 2 / power) / max(float(np.sum((tau - tau.mean()) ** 2)), 1e-300)
        return np.maximum(left, 0.0)

    def explain(self, samples: Samples, gravity: Array | None = None, most: float | Array = np.inf) -> Explanation:
        """Every joint's torque by the file's prediction times a factor from 0 to ``most``, friction and an offset."""
        predicted, nv = self.predict(samples, gravity), self._robot.nv
        limit = np.broadcast_to(most, nv)
        residue, factor = np.empty((BLOCKS, nv)), np.empty(nv)
        for dof in range(nv):
            v = samples.v[:, dof]
            one = np.ones(len(v))
            x = np.column_stack([predicted[:, dof], v, np.tanh(v / self._width[dof]), samples.a[:, dof], one, -one])
            y = samples.tau[:, dof]
            coefficients = _not_negative(x, y)
            if coefficients[0] > limit[dof]:
                coefficients[0] = limit[dof]
                coefficients[1:] = _not_negative(x[:, 1:], y - limit[dof] * x[:, 0])
            factor[dof] = coefficients[0]
            squares = (y - x @ coefficients) ** 2
            residue[:, dof] = [squares[block].sum() for block in self._blocks]
        floor = RESOLUTION * np.sum((samples.tau - samples.tau.mean(axis=0)) ** 2, axis=0) + 1e-30
        return Explanation(residue, factor, floor)


def gain_of(before: Explanation, after: Explanation, joints: Array | None = None) -> tuple[float, float]:
    """Fall of the logarithms of residual energies, and the mean of that in blocks in standard errors."""
    chosen = np.ones(len(before.floor), dtype=bool) if joints is None else joints
    gain = np.log(before.energy + before.floor) - np.log(after.energy + after.floor)
    each = np.log(before.residue + before.floor / BLOCKS) - np.log(after.residue + after.floor / BLOCKS)
    fall = each[:, chosen].sum(axis=1)
    spread = float(fall.std(ddof=1)) / np.sqrt(len(fall))
    return float(gain[chosen].sum()), float(fall.mean()) / max(spread, 1e-12)


def share_explained(explanation: Explanation, samples: Samples, dofs: list[int]) -> float:
    """Of some joints' torque variance, mean."""
    tau = samples.tau[:, dofs]
    size = np.sum((tau - tau.mean(axis=0)) ** 2, axis=0)
    return float(np.mean(1.0 - explanation.energy[dofs] / np.maximum(size, 1e-30)))


def _not_negative(x: Array, y: Array) -> Array:
    """Least squares with coefficients that are not negative, shape (n,)."""
    scale = np.maximum(np.sqrt(np.mean(x**2, axis=0)), 1e-300)
    triangle: Array = np.asarray(np.linalg.qr(np.column_stack([x / scale, y]), mode="r"))
    coefficients, _ = nnls(triangle[:, :-1], triangle[:, -1])
    return np.asarray(coefficients / scale)

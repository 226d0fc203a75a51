"""How bodies near the file's explain a log: second moments of its samples, with the columns of gravity apart.

Torque is linear in the links' parameters, and for given parameters linear in gravity: ``tau = (Y₀(q, v, a) + Σ g_k
Y_k(q)) θ`` plus friction of every joint's own, which feeds no energy: viscous and Coulomb friction and armature are not
negative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.optimize import nnls

from casysid.arrays import Array
from casysid.identification.mistakes.samples import SHARPNESS, Samples
from casysid.robot import Robot

SMALLEST_REACH = 0.02
"""Of a link [m]."""
SILENT = 1e-12
"""Share of the largest torque's energy that a joint without any torque stays below: it says nothing of gravity."""
DEPENDENT = 1e-8
"""Of a column's size: what is left of it beside others is rounding."""


@dataclass(frozen=True, eq=False)
class BodyMoments:
    """Mean squares of each joint's rows ``[Y₀, Y_x, Y_y, Y_z, tau]``, 22 links + 1 columns.

    Attributes:
        squares: Beside the joint's own friction, armature and offset of any sign, shape (nv, 22 links + 1, ...).
        energy: Of the torques about their means, shape (nv,); one where a joint has none.
        friction: Of viscous and Coulomb friction and armature about their means, columns of unit size, (nv, 3, 3).
        shared: Of these with the rows, shape (nv, 3, 22 links + 1).
    """

    squares: Array
    energy: Array
    friction: Array
    shared: Array

    def left(self, combination: Array) -> Array:
        """Mean squares of a combination of the rows that friction of any sign leaves, shape (nv,)."""
        return np.maximum((self.squares @ combination) @ combination, 0.0)

    def left_by_brakes(self, combination: Array) -> Array:
        """The same where friction and armature are not negative, shape (nv,)."""
        left = self.left(combination)
        for joint, (square, shared) in enumerate(zip(self.friction, self.shared @ combination, strict=True)):
            values, vectors = np.linalg.eigh(square)
            kept = values > DEPENDENT
            if not kept.any():
                continue
            root = np.sqrt(values[kept])
            A, b = root[:, None] * vectors[:, kept].T, (vectors[:, kept].T @ shared) / root
            free = float(b @ b)
            left[joint] += max(float(nnls(A, b)[1]) ** 2, 0.0) if free > 0.0 else 0.0
        return np.asarray(left)


def body_moments(robot: Robot, samples: Samples) -> BodyMoments:
    """Of one pass over samples."""
    Y = np.concatenate([_columns(robot, samples), samples.tau[:, :, None]], axis=2)
    energy = np.var(samples.tau, axis=0)
    silent = energy <= SILENT * energy.max()
    width = SHARPNESS * np.sqrt(np.mean(samples.v**2, axis=0)) + 1e-12
    parts = []
    for j in range(robot.nv):
        X = np.zeros_like(Y[:, j]) if silent[j] else Y[:, j] - Y[:, j].mean(axis=0)
        v, a = samples.v[:, j], samples.a[:, j]
        basis = friction_basis(v, a, width[j])
        beside = X - basis @ (basis.T @ X)
        F = np.column_stack([v, np.tanh(v / width[j]), a])
        F = F - F.mean(axis=0)
        F /= np.maximum(np.sqrt(np.mean(F**2, axis=0)), 1e-300)
        parts.append([one / len(X) for one in (beside.T @ beside, F.T @ F, F.T @ X)])
    squares, friction, shared = (np.array(one) for one in zip(*parts, strict=True))
    return BodyMoments(squares, np.where(silent, 1.0, energy), friction, shared)


def friction_basis(v: Array, a: Array, width: float) -> Array:
    """Orthonormal columns that viscous and Coulomb friction, armature and an offset span, shape (N, up to 4)."""
    columns = np.column_stack([np.ones(len(v)), v, np.tanh(v / width), a])
    columns /= np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    Q, R = np.linalg.qr(columns)
    return np.asarray(Q[:, np.abs(np.diag(R)) > 1e-8 * np.sqrt(len(v))])


def _columns(robot: Robot, samples: Samples) -> Array:
    """``Y₀``, then for each unit of gravity its columns of mass and first moments, shape (N, nv, 22 links)."""
    q, links = samples.configuration(robot), len(robot.links)
    bodies = [k for k, joint in enumerate(robot.joints) if joint.link is not None]
    ten, four = (np.concatenate([10 * k + np.arange(n) for k in bodies]) for n in (10, 4))
    Y = np.empty((len(q), robot.nv, 22 * links))
    model, still = robot.model.copy(), np.zeros(robot.nv)
    data = model.createData()

    def rows(k: int, v: Array, a: Array) -> Array:
        return np.asarray(pin.computeJointTorqueRegressor(model, data, q[k], v, a)).reshape(robot.nv, -1)

    model.gravity.linear = np.zeros(3)
    for k in range(len(q)):
        Y[k, :, : 10 * links] = rows(k, samples.v[k], samples.a[k])[:, ten]
    for axis in range(3):
        model.gravity.linear = np.eye(3)[axis]
        place = 10 * links + 4 * links * axis
        for k in range(len(q)):
            Y[k, :, place : place + 4 * links] = rows(k, still, still)[:, four]
    return Y


def body_scales(robot: Robot) -> Array:
    """Masses, masses times reaches and their squares, shape (10 links,)."""
    bodies = robot.inertial_parameters.reshape(-1, 10)
    carrying = [k for k, joint in enumerate(robot.joints) if joint.link is not None]
    scales = np.empty_like(bodies)
    for row, (k, body) in enumerate(zip(carrying, bodies, strict=True)):
        mass = max(abs(float(body[0])), 1e-6)
        below = [float(np.linalg.norm(one.placement.translation)) for one in robot.joints if one.parent == k]
        reach = max(*below, min(float(np.linalg.norm(body[1:4])) / mass, 10.0), SMALLEST_REACH)
        scales[row, 0], scales[row, 1:4] = mass, mass * reach
        scales[row, 4:] = max(mass * reach**2, float(np.abs(body[4:]).max()))
    return scales.ravel()

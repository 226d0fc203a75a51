"""The gravity that a log itself asks for.

Torque is linear in the links' parameters, and for given parameters linear in gravity: ``tau = (Y₀(q, v, a) + Σ g_k
Y_k(q)) θ`` plus friction. Bodies are fitted together with gravity, the bodies near the file's by as much as files are
wrong, and three hypotheses are compared by their evidence: the file's gravity, none, and gravity of the usual size
along any direction. Directions that no torque tells, as about the axis of a plane robot, cost nothing and decide
nothing. All from second moments of one pass over some samples.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from casysid.arrays import Array
from casysid.identification.mistakes.bodies import body_moments, body_scales
from casysid.identification.mistakes.samples import Samples
from casysid.robot import Robot

EARTH = 9.81
"""[m/s²]."""
FILES_ARE_OFF = 0.5
"""Standard deviation of the file's masses, of its first moments in masses times reaches, of its inertias likewise."""
SIZES = (10.0, 100.0)
"""Multiples of that which the evidence may choose: placeholders are off by more."""
FLOOR = 0.01
"""Of a joint's torque: smaller residuals are alike."""
CLEAR_ABSENCE, CLEAR_TURN = 12.0, 40.0
"""Evidence [nats] above which gravity is missed, or found elsewhere."""
SMALLEST_TURN = 10.0
"""[degrees]: smaller ones are what a base that is not level and a file's centres of mass make alike."""
STRAIGHT = 2.0
"""[degrees]: bases are mounted along an axis of theirs more often than so nearly."""
CREDIBLE = 9.0
"""Mean square deviation of the bodies from the file's, three standard deviations: a file further off is no witness."""
STEPS, LONGEST_STEP, SETTLED = 12, 5.0, 1e-3
"""Of Gauss-Newton: how many, how far [m/s²], and the change of the evidence that ends it."""


@dataclass(frozen=True, eq=False)
class GravityChoice:
    """A gravity with the bodies that go with it.

    Attributes:
        gravity: Shape (3,), [m/s²].
        cost: Negative logarithm of its evidence.
        unexplained: Residual energy over that of the torque, by joint, shape (nv,).
        information: The part of it that what the log tells of the bodies costs.
        strain: Mean square of what the log tells of the bodies' deviations, in standard deviations of files.
    """

    gravity: Array
    cost: float
    unexplained: Array
    information: float
    strain: float


class _Fit(NamedTuple):
    """Bodies (10 links,), mean square residuals by joint (nv,), cost, its part of information, and strain."""

    bodies: Array
    residue: Array
    cost: float
    information: float
    strain: float


class GravityFit:
    """Second moments of a log's samples, for bodies and any gravity."""

    def __init__(self, robot: Robot, samples: Samples, gravity: Array | None = None) -> None:
        """Takes the moments.

        Args:
            robot: Its file's bodies are the prior.
            samples: Of the log.
            gravity: In place of the file's.
        """
        self._links = len(robot.links)
        self._file = np.array(robot.gravity if gravity is None else gravity)
        self._size = float(np.linalg.norm(self._file)) or EARTH
        self._prior = robot.inertial_parameters
        self._four = np.concatenate([10 * k + np.arange(4) for k in range(self._links)])
        self._count = min(samples.independent, float(len(samples.tau)))
        self._moments = body_moments(robot, samples)
        self._squares, self._energy = self._moments.squares, self._moments.energy
        usual = FILES_ARE_OFF * body_scales(robot)
        self._scale = usual
        self.file = self._settled(self._file, usual)
        for size in SIZES:
            if self.file.strain > 1.0 and (other := self._settled(self._file, size * usual)).cost < self.file.cost:
                self.file, self._scale = other, size * usual

    def found(self) -> GravityChoice | None:
        """Another gravity for which the log clearly asks; None if there is none."""
        absent, turned = self._absent(), self._turned()
        if absent and not (turned and turned.cost < absent.cost - CLEAR_ABSENCE):
            return absent
        return turned

    def _absent(self) -> GravityChoice | None:
        """No gravity, if the file has one and the log has not."""
        if not self._file.any():
            return None
        absent = self._settled(np.zeros(3), self._scale)
        return absent if self.file.cost - absent.cost > CLEAR_ABSENCE else None

    def _turned(self) -> GravityChoice | None:
        """The best gravity of the usual size, from several directions, if it is clearly better than the file's.

        Nothing is searched where bodies of their own for every joint and direction would not be better by as much.
        """
        data = self._data_cost(self._free_residue())
        if self.file.cost - self.file.information - data < CLEAR_TURN:
            return None
        turned = self._straightened(min((self._descend(start) for start in self._starts()), key=lambda one: one.cost))
        small = self._file.any() and angle_between(turned.gravity, self._file) < SMALLEST_TURN
        unclear = self.file.cost - turned.cost < CLEAR_TURN or turned.strain > CREDIBLE
        return None if small or unclear else turned

    def _straightened(self, choice: GravityChoice) -> GravityChoice:
        """Along an axis of the base, where it is that but for errors."""
        axis = np.zeros(3)
        k = int(np.argmax(np.abs(choice.gravity)))
        axis[k] = np.copysign(self._size, choice.gravity[k])
        if angle_between(axis, choice.gravity) > STRAIGHT:
            return choice
        straight = self._settled(axis, self._scale)
        return straight if straight.cost - choice.cost < CLEAR_ABSENCE else choice

    def _starts(self) -> Iterator[Array]:
        if self._file.any():
            yield self._file
        for axis in (*np.eye(3), *-np.eye(3)):
            yield self._size * axis

    def _descend(self, gravity: Array) -> GravityChoice:
        """Gauss-Newton in bodies and direction."""
        variance, last = 0.05 * self._energy, np.inf
        for _ in range(STEPS):
            fit = self._fit(gravity, variance, self._scale)
            if abs(last - fit.cost) < SETTLED:
                break
            last, weights = fit.cost, self._count / variance
            variance = fit.residue + FLOOR**2 * self._energy
            gravity = self._moved(gravity, fit.bodies, weights)
        return self._settled(gravity, self._scale)

    def _moved(self, gravity: Array, bodies: Array, weights: Array) -> Array:
        """Gravity after one step along the sphere."""
        p = len(self._prior)
        H, slope, along = self._curvature(gravity, bodies, weights)
        step = along @ np.linalg.lstsq(H, slope, rcond=None)[0][p:]
        step *= min(1.0, LONGEST_STEP / max(float(np.linalg.norm(step)), 1e-12))
        moved = gravity + step
        return np.asarray(moved * self._size / np.linalg.norm(moved))

    def _curvature(self, gravity: Array, bodies: Array, weights: Array) -> tuple[Array, Array, Array]:
        """Of the cost along bodies and two directions on the sphere: Gauss-Newton's matrix, slope, directions."""
        p, T = len(self._prior), self._design(gravity)
        along = np.linalg.svd(gravity[None])[2][1:].T
        B = np.zeros((len(T), 3))
        for k in range(3):
            B[p + 4 * self._links * k + np.arange(4 * self._links), k] = bodies[self._four]
        X = np.hstack([T[:, :-1] * self._scale, B @ along])
        W = np.tensordot(weights, self._squares, 1)
        H, slope = X.T @ W @ X, X.T @ W @ (T @ np.append(-bodies, 1.0))
        H[np.arange(p), np.arange(p)] += 1.0
        slope[:p] -= (bodies - self._prior) / self._scale
        H[np.diag_indices_from(H)] *= 1.0 + 1e-9
        return H, slope, along

    def direction_error(self, choice: GravityChoice) -> float:
        """The larger standard error of gravity's direction, bodies being unknown as well [degrees]."""
        variance = (choice.unexplained + FLOOR**2) * self._energy
        fit = self._fit(choice.gravity, variance, self._scale)
        H, _, _ = self._curvature(choice.gravity, fit.bodies, self._count / variance)
        p = len(self._prior)
        told = H[p:, p:] - H[p:, :p] @ np.linalg.solve(H[:p, :p], H[:p, p:])
        least = max(float(np.linalg.eigvalsh(told)[0]), 1e-12)
        return float(np.degrees(1.0 / (np.sqrt(least) * self._size)))

    def _settled(self, gravity: Array, scale: Array, rounds: int = 5) -> GravityChoice:
        """The fit at one gravity, every joint's noise its own."""
        variance = 0.01 * self._energy
        for _ in range(rounds):
            fit = self._fit(gravity, variance, scale)
            variance = fit.residue + FLOOR**2 * self._energy
        braked = self._moments.left_by_brakes(self._design(gravity) @ np.append(-fit.bodies, 1.0))
        cost = fit.cost + self._data_cost(braked) - self._data_cost(fit.residue)
        return GravityChoice(np.asarray(gravity), cost, braked / self._energy, fit.information, fit.strain)

    def _fit(self, gravity: Array, variance: Array, scale: Array) -> _Fit:
        """Bodies at a gravity, given each joint's noise; sizes of the file's errors and of the noise are unknown."""
        T = self._design(gravity)
        W = np.tensordot(self._count / variance, self._squares, 1)
        M = T.T @ W @ T
        A = M[:-1, :-1] * np.outer(scale, scale)
        A[np.diag_indices_from(A)] += 1.0
        pull = scale * (M[:-1, -1] - M[:-1, :-1] @ self._prior)
        values, vectors = np.linalg.eigh(A)
        values = np.maximum(values, 1.0)
        x = vectors @ ((vectors.T @ pull) / values)
        bodies = self._prior + scale * x
        r = T @ np.append(-bodies, 1.0)
        residue = self._moments.left(r)
        told = max(float(np.sum(1.0 - 1.0 / values)), 1.0)
        strain, information = float(x @ x) / told, 0.5 * float(np.log(values).sum())
        cost = self._data_cost(residue) + 0.5 * told * float(np.log1p(strain)) + information
        return _Fit(bodies, residue, cost, information, strain)

    def _data_cost(self, residue: Array) -> float:
        """Of noise whose size is each joint's own."""
        return 0.5 * self._count * float(np.sum(np.log(residue / self._energy + FLOOR**2)))

    def _free_residue(self) -> Array:
        """Residuals if every joint and every direction of gravity had bodies of its own: none can be smaller."""
        smallest = np.empty(len(self._squares))
        for joint, square in enumerate(self._squares):
            xx, xy = square[:-1, :-1], square[:-1, -1]
            size = np.sqrt(np.maximum(np.diag(xx), 1e-300))
            values, vectors = np.linalg.eigh(xx / np.outer(size, size))
            along = (vectors.T @ (xy / size))[values > 1e-9 * values[-1]]
            smallest[joint] = max(square[-1, -1] - float(np.sum(along**2 / values[values > 1e-9 * values[-1]])), 0.0)
        return smallest

    def _design(self, gravity: Array) -> Array:
        """From bodies and the torque to columns of the squares, shape (22 links + 1, 10 links + 1)."""
        p, links = len(self._prior), self._links
        T = np.zeros((p + 12 * links + 1, p + 1))
        T[np.arange(p), np.arange(p)] = T[-1, -1] = 1.0
        for k in range(3):
            T[p + 4 * links * k + np.arange(4 * links), self._four] = gravity[k]
        return T


def angle_between(one: Array, other: Array) -> float:
    """[degrees]."""
    cosine = float(one @ other / (np.linalg.norm(one) * np.linalg.norm(other)))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def gravity_torque(robot: Robot, q: Array, gravity: Array) -> Array:
    """What holds the file's bodies in a gravity, shape (N, nv), for q of shape (N, nq)."""
    model = robot.model.copy()
    model.gravity.linear = np.asarray(gravity, dtype=np.float64)
    data = model.createData()
    return np.array([pin.computeGeneralizedGravity(model, data, one) for one in q]).reshape(len(q), robot.nv)

"""Rigid bodies' torques and their regressor, for all samples at once, without casysid's own code.

Newton and Euler's recursion in body coordinates (Featherstone 2008, ch. 5), as ``pin.rnea`` and
``pin.computeJointTorqueRegressor`` have it sample by sample; joints have one degree of freedom each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.robot import JointKind, Robot


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """Kinematics of a tree of bodies; ten inertial parameters each, in Pinocchio's order."""

    robot: Robot

    def regressor(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """``Y`` of shape (N, nv, 10 nv), of positions, velocities and accelerations of shape (N, nv)."""
        Y, bodies = np.zeros((*q.shape, 10 * q.shape[1])), []
        for j, joint in enumerate(self.robot.joints):
            body = _Body.after(bodies[joint.parent] if joint.parent >= 0 else _Body.world(self.robot, len(q)), joint)
            body.move(j, q[:, j], v[:, j], a[:, j])
            force, moment = body.wrench()
            for i, (turn, slide) in body.subspaces.items():
                Y[:, i, 10 * j : 10 * j + 10] = np.einsum("nk,nkp->np", turn, moment)
                Y[:, i, 10 * j : 10 * j + 10] += np.einsum("nk,nkp->np", slide, force)
            bodies.append(body)
        return Y

    def torque(self, parameters: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Torques of shape (N, nv)."""
        return self.regressor(q, v, a) @ parameters

    def gravity(self, parameters: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Torques that hold the bodies where they are, shape (N, nv)."""
        return self.torque(parameters, q, np.zeros_like(q), np.zeros_like(q))


class _Body:
    """One body's velocity and acceleration in its own frame, and there the axes of all joints before it."""

    def __init__(self, samples: int) -> None:
        self.omega, self.v, self.alpha, self.a = (np.zeros((samples, 3)) for _ in range(4))
        self.subspaces: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    @classmethod
    def world(cls, robot: Robot, samples: int) -> _Body:
        world = cls(samples)
        world.a = world.a - robot.gravity
        return world

    @classmethod
    def after(cls, parent: _Body, joint: object) -> _Body:
        body = cls(len(parent.omega))
        body.parent, body.joint = parent, joint
        return body

    def move(self, dof: int, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:
        """Across the joint, from the parent's frame to this one's."""
        parent, axis, place = self.parent, self.joint.axis, self.joint.placement
        slides = self.joint.kind is JointKind.PRISMATIC
        R = np.broadcast_to(place.rotation, (len(q), 3, 3)) if slides else place.rotation @ _rotations(axis, q)
        p = place.translation + (np.outer(q, place.rotation @ axis) if slides else np.zeros((len(q), 3)))

        def here(turn: np.ndarray, slide: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return np.einsum("nji,nj->ni", R, turn), np.einsum("nji,nj->ni", R, slide + np.cross(turn, p))

        turn, slide = (np.zeros(3), axis) if slides else (axis, np.zeros(3))
        self.omega, self.v = here(parent.omega, parent.v)
        self.omega, self.v = self.omega + np.outer(v, turn), self.v + np.outer(v, slide)
        self.alpha, self.a = here(parent.alpha, parent.a)
        self.alpha = self.alpha + np.outer(a, turn) + v[:, None] * np.cross(self.omega, turn)
        self.a = self.a + np.outer(a, slide) + v[:, None] * (np.cross(self.omega, slide) + np.cross(self.v, turn))
        self.subspaces = {i: here(*axes) for i, axes in parent.subspaces.items()}
        self.subspaces[dof] = np.broadcast_to(turn, (len(q), 3)), np.broadcast_to(slide, (len(q), 3))

    def wrench(self) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients of force and moment, ``I a + v ×* I v``, shape (N, 3, 10) each."""
        push, spin = _momentum(self.omega, self.v)
        force, moment = _momentum(self.alpha, self.a)
        return force + _cross(self.omega) @ push, moment + _cross(self.omega) @ spin + _cross(self.v) @ push


def _momentum(omega: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear and angular momentum of m, mc, I about the origin, shape (N, 3, 10) each."""
    linear, angular = np.zeros((len(v), 3, 10)), np.zeros((len(v), 3, 10))
    linear[:, :, 0], linear[:, :, 1:4], angular[:, :, 1:4] = v, _cross(omega), -_cross(v)
    for column, (i, j) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)), start=4):
        angular[:, i, column] = omega[:, j]
        angular[:, j, column] = omega[:, i]
    return linear, angular


def _cross(x: np.ndarray) -> np.ndarray:
    """Matrices of the cross product with (N, 3), shape (N, 3, 3)."""
    matrix = np.zeros((len(x), 3, 3))
    matrix[:, [2, 0, 1], [1, 2, 0]], matrix[:, [1, 2, 0], [2, 0, 1]] = x, -x
    return matrix


def _rotations(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """About a unit axis by angles (N,), shape (N, 3, 3) (Rodrigues)."""
    K = _cross(axis[None])[0]
    return np.eye(3) + np.sin(angle)[:, None, None] * K + (1.0 - np.cos(angle))[:, None, None] * (K @ K)

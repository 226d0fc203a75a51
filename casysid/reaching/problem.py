"""Several targets at once as one least-squares problem over the joints, evaluated at one configuration in one call."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from casysid.arrays import Array
from casysid.kinematics import Axes, Kinematics, Pose, random_configurations
from casysid.kinematics.symbolic import frame_jacobian, frame_pose
from casysid.reaching.limits import Limits
from casysid.reaching.targets import Residual, Target

CLOUD = 512
"""Random postures that restarts are taken from, those nearest to the targets first: effort."""


class Normal(NamedTuple):
    """At one configuration: what the solver needs, weights included."""

    cost: float
    """Sum of squared errors."""
    descent: Array
    """Minus half its gradient along the joints' velocities, shape (nv,)."""
    hessian: Array
    """``Jᵀ J``, shape (nv, nv)."""
    lengths: Array
    """Of every target's linear and angular error, without weights, shape (targets, 2)."""


class Problem:
    """Targets of one form, whatever their numbers. Not to be shared by threads.

    Attributes:
        kinematics: Of the robot.
        limits: Of its joints.
    """

    def __init__(self, kinematics: Kinematics, targets: Sequence[Target]) -> None:
        """Expressions are made here, once for all targets of this form."""
        self.kinematics, self.limits = kinematics, Limits(kinematics.robot)
        robot = kinematics.robot
        self._q, self._sizes = ca.SX.sym("q", robot.nq), [len(target.numbers) for target in targets]
        self._numbers = ca.SX.sym("numbers", sum(self._sizes))
        self._weights = ca.SX.sym("weights", 2 * len(targets))
        self._targets = tuple(targets)
        self._normal = self._build()
        self._buffer, self._run = self._normal.buffer()
        self._inputs = [np.zeros(self._normal.nnz_in(i)) for i in range(3)]
        self._outputs = [np.zeros(self._normal.nnz_out(i)) for i in range(4)]
        for i, values in enumerate(self._inputs):
            self._buffer.set_arg(i, values.data)
        for i, values in enumerate(self._outputs):
            self._buffer.set_res(i, values.data)

    @cached_property
    def residuals(self) -> list[Residual]:
        """Of every target, in the symbols of :attr:`symbols`."""
        robot, first, found = self.kinematics.robot, 0, []
        for target, size in zip(self._targets, self._sizes, strict=True):
            frame = self.kinematics.frame(target.frame)
            pose, jacobian = frame_pose(robot, frame, self._q), frame_jacobian(robot, frame, self._q, Axes.WORLD)
            found.append(target.residual(pose, jacobian, self._numbers[first : first + size]))
            first += size
        return found

    @property
    def symbols(self) -> tuple[Any, Any, Any]:
        """Configuration, the targets' numbers, their weights."""
        return self._q, self._numbers, self._weights

    def aim(self, targets: Sequence[Target]) -> None:
        """Take the numbers of these targets from here on."""
        self._aimed = tuple(targets)
        self._inputs[1][:] = np.concatenate([target.numbers for target in targets])
        self._inputs[2][:] = [x for target in targets for x in (target.weight, target.weight * target.radius)]

    @property
    def aimed(self) -> tuple[Array, Array]:
        """Numbers and weights of the targets aimed at."""
        return self._inputs[1].copy(), self._inputs[2].copy()

    def at(self, q: Array) -> Normal:
        """Cost, descent and Hessian at a configuration (nq,)."""
        self._inputs[0][:] = q
        self._run()
        cost, descent, hessian, lengths = self._outputs
        nv = len(descent)
        return Normal(float(cost[0]), descent.copy(), hessian.reshape(nv, nv).copy(), lengths.reshape(-1, 2).copy())

    def nearest_of_cloud(self) -> Array:
        """The cloud's configurations, those of the least cost first."""
        cost = np.zeros(CLOUD)
        for target, poses in zip(self._aimed, self._cloud_poses, strict=True):
            linear, angular = target.lengths(poses)
            cost += target.weight**2 * (linear**2 + (target.radius * angular) ** 2)
        return self._cloud[np.argsort(cost)]

    @cached_property
    def _cloud(self) -> Array:
        return random_configurations(self.kinematics.robot, np.random.default_rng(0), CLOUD)

    @cached_property
    def _cloud_poses(self) -> list[Pose]:
        return [self.kinematics.poses(target.frame, self._cloud) for target in self._targets]

    def _build(self) -> Any:
        weighted = [part.weighted(self._weights[2 * k : 2 * k + 2]) for k, part in enumerate(self.residuals)]
        e, J = (ca.vertcat(*parts) for parts in zip(*weighted, strict=True))
        lengths = ca.vertcat(*(part.lengths for part in self.residuals))
        outputs = [ca.sumsqr(e), J.T @ e, J.T @ J, lengths]
        return ca.Function("normal", list(self.symbols), [ca.densify(x) for x in outputs], {"cse": True})

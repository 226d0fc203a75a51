"""The joints' position limits on Pinocchio's configuration, and steps on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from casysid.arrays import Array
from casysid.robot import JointKind, Robot

_LIMITED = (JointKind.REVOLUTE, JointKind.PRISMATIC)


@dataclass(frozen=True, eq=False)
class Limits:
    """Where the joints may be. Only revolute and prismatic joints have limits.

    Attributes:
        robot: Whose.
    """

    robot: Robot

    @cached_property
    def places(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Places in q and in v of the joints that can have limits."""
        joints = [joint for joint in self.robot.joints if joint.kind in _LIMITED]
        q, v = ([part.start for part in parts] for parts in ([j.q for j in joints], [j.v for j in joints]))
        return np.array(q, dtype=np.intp), np.array(v, dtype=np.intp)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper limit of every velocity's own position, each (nv,); infinite where there is none."""
        lower, upper = np.full(self.robot.nv, -np.inf), np.full(self.robot.nv, np.inf)
        for joint in self.robot.joints:
            if joint.kind in _LIMITED:
                lower[joint.v], upper[joint.v] = (
                    limit[joint.channels] for limit in (self.robot.position_lower, self.robot.position_upper)
                )
        return lower, upper

    @cached_property
    def is_plain(self) -> bool:
        """Whether positions add."""
        return self.robot.nq == self.robot.nv

    def held(self, q: Array, push: Array) -> npt.NDArray[np.bool_]:
        """Which degrees of freedom (nv,) are at a limit and are pushed against it."""
        lower, upper = self.bounds
        at = np.zeros(self.robot.nv)
        in_q, in_v = self.places
        at[in_v] = q[in_q]
        return np.asarray(((at <= lower) & (push < 0.0)) | ((at >= upper) & (push > 0.0)))

    def step(self, q: Array, v: Array) -> Array:
        """The configuration after moving by v (nv,), clamped."""
        return self.clamp(q + v if self.is_plain else pin.integrate(self.robot.model, q, v))

    def clamp(self, q: Array) -> Array:
        """The nearest configuration within the limits."""
        if self.is_plain:
            return np.asarray(np.clip(q, *self.bounds))
        moved = np.array(q)
        in_q, in_v = self.places
        moved[in_q] = np.clip(q[in_q], self.bounds[0][in_v], self.bounds[1][in_v])
        return moved

    def middle(self) -> Array:
        """The neutral configuration, as near to it as limits allow."""
        return self.clamp(np.array(pin.neutral(self.robot.model)))

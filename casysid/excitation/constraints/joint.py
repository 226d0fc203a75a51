"""Bounds of a joint's position, velocity, acceleration or jerk."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.excitation.constraints.constraint import Constraint, Slopes
from casysid.excitation.motion.fourier import Motion
from casysid.robot import JointKind, Robot


@dataclass(frozen=True, eq=False)
class JointConstraint(Constraint):
    """Position, velocity, acceleration or jerk of joints, or a choice of them.

    Attributes:
        order: Of the derivative.
        joints: Which degrees of freedom, shape (m,).
    """

    order: int
    joints: npt.NDArray[np.intp]
    lower: Array
    upper: Array
    labels: tuple[str, ...]
    units: tuple[str, ...]
    n: int
    scale: Array = field(init=False)

    kinds: ClassVar[tuple[str, ...]] = ("position", "velocity", "acceleration", "jerk")

    def __post_init__(self) -> None:
        object.__setattr__(self, "scale", frozen((self.upper - self.lower) / 2.0))

    @property
    def kind(self) -> str:  # type: ignore[override]
        """By the order."""
        return self.kinds[self.order]

    def measure(self, motion: Motion) -> Array:
        """The joints' columns."""
        return np.asarray(motion[self.order][:, self.joints])

    def constrain(self, motion: Motion) -> Array:
        """The same in units of half the range."""
        return np.asarray(self.measure(motion) / self.scale)

    def slopes(self, motion: Motion) -> Slopes:
        """Constant."""
        rows = self.depends / self.scale[:, None]
        return {self.order: np.broadcast_to(rows, (len(motion.position), *rows.shape))}

    def of_joint(self, k: int) -> JointConstraint:
        """The same for the k-th of its joints alone."""
        one = slice(k, k + 1)
        return JointConstraint(
            self.order, self.joints[one], self.lower[one], self.upper[one], self.labels[one], self.units[one], self.n
        )

    @cached_property
    def depends(self) -> npt.NDArray[np.bool_]:
        """Each on its own joint."""
        return np.asarray(np.eye(self.n, dtype=np.bool_)[self.joints])


def joint_constraint(robot: Robot, order: int, lower: Array, upper: Array) -> JointConstraint | None:
    """Bounds of one derivative; None if no joint has any."""
    joints = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
    if not len(joints):
        return None
    per = ("", "/s", "/s²", "/s³")[order]
    lengths = [one.kind is JointKind.PRISMATIC for one in robot.joints]
    return JointConstraint(
        order,
        joints,
        frozen(lower[joints]),
        frozen(upper[joints]),
        tuple(f"joint '{robot.dofs[k]}'" for k in joints),
        tuple(("m" if lengths[k] else "rad") + per for k in joints),
        len(robot.dofs),
    )

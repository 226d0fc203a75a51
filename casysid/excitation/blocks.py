"""The constraints, each a block of bounded functions of the motion at one instant, with their derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.excitation.information import configuration
from casysid.excitation.mapped import Mapped
from casysid.excitation.series import Motion, state_of
from casysid.robot import JointKind, Robot

Slopes = dict[int, Array]
"""Derivatives with respect to position (0), velocity (1), acceleration (2) or jerk (3), each (N, m, n)."""


class Block(ABC):
    """``lower <= measure(motion) <= upper`` at every instant.

    Attributes:
        kind: Of quantity.
        labels: Of each of the m functions, for messages.
        units: Of each.
        lower: Shape (m,).
        upper: Shape (m,).
        scale: What a violation is large or small against, shape (m,).
        dense: Whether it can be violated and kept again within a short time.
    """

    kind: str
    labels: tuple[str, ...]
    units: tuple[str, ...]
    lower: Array
    upper: Array
    scale: Array
    dense: ClassVar[bool] = False

    @abstractmethod
    def measure(self, motion: Motion) -> Array:
        """Values at all instants, shape (N, m)."""

    @abstractmethod
    def constrain(self, motion: Motion) -> Array:
        """What an optimiser sees, in units of the scale, shape (N, k)."""

    @abstractmethod
    def slopes(self, motion: Motion) -> Slopes:
        """Derivatives of :meth:`constrain`."""

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of :meth:`constrain`, each (k,)."""
        return self.lower / self.scale, self.upper / self.scale

    @property
    @abstractmethod
    def depends(self) -> npt.NDArray[np.bool_]:
        """Which joints each function of :meth:`constrain` can depend on, shape (k, n)."""

    def slack(self, motion: Motion) -> Array:
        """How far the values stay within their bounds, shape (N, m); negative where they do not."""
        values = self.measure(motion)
        return np.minimum(values - self.lower, self.upper - values)


@dataclass(frozen=True, eq=False)
class JointBlock(Block):
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

    def of_joint(self, k: int) -> JointBlock:
        """The same for the k-th of its joints alone."""
        one = slice(k, k + 1)
        return JointBlock(
            self.order, self.joints[one], self.lower[one], self.upper[one], self.labels[one], self.units[one], self.n
        )

    @cached_property
    def depends(self) -> npt.NDArray[np.bool_]:
        """Each on its own joint."""
        return np.asarray(np.eye(self.n, dtype=np.bool_)[self.joints])


@dataclass(frozen=True, eq=False)
class TorqueBlock(Block):
    """Torque of the prior model at the joints that have a limit.

    Attributes:
        regressor: Gives the torque.
        parameters: Of the prior model, shape (p,).
        joints: Which degrees of freedom, shape (m,).
        limit: Of the absolute value, shape (m,), [N m, N].
    """

    regressor: Regressor
    parameters: Array
    joints: npt.NDArray[np.intp]
    limit: Array
    _mapped: dict[tuple[str, int], Mapped] = field(default_factory=dict, repr=False)

    @property
    def kind(self) -> str:  # type: ignore[override]
        """Of quantity."""
        return "torque"

    @property
    def labels(self) -> tuple[str, ...]:  # type: ignore[override]
        """By joint."""
        return tuple(f"joint '{self.regressor.robot.dofs[k]}'" for k in self.joints)

    @property
    def units(self) -> tuple[str, ...]:  # type: ignore[override]
        """By joint."""
        robot = self.regressor.robot
        return tuple("N" if robot.joints[k].kind is JointKind.PRISMATIC else "N m" for k in self.joints)

    @property
    def lower(self) -> Array:  # type: ignore[override]
        """Minus the limit."""
        return -self.limit

    @property
    def upper(self) -> Array:  # type: ignore[override]
        """The limit."""
        return self.limit

    @property
    def scale(self) -> Array:  # type: ignore[override]
        """The limit."""
        return self.limit

    def measure(self, motion: Motion) -> Array:
        """Torques."""
        return self.regressor.predict(self.parameters, *state_of(self.regressor.robot, motion))[:, self.joints]

    def constrain(self, motion: Motion) -> Array:
        """Shares of the limits."""
        return np.asarray(self._at("torque", motion) / self.limit)

    def slopes(self, motion: Motion) -> Slopes:
        """From the symbolic torque."""
        m, n = len(self.joints), len(self.regressor.robot.dofs)
        values = self._at("slopes", motion)
        full = np.zeros((len(values), m, 3 * n))
        rows, columns = self._pattern
        full[:, rows, columns] = values / self.limit[rows]
        return {order: full[:, :, order * n : (order + 1) * n] for order in range(3)}

    @cached_property
    def depends(self) -> npt.NDArray[np.bool_]:
        """Joints of the same branch."""
        n = len(self.regressor.robot.dofs)
        table = np.zeros((len(self.joints), n), dtype=np.bool_)
        rows, columns = self._pattern
        table[rows, columns % n] = True
        return table

    def watching(self, wanted: npt.NDArray[np.bool_]) -> TorqueBlock | None:
        """The same for fewer joints, chosen by a mask (m,); None for none."""
        if wanted.all():
            return self
        return (
            TorqueBlock(self.regressor, self.parameters, self.joints[wanted], self.limit[wanted])
            if wanted.any()
            else None
        )

    def _at(self, name: str, motion: Motion) -> Array:
        key = name, len(motion.position)
        if key not in self._mapped:
            self._mapped[key] = Mapped(self._symbolic[0][name], key[1])
        return self._mapped[key](motion.position, motion.velocity, motion.acceleration)

    @property
    def _pattern(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        rows, columns = (np.array(index, dtype=np.intp) for index in self._symbolic[1].get_triplet())
        return rows, columns

    @cached_property
    def _symbolic(self) -> tuple[dict[str, Any], Any]:
        """``(position, velocity, acceleration)`` to the torques and to their Jacobian's nonzeros, and its sparsity."""
        robot = self.regressor.robot
        p, v, a = (ca.SX.sym(name, robot.nv) for name in "pva")
        tau = self.regressor.torque(configuration(robot, p), v, a, ca.DM(self.parameters))
        tau = tau[self.joints.tolist()]
        jacobian = ca.jacobian(tau, ca.vertcat(p, v, a))
        entries: list[Any] = jacobian.nonzeros()
        outputs = {"torque": ca.densify(tau), "slopes": ca.vertcat(*entries)}
        functions = {name: ca.Function(name, [p, v, a], [value], {"cse": True}) for name, value in outputs.items()}
        return functions, jacobian.sparsity()


def joint_block(robot: Robot, order: int, lower: Array, upper: Array) -> JointBlock | None:
    """Bounds of one derivative; None if no joint has any."""
    joints = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
    if not len(joints):
        return None
    per = ("", "/s", "/s²", "/s³")[order]
    lengths = [one.kind is JointKind.PRISMATIC for one in robot.joints]
    return JointBlock(
        order,
        joints,
        frozen(lower[joints]),
        frozen(upper[joints]),
        tuple(f"joint '{robot.dofs[k]}'" for k in joints),
        tuple(("m" if lengths[k] else "rad") + per for k in joints),
        len(robot.dofs),
    )

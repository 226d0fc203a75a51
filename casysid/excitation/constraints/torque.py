"""Bounds of the torque that the prior model expects."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Regressor
from casysid.excitation.constraints.constraint import Constraint, Slopes
from casysid.excitation.motion.configuration import configuration
from casysid.excitation.motion.fourier import Motion, state_of
from casysid.excitation.motion.mapped import Mapped
from casysid.robot import JointKind


@dataclass(frozen=True, eq=False)
class TorqueConstraint(Constraint):
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

    def watching(self, wanted: npt.NDArray[np.bool_]) -> TorqueConstraint | None:
        """The same for fewer joints, chosen by a mask (m,); None for none."""
        if wanted.all():
            return self
        return (
            TorqueConstraint(self.regressor, self.parameters, self.joints[wanted], self.limit[wanted])
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

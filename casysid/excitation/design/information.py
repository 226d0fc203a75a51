"""The information that a motion holds about the base parameters, and its derivative along the motion.

With the base parameters' columns ``Y`` of the regressor and torque noise ``σ``, ``F = Σ_t Yᵀ diag(σ⁻²) Y``. A criterion
``c(F)`` with derivative ``C`` changes with a sample as ``2 diag(σ⁻²) Y C`` does with Y, and one sweep backwards through
the regressor brings that to position, velocity and acceleration: two evaluations of cheap code, whatever the number of
variables.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import Bulk, Regressor
from casysid.excitation.motion.configuration import configuration
from casysid.excitation.motion.fourier import Motion, state_of
from casysid.excitation.motion.mapped import Mapped
from casysid.identifiability import BaseParameters

FLOOR = 1e-9
"""Information per sample that no parameter is below, in the scaled units: keeps matrices invertible."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Information:
    """How to see a motion's information.

    Attributes:
        regressor: All columns.
        base: Which of them lead the base parameters.
        noise_std: ``σ``, shape (nv,), [N m, N].
        scale: Of each base parameter: ``F`` is in units where a random motion gives each about one, shape (r,).
    """

    regressor: Regressor
    base: BaseParameters
    noise_std: Array
    scale: Array
    _mapped: dict[tuple[str, int], Mapped] = field(default_factory=dict, repr=False)

    @property
    def size(self) -> int:
        """Number of base parameters."""
        return self.base.rank

    @cached_property
    def columns(self) -> tuple[npt.NDArray[np.intp], ...]:
        """For each degree of freedom, the base parameters that are structurally nonzero in its row."""
        places = {int(column): k for k, column in enumerate(self.base.independent)}
        return tuple(
            np.array([places[int(c)] for c in columns if int(c) in places], dtype=np.intp)
            for columns in self.regressor.row_columns
        )

    def of_motion(self, motion: Motion) -> Array:
        """``F`` summed over the samples, shape (r, r)."""
        rows = self._rows.evaluate(motion.position, motion.velocity, motion.acceleration)
        return self._sum(self._weighted(rows))

    def of_parameters(self, gram: Array) -> Array:
        """``F`` of what all p parameters' weighted Gram matrix (p, p), ``Σ σ⁻² x xᵀ``, says of the base parameters."""
        chosen = self.base.independent
        return np.asarray(gram[np.ix_(chosen, chosen)] * np.outer(self.scale, self.scale))

    def sampled(self, motion: Motion) -> tuple[Array, list[Array]]:
        """``F``, and the weighted rows of each degree of freedom, shapes (N, its columns), for :meth:`pull_back`."""
        rows = self._at("rows", len(motion.position))(motion.position, motion.velocity, motion.acceleration)
        weighted = self._weighted(rows)
        return self._sum(weighted), weighted

    def pull_back(self, motion: Motion, weighted: list[Array], slope: Array) -> tuple[Array, Array, Array]:
        """Derivatives with respect to positions, velocities and accelerations, each (N, n), of ``c`` with ``dc/dF``."""
        parts = [
            2.0 * rows @ slope[np.ix_(columns, columns)] * (self.scale[columns] / std)
            for rows, columns, std in zip(weighted, self.columns, self.noise_std, strict=True)
        ]
        adjoint = self._at("adjoint", len(motion.position))
        answer = adjoint(motion.position, motion.velocity, motion.acceleration, np.hstack(parts))
        first, second, third = np.split(answer.copy(), 3, axis=1)
        return first, second, third

    def _at(self, name: str, samples: int) -> Mapped:
        key = name, samples
        if key not in self._mapped:
            self._mapped[key] = Mapped(self._functions[name], samples)
        return self._mapped[key]

    def _weighted(self, rows: Array) -> list[Array]:
        parts = np.split(rows, np.cumsum([len(columns) for columns in self.columns])[:-1], axis=1)
        return [
            part * (self.scale[columns] / std)
            for part, columns, std in zip(parts, self.columns, self.noise_std, strict=True)
        ]

    def _sum(self, weighted: list[Array]) -> Array:
        total = np.zeros((self.size, self.size))
        for rows, columns in zip(weighted, self.columns, strict=True):
            total[np.ix_(columns, columns)] += rows.T @ rows
        return total

    @cached_property
    def _functions(self) -> dict[str, Any]:
        p, v, a = (ca.SX.sym(name, self.regressor.robot.nv) for name in "pva")
        Y = self.regressor.function(configuration(self.regressor.robot, p), v, a)
        entries = [
            Y[dof, int(self.base.independent[column])] for dof, columns in enumerate(self.columns) for column in columns
        ]
        rows = ca.vertcat(*entries)
        weights = ca.SX.sym("weights", rows.numel())
        slope = ca.densify(ca.jtimes(rows, ca.vertcat(p, v, a), weights, True))
        return {
            "rows": ca.Function("rows", [p, v, a], [ca.densify(rows)], {"cse": True}),
            "adjoint": ca.Function("adjoint", [p, v, a, weights], [slope], {"cse": True}),
        }

    @cached_property
    def _rows(self) -> Bulk:
        return Bulk(self._functions["rows"])


def column_scale(regressor: Regressor, base: BaseParameters, noise_std: Array, states: Motion) -> Array:
    """One over the weighted root mean square of each base parameter's column at given states, shape (r,)."""
    Y = regressor.evaluate(*state_of(regressor.robot, states))[:, :, base.independent] / noise_std[:, None]
    return frozen(1.0 / np.sqrt(np.maximum((Y**2).sum(axis=1).mean(axis=0), np.finfo(np.float64).tiny)))

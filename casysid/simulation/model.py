"""The model inside a controller: a robot with any parameter vector, physically consistent or not."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import Dynamics, Regressor, build_dynamics, build_regressor
from casysid.errors import ParameterError
from casysid.robot import Robot


@dataclass(frozen=True, eq=False)
class ControlModel:
    """Dynamics of a robot by a parameter vector that need not be that of any bodies: all of them are linear in it.

    Attributes:
        regressor: The robot's, with its friction columns and couplings.
        parameters: Shape (p,).
    """

    regressor: Regressor
    parameters: Array

    def __post_init__(self) -> None:
        theta = frozen(self.parameters)
        if theta.shape != (len(self.regressor.names),) or not np.isfinite(theta).all():
            raise ParameterError(
                f"control model of robot '{self.robot.name}': wanted {len(self.regressor.names)} finite parameters in "
                f"the regressor's order; got shape {theta.shape}"
            )
        object.__setattr__(self, "parameters", theta)

    @classmethod
    def from_robot(cls, robot: Robot, parameters: npt.ArrayLike | None = None) -> ControlModel:
        """The default regressor with these parameters; None takes those of the robot's file."""
        regressor = build_regressor(robot)
        return cls(regressor, regressor.prior if parameters is None else frozen(parameters))

    @classmethod
    def from_file(cls, path: str | Path) -> ControlModel:
        """The model that a URDF or MJCF file describes, friction and armature included."""
        return cls.from_robot(Robot.from_file(path))

    @property
    def robot(self) -> Robot:
        """Whose model it is."""
        return self.regressor.robot

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """Torques (N, nv) for motions (N, nq), (N, nv), (N, nv), friction included."""
        return self.regressor.predict(self.parameters, q, v, a)

    def friction(self, q: Array, v: Array) -> Array:
        """What of the torques friction and offsets take, at a steady velocity, shape (N, nv)."""
        drive = self.parameters.copy()
        drive[: self.robot.inertial_parameters.size] = 0.0
        return self.regressor.predict(drive, q, v, np.zeros_like(v))

    def gravity(self, q: Array) -> Array:
        """What holds the robot still at a configuration (nq,), shape (nv,)."""
        return np.asarray(self._dynamics.gravity(q, self._inertial)).ravel()

    def mass_matrix(self, q: Array) -> Array:
        """Shape (nv, nv), armature included."""
        return np.asarray(self._dynamics.mass_matrix(q, self._inertial, self._armature))

    def bias(self, q: Array, v: Array) -> Array:
        """Coriolis, centrifugal and gravity torques, shape (nv,); no friction."""
        return np.asarray(self._dynamics.bias(q, v, self._inertial)).ravel()

    @cached_property
    def _dynamics(self) -> Dynamics:
        return build_dynamics(self.robot)

    @cached_property
    def _inertial(self) -> Array:
        return self.parameters[: self.robot.inertial_parameters.size]

    @cached_property
    def _armature(self) -> Array:
        armature, at = np.zeros(self.robot.nv), {name: k for k, name in enumerate(self.robot.dofs)}
        for parameter, value in zip(self.regressor.parameters, self.parameters, strict=True):
            if parameter.kind == "armature" and parameter.owner in at:
                armature[at[parameter.owner]] = value
        return armature

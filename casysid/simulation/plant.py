"""The plant: a robot with everything that real robots do, to be simulated in MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.robot import JointKind, Robot
from casysid.simulation.coordinates import Coordinates
from casysid.simulation.physics import Machine, Physics, build_machine
from casysid.simulation.settings import PlantSettings
from casysid.simulation.truth import drive_parameters, felt_inertia, finite_limit, torque_scale, true_parameters


@dataclass(frozen=True, eq=False)
class Plant:
    """A simulated robot whose parameters are known.

    Attributes:
        robot: Tree, limits, gravity, and unless ``given`` says otherwise the truth.
        settings: What it does beside rigid-body dynamics.
        given: Parameters to be the truth instead of the file's, in the order of the default regressor.

    Raises:
        ParameterError: The parameters have the wrong shape or cannot be.
    """

    robot: Robot
    settings: PlantSettings = field(default_factory=PlantSettings)
    given: npt.ArrayLike | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.given is not None:
            object.__setattr__(self, "given", frozen(self.given))
        _ = self.parameters  # checked now rather than when first used

    @classmethod
    def from_file(
        cls, path: str | Path, settings: PlantSettings | None = None, parameters: npt.ArrayLike | None = None
    ) -> Plant:
        """The plant of a URDF or MJCF file."""
        return cls(Robot.from_file(path), settings or PlantSettings(), parameters)

    @cached_property
    def parameters(self) -> Array:
        """The truth, shape (p,): see :func:`casysid.simulation.truth.true_parameters`."""
        return true_parameters(self.robot, self.settings.mechanics, self.given)

    @cached_property
    def coordinates(self) -> Coordinates:
        """Between the plant's coordinates and Pinocchio's."""
        return Coordinates(self.robot)

    @cached_property
    def fastest_decay(self) -> float:
        """How fast viscous friction alone can stop a joint [1/s]: what limits the time step.

        Raises:
            RobotError: A joint moves no mass.
        """
        viscous = drive_parameters(self.robot, self.parameters)[0]
        return float((viscous / felt_inertia(self.robot, self.parameters)[0]).max())

    @cached_property
    def torque_scale(self) -> Array:
        """See :func:`casysid.simulation.truth.torque_scale`."""
        return frozen(torque_scale(self.robot))

    @cached_property
    def effort_limit(self) -> Array:
        """Largest torque of the actuators, inf without saturation, shape (nv,), [N m] or [N]."""
        limited = self.settings.actuation.saturation
        return frozen(finite_limit(self.robot.effort_limit, np.inf) if limited else np.full(self.robot.nv, np.inf))

    @cached_property
    def coulomb_friction(self) -> Array:
        """Shape (nv,), [N m] or [N]."""
        return frozen(drive_parameters(self.robot, self.parameters)[1])

    @cached_property
    def offset(self) -> Array:
        """Constant torque, shape (nv,), [N m] or [N]."""
        return frozen(drive_parameters(self.robot, self.parameters)[2])

    @cached_property
    def cable_stiffness(self) -> Array:
        """Springs of the joints with one degree of freedom, shape (nv,), [N m/rad] or [N/m]."""
        stiffness, (low, high) = np.zeros(self.robot.nv), self._range
        for joint in self.robot.joints:
            if joint.kind in (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC):
                reach = (high[joint.channels] - low[joint.channels]) / 2.0
                stiffness[joint.v] = (
                    self.settings.mechanics.cable_pull * self.torque_scale[joint.v] / np.maximum(reach, 1e-3)
                )
        return frozen(stiffness)

    @cached_property
    def cable_rest(self) -> Array:
        """Where the springs are slack, shape (channels,)."""
        return frozen(np.sum(self._range, axis=0) / 2.0)

    def cable_torque(self, channels: Array) -> Array:
        """What the motors must give against the cables at positions (N, channels), shape (N, nv)."""
        torque = np.zeros((len(channels), self.robot.nv))
        at, by = self.coordinates.additive
        torque[:, by] = self.cable_stiffness[by] * (channels[:, at] - self.cable_rest[at])
        return torque

    def build(self, timestep: float) -> Machine:
        """The MuJoCo model, new each time.

        Raises:
            RobotError: A link's parameters are not those of a body that could move.
        """
        physics = Physics(
            parameters=self.parameters,
            stiffness=self.cable_stiffness,
            rest=self.cable_rest,
            effort=self.effort_limit,
            lag=self.settings.actuation.lag,
            timestep=timestep,
        )
        return build_machine(self.robot, physics)

    @property
    def _range(self) -> tuple[Array, Array]:
        low, high = self.robot.position_lower, self.robot.position_upper
        bounded = np.isfinite(low) & np.isfinite(high)
        return np.where(bounded, low, -np.pi), np.where(bounded, high, np.pi)

"""Dry friction that grows with the load of the gear."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from casysid.dynamics.friction.direction import Direction
from casysid.dynamics.friction.kind import DriveState, FrictionColumn, JointUse, acts_along
from casysid.dynamics.friction.smooth_sign import SmoothSign
from casysid.robot import Robot


@dataclass(frozen=True)
class LoadedCoulomb(SmoothSign, FrictionColumn):
    """Dry friction in proportion to the load of the gear, ``|gravity torque| sign(velocity)``.

    The load is that of the model as it was before the identification, so that the regressor stays linear.

    Attributes:
        joints: Where it acts; None for everywhere.
        inertial_parameters: Of the links that make the load, shape (10 links,); None takes the robot's.
    """

    joints: tuple[str, ...] | None = None
    inertial_parameters: tuple[float, ...] | None = None

    kind: ClassVar[str] = "loaded_coulomb"
    by_design: ClassVar[bool] = True
    non_negative: ClassVar[bool] = True

    def unit(self, direction: Direction) -> str:
        """Unit of the parameter."""
        return "1"

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """``|load| tanh(ds/dt / width)``."""
        if not acts_along(self.joints, direction):
            return None
        own = self.inertial_parameters
        return ca.fabs(state.static_torque(None if own is None else np.array(own))) * self.sign(state)

    @classmethod
    def candidates(cls, use: JointUse) -> Iterator[LoadedCoulomb]:
        """The one that there is."""
        yield cls({use.direction.name: use.width}, (use.direction.name,))

    def describe(self, direction: Direction) -> str:
        """In words."""
        return "Coulomb in proportion to the load"

    def to_json(self, robot: Robot) -> dict[str, Any]:
        """With the parameters that make its load, which the identified robot no longer has."""
        own = robot.inertial_parameters if self.inertial_parameters is None else np.array(self.inertial_parameters)
        return {**super().to_json(robot), "inertial_parameters": own.tolist()}

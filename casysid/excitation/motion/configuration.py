"""Joint positions as the configuration that models take."""

from __future__ import annotations

from typing import Any

import casadi as ca

from casysid.errors import ParameterError
from casysid.robot import JointKind, Robot


def configuration(robot: Robot, position: Any) -> Any:
    """Pinocchio's configuration (nq,) as an expression of joint positions (n,)."""
    parts: list[Any] = []
    for joint in robot.joints:
        angle = position[joint.v]
        parts += [ca.cos(angle), ca.sin(angle)] if joint.kind is JointKind.CONTINUOUS else [angle]
    return ca.vertcat(*parts)


def check_joints(robot: Robot) -> None:
    """Nothing, if every joint has one degree of freedom.

    Raises:
        ParameterError: One has not, or there is none at all.
    """
    if not robot.joints:
        raise ParameterError(f"excitation: robot '{robot.name}' has no joint that moves")
    for joint in robot.joints:
        if joint.kind not in (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC):
            raise ParameterError(
                f"excitation: joint '{joint.name}' is {joint.kind.value}; only joints with one degree of freedom can "
                "be moved along a Fourier series. Take a model with a fixed base and single joints"
            )

"""The identified robot as Pinocchio's and MuJoCo's model, and what neither has a place for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from casysid.dynamics import Armature, Coulomb, Spring, Viscous
from casysid.dynamics.friction import joint_directions
from casysid.robot import JointKind
from casysid.simulation.physics import Physics, build_machine

if TYPE_CHECKING:
    from casysid.model.robot_model import RobotModel

_ONE_AXIS = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


def pinocchio_model(model: RobotModel) -> Any:
    """See :meth:`RobotModel.pinocchio`."""
    return model.robot.with_parameters(
        inertial_parameters=model.inertial_parameters,
        damping=model.damping,
        dry_friction=model.dry_friction,
        armature=model.armature,
    ).model.copy()


def mujoco_model(model: RobotModel, timestep: float) -> Any:
    """See :meth:`RobotModel.mujoco`."""
    robot = model.robot
    driven = list(joint_directions(robot))
    drives = [values[driven] for values in (model.damping, model.dry_friction, np.zeros(robot.nv), model.armature)]
    stiffness = np.zeros(robot.nv)
    for part in model.regressor.parts:
        if isinstance(part.kind, Spring) and part.direction.name in robot.dofs:
            stiffness[robot.dofs.index(part.direction.name)] = model.parameters[part.columns[0]]
    physics = Physics(
        parameters=np.concatenate([model.inertial_parameters, *drives]),
        stiffness=stiffness,
        rest=np.zeros(len(robot.channels)),
        effort=robot.effort_limit,
        lag=0.0,
        timestep=timestep,
    )
    return build_machine(robot, physics, named=True).model


def notes(model: RobotModel) -> tuple[str, ...]:
    """See :meth:`RobotModel.simulator_notes`."""
    robot = model.robot
    homes = {Viscous.kind, Coulomb.kind, Armature.kind}
    one_axis = {dof for joint in robot.joints if joint.kind in _ONE_AXIS for dof in robot.dofs[joint.v]}
    homeless, springs = list[str](), list[str]()
    for parameter, value in zip(
        model.regressor.parameters[robot.inertial_parameters.size :],
        model.parameters[robot.inertial_parameters.size :],
        strict=True,
    ):
        if value == 0.0 or (parameter.kind in homes and parameter.owner in robot.dofs):
            continue
        of_joint = parameter.kind == Spring.kind and parameter.owner in one_axis
        (springs if of_joint else homeless).append(parameter.name)
    told = []
    if homeless:
        told.append(
            f"Neither has a place for {', '.join(homeless)}; their damping and dry friction are those that come "
            "nearest to all friction, and the rest is to be added as a torque."
        )
    if springs:
        told.append(f"Pinocchio has no place for {', '.join(springs)}; MuJoCo has them as stiffness of the joints.")
    told.append(
        "Pinocchio's own algorithms use the armature but neither damping nor dry friction; MuJoCo's dry friction is a "
        "constraint that sticks, not a smooth function of the velocity."
    )
    if not np.allclose(model.torque_gains, 1.0):
        gains = ", ".join(f"{dof} {gain:.4g}" for dof, gain in zip(robot.dofs, model.torque_gains, strict=True))
        told.append(f"Their torques are true ones; times {gains} they are those of the recordings.")
    return tuple(told)

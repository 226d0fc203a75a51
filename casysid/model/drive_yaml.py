"""``drive.yaml``: what a URDF has no place for, joint by joint, for whoever reads YAML."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from casysid.dynamics.friction.direction import damping_unit, force_unit, joint_directions

if TYPE_CHECKING:
    from casysid.model.robot_model import RobotModel

DRIVE_FILE = "drive.yaml"
HEAD = """\
# Drives of the robot '{name}', for what a URDF has no place for: identified by casysid.
# armature: inertia of rotor and gear, seen at the joint; it adds to the mass matrix's diagonal.
# damping, dry_friction: viscous and Coulomb friction that come nearest to all friction, as in identified.urdf.
# offset: constant torque. torque_gain: torque as logged over true torque.
# parameters: every single parameter of the drive; result.json says what multiplies it.
"""


def drive_yaml(model: RobotModel) -> str:
    """Armature, friction and all drive parameters with their units, by joint and coupling."""
    robot, lines = model.robot, [HEAD.format(name=" ".join(model.robot.name.split())), "joints:"]
    offset = model.values_of("offset")
    for k, direction in joint_directions(robot).items():
        inertia = "kg" if direction.linear else "kg m^2"
        lines += [
            f"  {json.dumps(robot.dofs[k])}:",
            f"    armature: {float(model.armature[k])!r}  # {inertia}",
            f"    damping: {float(model.damping[k])!r}  # {damping_unit(direction)}",
            f"    dry_friction: {float(model.dry_friction[k])!r}  # {force_unit(direction)}",
            f"    offset: {float(offset[k])!r}  # {force_unit(direction)}",
            f"    torque_gain: {float(model.torque_gains[k])!r}",
        ]
    lines.append("parameters:")
    first = robot.inertial_parameters.size
    for parameter, value in zip(model.regressor.parameters[first:], model.parameters[first:], strict=True):
        lines.append(f"  {json.dumps(parameter.name)}: {float(value)!r}  # {parameter.unit}")
    return "\n".join(lines) + "\n"

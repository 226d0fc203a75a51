"""A MuJoCo model of any robot, built from the robot itself.

MuJoCo refuses many URDFs (missing inertias, inertias that round to infeasible ones, missing meshes). The tree, the
parameters and gravity are all in the :class:`~casysid.robot.Robot`, so the model is made from these, in full precision
and without geometry. A planar joint becomes two slides and a hinge, a free-flyer three slides and a ball: its rates are
those of :mod:`casysid.simulation.coordinates`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from casysid.arrays import Array
from casysid.errors import RobotError
from casysid.robot import Joint, JointKind, Robot
from casysid.simulation.truth import drive_parameters

_MASSLESS = 1e-9  # [kg], [kg m²]: MuJoCo wants every moving body to have mass
_STIFF = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # solimp: friction that sticks hardly creeps
_PATTERN = {
    JointKind.REVOLUTE: "h",
    JointKind.CONTINUOUS: "h",
    JointKind.PRISMATIC: "s",
    JointKind.PLANAR: "ssh",
    JointKind.SPHERICAL: "b",
    JointKind.FREE_FLYER: "sssb",
}


@dataclass(frozen=True, eq=False)
class Machine:
    """A compiled MuJoCo model and where the robot's coordinates are in it.

    Attributes:
        model: ``mujoco.MjModel``.
        positions: Places of the channels in ``qpos``, shape (channels,).
        rates: Places of the degrees of freedom in ``qvel``, shape (nv,).
    """

    model: Any
    positions: Any
    rates: Any


@dataclass(frozen=True, eq=False, kw_only=True)
class Physics:
    """What the machine is made of; vectors are (nv,).

    Attributes:
        parameters: As in :func:`casysid.simulation.truth.true_parameters`.
        stiffness: Springs [N m/rad].
        rest: Where the springs are slack, by channel.
        effort: Largest torque, inf where there is none.
        lag: Time constant of the actuators [s].
        timestep: [s].
    """

    parameters: Array
    stiffness: Array
    rest: Array
    effort: Array
    lag: float
    timestep: float


def build_machine(robot: Robot, physics: Physics, *, named: bool = False) -> Machine:
    """The robot as a MuJoCo model with one motor per degree of freedom.

    Args:
        robot: The tree.
        physics: What it is made of.
        named: Whether bodies, joints and motors have the robot's names, which strangers chose, instead of numbers.

    Raises:
        RobotError: A link's parameters are not those of a body that could move.
    """
    import mujoco

    spec = mujoco.MjSpec()
    option, disable = spec.option, mujoco.mjtDisableBit
    option.timestep, option.gravity, option.tolerance = physics.timestep, robot.gravity, 1e-12
    option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    option.disableflags = disable.mjDSBL_CONTACT | disable.mjDSBL_LIMIT | disable.mjDSBL_AUTORESET
    inertias = _checked_inertias(robot, physics.parameters)
    bodies: list[Any] = []
    names: list[list[str]] = []
    for k, joint in enumerate(robot.joints):
        parent = spec.worldbody if joint.parent < 0 else bodies[joint.parent]
        pattern = _PATTERN[joint.kind]
        body, root = (joint.link or f"{joint.name} frame", joint.name) if named else (f"body{k}", f"joint{k}")
        names.append([root if named and len(pattern) == 1 else f"{root}.{i}" for i in range(len(pattern))])
        bodies.append(_add_body(parent, body, joint.placement, inertias[k]))
        for i, motion in enumerate(pattern):
            _add_joint(spec, bodies[-1], joint, names[-1][i], motion, i, physics)
    model = spec.compile()
    machine = Machine(model, *_addresses(model, robot, names))
    _set_numbers(machine, robot, physics, inertias, [bodies[k].name for k in range(len(bodies))])
    return machine


def _checked_inertias(robot: Robot, parameters: Array) -> list[Any]:
    """The inertia of every joint's body, None for a massless frame."""
    count = 10 * len(robot.links)
    for link, theta in zip(robot.links, parameters[:count].reshape(-1, 10), strict=True):
        if theta[0] < 0.0 or (theta[0] == 0.0 and theta.any()):
            raise RobotError(f"link '{link}': a body of {theta[0]:.6g} kg cannot be simulated; give it mass")
        if theta[0] > 0.0 and np.linalg.eigvalsh(pin.Inertia.FromDynamicParameters(theta).inertia)[0] < 0.0:
            raise RobotError(
                f"link '{link}': its inertia about the centre of mass is not positive, so it cannot be simulated; "
                "correct the file or project the parameters"
            )
    model = robot.with_parameters(inertial_parameters=parameters[:count]).model
    return [model.inertias[k + 1] if model.inertias[k + 1].mass > 0.0 else None for k in range(len(robot.joints))]


def _add_body(parent: Any, name: str, placement: Any, inertia: Any) -> Any:
    body = parent.add_body(name=name, pos=placement.translation, quat=_quaternion(placement.rotation))
    body.explicitinertial = True
    if inertia is None:
        body.mass, body.inertia = _MASSLESS, np.full(3, _MASSLESS)
    else:  # moments of inertia come in later: MuJoCo refuses those that miss the triangle inequality by a rounding
        body.mass, body.inertia = inertia.mass, np.full(3, inertia.mass)
        body.ipos, body.iquat = inertia.lever, _quaternion(_principal(inertia)[1])
    return body


def _add_joint(spec: Any, body: Any, joint: Joint, name: str, motion: str, i: int, physics: Physics) -> None:
    import mujoco

    kinds = mujoco.mjtJoint
    kind = {"h": kinds.mjJNT_HINGE, "s": kinds.mjJNT_SLIDE, "b": kinds.mjJNT_BALL}[motion]
    axis = joint.axis if joint.axis.any() else np.eye(3)[i % 3]
    body.add_joint(name=name, type=kind, axis=axis)
    for axis_index in range(3 if motion == "b" else 1):
        gear = np.eye(6)[axis_index]
        motor = spec.add_actuator(
            name=f"{name}.{axis_index}" if motion == "b" else name,
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gear=gear,
        )
        limit = physics.effort[joint.v.start + i + axis_index]
        if np.isfinite(limit):
            motor.ctrllimited, motor.ctrlrange = True, (-limit, limit)
        if physics.lag > 0.0:
            motor.dyntype, motor.dynprm = mujoco.mjtDyn.mjDYN_FILTER, np.r_[physics.lag, np.zeros(9)]


def _addresses(model: Any, robot: Robot, names: list[list[str]]) -> tuple[Any, Any]:
    """Where channels and rates are in qpos and qvel: MuJoCo orders bodies depth first and quaternions w first."""
    positions, rates = [], []
    for k, joint in enumerate(robot.joints):
        for i, motion in enumerate(_PATTERN[joint.kind]):
            mj_joint = model.joint(names[k][i])
            q, v = int(mj_joint.qposadr[0]), int(mj_joint.dofadr[0])
            positions += [q + 1, q + 2, q + 3, q] if motion == "b" else [q]
            rates += [v, v + 1, v + 2] if motion == "b" else [v]
    return np.array(positions), np.array(rates)


def _set_numbers(machine: Machine, robot: Robot, physics: Physics, inertias: list[Any], bodies: list[str]) -> None:
    """Write what the compiler would round, refuse or spread over a whole ball joint."""
    import mujoco

    model, rates = machine.model, machine.rates
    for k, inertia in enumerate(inertias):
        if inertia is not None:
            model.body(bodies[k]).inertia[:] = _principal(inertia)[0]
    viscous, coulomb, _, armature = drive_parameters(robot, physics.parameters)
    for joint in robot.joints:
        if joint.kind in (JointKind.PLANAR, JointKind.FREE_FLYER):
            given = np.concatenate([values[joint.v] for values in (viscous, coulomb, armature, physics.stiffness)])
            if given.any():
                raise RobotError(
                    f"joint '{joint.name}': friction, springs and armature of a {joint.kind.value} joint cannot be "
                    "simulated; set them to 0"
                )
    model.dof_damping[rates], model.dof_frictionloss[rates], model.dof_armature[rates] = viscous, coulomb, armature
    model.dof_solref[:], model.dof_solimp[:] = (2.0 * physics.timestep, 1.0), _STIFF
    for joint in robot.joints:
        if len(_PATTERN[joint.kind]) == 1 and joint.kind is not JointKind.SPHERICAL:
            at = int(model.dof_jntid[rates[joint.v.start]])
            model.jnt_stiffness[at] = physics.stiffness[joint.v.start]
            model.qpos_spring[machine.positions[joint.channels.start]] = physics.rest[joint.channels.start]
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _principal(inertia: Any) -> tuple[Array, Array]:
    """Principal moments and axes (a rotation, in columns) of the inertia about the centre of mass."""
    moments, axes = np.linalg.eigh(inertia.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return moments, axes


def _quaternion(rotation: Array) -> Array:
    x, y, z, w = pin.Quaternion(rotation).coeffs()
    return np.array([w, x, y, z])

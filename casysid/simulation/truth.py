"""The parameters that a simulated machine has: the truth that an identification should find."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.dynamics.friction import joint_directions
from casysid.errors import ParameterError, RobotError
from casysid.robot import JointKind, Robot
from casysid.simulation.settings import Mechanics

_POSES = 200
_GENTLE_ACCELERATION = 10.0  # [rad/s²]
_HEADROOM = 10.0  # an effort limit beyond this many times what weight and gentle acceleration need is a placeholder
_LIGHTEST = 0.002  # of the neediest joint's need, at least: some files give the last link no inertia
_SLOWEST_DECAY = 200.0  # [1/s]: no rotor is so light that friction stops it faster


def true_parameters(robot: Robot, mechanics: Mechanics, parameters: npt.ArrayLike | None = None) -> Array:
    """The plant's parameters in the order of the default regressor, shape (10 links + 4 driven,).

    Ten inertial parameters per link, then viscous friction, Coulomb friction, offset and armature of every driven
    degree of freedom: all but a free-flyer's.

    Args:
        robot: Its file's values are the truth; a kind of friction, or armature, of which the file has none gets the
            level in ``mechanics``.
        mechanics: What there is of friction and armature.
        parameters: Same order; taken instead of the file's. What ``mechanics`` switches off is zero all the same.

    Raises:
        ParameterError: The shape is wrong, a number is not finite, or friction or armature is negative.
    """
    width, driven = robot.inertial_parameters.size, len(joint_directions(robot))
    if parameters is None:
        theta = np.concatenate([robot.inertial_parameters, *_file_or_level(robot, mechanics)])
    else:
        theta = np.array(parameters, dtype=np.float64)
        if theta.shape != (width + 4 * driven,):
            raise ParameterError(
                f"plant of robot '{robot.name}': parameters must have shape ({width + 4 * driven},): ten for each of "
                f"{len(robot.links)} links, then viscous, Coulomb, offset and armature of {driven} driven degrees of "
                f"freedom; got {theta.shape}"
            )
    viscous, coulomb, _, armature = theta[width:].reshape(4, driven)
    viscous *= mechanics.viscous_friction
    coulomb *= mechanics.coulomb_friction
    armature *= mechanics.armature
    if not np.isfinite(theta).all() or (np.concatenate([viscous, coulomb, armature]) < 0.0).any():
        raise ParameterError(
            f"plant of robot '{robot.name}': parameters must be finite, friction and armature not negative; "
            "a machine with others cannot be simulated"
        )
    return frozen(theta)


def drive_parameters(robot: Robot, parameters: Array) -> Array:
    """Viscous friction, Coulomb friction, offset and armature of all degrees of freedom, shape (4, nv)."""
    drives = np.zeros((4, robot.nv))
    drives[:, list(joint_directions(robot))] = parameters[robot.inertial_parameters.size :].reshape(4, -1)
    return drives


def torque_scale(robot: Robot) -> Array:
    """What counts as a large torque for each degree of freedom, shape (nv,), [N m] or [N].

    The effort limit, unless there is none or it is a mere placeholder: then what weight and gentle acceleration need,
    with headroom.
    """
    data, rng = robot.model.createData(), np.random.default_rng(1)
    pushes = _GENTLE_ACCELERATION * rng.normal(size=(_POSES, robot.nv))
    still = np.zeros(robot.nv)
    need = np.abs([pin.rnea(robot.model, data, q, still, a) for q, a in zip(poses(robot), pushes, strict=True)]).max(
        axis=0
    )
    need = np.maximum(need, max(_LIGHTEST * need.max(), 1e-6))
    return np.asarray(np.minimum(finite_limit(robot.effort_limit, 3.0 * need), _HEADROOM * need))


def finite_limit(limit: Array, otherwise: npt.ArrayLike) -> Array:
    """A limit, or ``otherwise`` where it is infinite, or zero as some files write it for lack of a value."""
    return np.where(np.isfinite(limit) & (limit > 0.0), limit, otherwise)


def felt_inertia(robot: Robot, parameters: Array | None = None) -> tuple[Array, Array]:
    """The smallest inertia a joint feels, all others free, and the largest, all others held, over the ranges.

    Args:
        robot: The robot.
        parameters: As for :func:`true_parameters`; None takes the file's.

    Returns:
        Two arrays (nv,), [kg m²] or [kg], armature included.

    Raises:
        RobotError: A joint moves no mass.
    """
    model = robot.model
    if parameters is not None:
        inertial, armature = parameters[: robot.inertial_parameters.size], drive_parameters(robot, parameters)[3]
        model = robot.with_parameters(inertial_parameters=inertial, armature=armature).model
    data, smallest, largest = model.createData(), np.full(robot.nv, np.inf), np.zeros(robot.nv)
    for q in poses(robot):
        mass = pin.crba(model, data, q)
        if np.linalg.eigvalsh(mass)[0] <= 0.0:
            raise RobotError(
                f"robot '{robot.name}': a joint moves no mass, so it cannot be simulated; give the last links of the "
                "tree mass and inertia, or their joints armature"
            )
        smallest = np.minimum(smallest, 1.0 / np.diag(np.linalg.inv(mass)))
        largest = np.maximum(largest, np.diag(mass))
    return smallest, largest


def _file_or_level(robot: Robot, mechanics: Mechanics) -> list[Array]:
    """Viscous, Coulomb, offset, armature of the driven degrees of freedom; no level where a joint moves and turns."""
    scale, free, driven = torque_scale(robot), np.ones(robot.nv), list(joint_directions(robot))
    for joint in robot.joints:
        if joint.kind is JointKind.PLANAR:
            free[joint.v] = 0.0
    signs = np.where(np.arange(robot.nv) % 2 == 0, 1.0, -1.0)
    viscous = mechanics.viscous_level * scale / finite_limit(robot.velocity_limit, 1.0)
    viscous = np.array(robot.damping) if robot.damping.any() else viscous * free
    coulomb = np.array(robot.dry_friction) if robot.dry_friction.any() else mechanics.coulomb_level * scale * free
    rotor = np.maximum(scale / mechanics.rotor_acceleration, viscous / _SLOWEST_DECAY)
    armature = np.array(robot.armature) if robot.armature.any() else rotor * free
    return [values[driven] for values in (viscous, coulomb, mechanics.offset_level * scale * signs * free, armature)]


def poses(robot: Robot) -> list[Array]:
    """Configurations all over the joints' ranges, always the same ones."""
    rng = np.random.default_rng(0)
    chosen = []
    for _ in range(_POSES):
        q = pin.integrate(robot.model, pin.neutral(robot.model), rng.uniform(-np.pi, np.pi, robot.nv))
        for joint in robot.joints:
            if joint.kind in (JointKind.REVOLUTE, JointKind.PRISMATIC):
                low = np.where(
                    np.isfinite(robot.position_lower[joint.channels]), robot.position_lower[joint.channels], -1.0
                )
                high = np.where(
                    np.isfinite(robot.position_upper[joint.channels]), robot.position_upper[joint.channels], 1.0
                )
                q[joint.q] = rng.uniform(low, np.maximum(low, high))
        chosen.append(q)
    return chosen

"""Models of random robots with friction of many kinds, whose parameters are those of bodies and drives that can be."""

import numpy as np
from hypothesis import strategies as st

from casysid.dynamics import (
    DEFAULT_FRICTION,
    Counterweight,
    Coupling,
    LoadedCoulomb,
    MaxwellSlip,
    SharpCoulomb,
    Spring,
    Stribeck,
    build_regressor,
)
from casysid.model import RobotModel, Scatter
from casysid.robot import JointKind
from tests.strategies import SINGLE_KINDS, robots

EVERY_KIND = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC, JointKind.SPHERICAL, JointKind.FREE_FLYER)


def rich_friction(robot):
    """Kinds that need single joints beside the usual ones."""
    joints = tuple(robot.dofs)
    turning = tuple(joint.name for joint in robot.joints if joint.kind is not JointKind.CONTINUOUS)
    slip = MaxwellSlip({name: (0.02 * (k + 1), 0.3) for k, name in enumerate(joints)})
    return (
        *DEFAULT_FRICTION, SharpCoulomb(0.001), LoadedCoulomb(0.02), Stribeck(0.02, 0.3), Spring(turning),
        Counterweight(), slip,
    )  # fmt: skip


def model_of(robot, rng, friction=DEFAULT_FRICTION, couplings=(), gains=None):
    """With the robot's own bodies, random drives, and a covariance that leaves some direction hidden."""
    regressor = build_regressor(robot, friction, couplings, torque_gains=gains)
    p, inertial = len(regressor.names), robot.inertial_parameters.size
    theta = np.concatenate([robot.inertial_parameters, rng.uniform(0.1, 1.0, p - inertial)])
    root = rng.normal(size=(p, p)) / p
    scatter = Scatter(root @ root.T, np.zeros((p, 0)), np.ones(p))
    damping, dry = np.abs(rng.normal(size=(2, robot.nv)))
    driven = [joint.v for joint in robot.joints if joint.kind is JointKind.FREE_FLYER]
    for places in driven:
        damping[places] = dry[places] = 0.0
    return RobotModel(regressor=regressor, parameters=theta, scatter=scatter, damping=damping, dry_friction=dry)


@st.composite
def rich_models(draw, min_joints=1):
    """Single joints with all kinds of friction, a coupling where there are two joints, and gains."""
    robot = draw(robots(kinds=SINGLE_KINDS, min_joints=min_joints, max_joints=3))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    couplings = [Coupling(robot.dofs[:2], (1.0, -0.5), ("viscous", "armature"))] if robot.nv > 1 else []
    gains = draw(st.sampled_from([None, rng.uniform(0.8, 1.2, robot.nv)]))
    return model_of(robot, rng, rich_friction(robot), couplings, gains)


@st.composite
def plain_models(draw, kinds=EVERY_KIND):
    """Any joints with the usual friction."""
    robot = draw(robots(kinds=kinds, max_joints=3))
    return model_of(robot, np.random.default_rng(draw(st.integers(0, 2**32 - 1))))

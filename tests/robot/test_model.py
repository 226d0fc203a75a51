import dataclasses
import pickle

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError, RobotError
from casysid.robot import JointKind, Robot
from tests.robot.bodies import consistent_parameters

HUMANOID = Robot.from_pin(pin.buildSampleModelHumanoidRandom(), name="humanoid")
ARM = Robot.from_pin(pin.buildSampleModelManipulator())


def test_every_joint_of_a_pinocchio_model_carries_a_link():
    assert HUMANOID.links == tuple(f"{name}_link" for name in list(HUMANOID.model.names)[1:])
    assert len(HUMANOID.inertial_parameters) == 10 * len(HUMANOID.links)
    assert len(HUMANOID.dofs) == HUMANOID.nv == HUMANOID.nq - 1
    assert HUMANOID.channels[3:7] == ("root_joint_qx", "root_joint_qy", "root_joint_qz", "root_joint_qw")


def test_slices_of_joints_cover_everything_once():
    for robot in (HUMANOID, ARM):
        for name, length in (("q", robot.nq), ("v", robot.nv), ("channels", len(robot.channels))):
            places = [i for joint in robot.joints for i in range(length)[getattr(joint, name)]]
            assert places == list(range(length))


def test_the_model_is_a_copy():
    model = pin.buildSampleModelManipulator()
    robot = Robot.from_pin(model)
    model.inertias[1] = pin.Inertia.Zero()
    assert robot.model.inertias[1].mass > 0


def test_a_robot_is_frozen_and_can_be_sent_to_another_process():
    with pytest.raises(dataclasses.FrozenInstanceError):
        ARM.name = "other"
    with pytest.raises(ValueError, match="read-only"):
        ARM.inertial_parameters[0] = 1.0
    again = pickle.loads(pickle.dumps(ARM))
    assert again.model == ARM.model
    assert again.dofs == ARM.dofs


@pytest.mark.parametrize(
    ("joint", "axis", "kind"),
    [
        (pin.JointModelRY(), [0, 1, 0], JointKind.REVOLUTE),
        (pin.JointModelRevoluteUnaligned(np.array([0.6, 0.0, 0.8])), [0.6, 0, 0.8], JointKind.REVOLUTE),
        (pin.JointModelRUBX(), [1, 0, 0], JointKind.CONTINUOUS),
        (pin.JointModelPZ(), [0, 0, 1], JointKind.PRISMATIC),
        (pin.JointModelPrismaticUnaligned(np.array([0.0, 0.6, -0.8])), [0, 0.6, -0.8], JointKind.PRISMATIC),
        (pin.JointModelSpherical(), [0, 0, 0], JointKind.SPHERICAL),
        (pin.JointModelPlanar(), [0, 0, 0], JointKind.PLANAR),
    ],
)
def test_a_joint_has_its_kind_and_axis(joint, axis, kind):
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "j")
    (known,) = Robot.from_pin(model).joints
    assert known.kind is kind
    np.testing.assert_allclose(known.axis, axis)


def test_an_unknown_kind_of_joint_is_refused_by_name():
    model = pin.Model()
    model.addJoint(0, pin.JointModelHX(), pin.SE3.Identity(), "screw")
    with pytest.raises(RobotError, match="joint 'screw' is a Pinocchio JointModelHX, which is not supported"):
        Robot.from_pin(model)
    with pytest.raises(RobotError, match="no joint moves"):
        Robot.from_pin(pin.Model())


@settings(max_examples=20, deadline=None)
@given(theta=consistent_parameters(len(ARM.links)), data=st.data())
def test_parameters_given_are_those_of_the_new_model(theta, data):
    armature = np.arange(ARM.nv) / 3
    robot = ARM.with_parameters(inertial_parameters=theta, damping=armature, dry_friction=armature, armature=armature)
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    q, v, a = rng.normal(size=(3, ARM.nv))
    Y = pin.computeJointTorqueRegressor(ARM.model, ARM.model.createData(), q, v, a)
    wanted = Y @ theta + armature * a
    np.testing.assert_allclose(pin.rnea(robot.model, robot.model.createData(), q, v, a), wanted, rtol=1e-10, atol=1e-10)
    np.testing.assert_array_equal(robot.inertial_parameters, theta)
    np.testing.assert_array_equal(robot.model.damping, armature)
    np.testing.assert_array_equal(robot.model.lowerDryFrictionLimit, -armature)
    assert not ARM.armature.any()
    assert not ARM.model.armature.any()


def test_a_massless_link_is_possible_but_not_with_a_first_moment():
    theta = ARM.inertial_parameters.copy()
    theta[:4] = 0.0
    massless = ARM.with_parameters(inertial_parameters=theta)
    np.testing.assert_allclose(massless.model.inertias[1].toDynamicParameters(), theta[:10])
    theta[1] = 1.0
    with pytest.raises(ParameterError, match="link 'shoulder1_joint_link': mass 0 with first moment"):
        ARM.with_parameters(inertial_parameters=theta)

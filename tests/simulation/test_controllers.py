"""Controllers: from files, from parameter vectors, in joint and in operational space."""

import numpy as np
import pinocchio as pin
import pytest

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.robot import Robot
from casysid.simulation import (
    IDEAL,
    PD,
    ComputedTorque,
    ControlModel,
    GravityCompensation,
    OperationalSpace,
    Plant,
    design_sinusoids,
    simulate,
)


@pytest.fixture(scope="module")
def robot():
    return Robot.from_file(find_model("arm.xml"))


@pytest.fixture(scope="module")
def model(robot):
    return ControlModel.from_robot(robot)


def state(robot, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(robot.position_lower, robot.position_upper), *rng.normal(size=(2, robot.nv))


def test_mass_matrix_bias_and_friction_make_up_the_inverse_dynamics(robot, model):
    q, v, a = state(robot)
    friction = model.friction(q[None], v[None])[0]
    whole = model.inverse_dynamics(q[None], v[None], a[None])[0]
    np.testing.assert_allclose(model.mass_matrix(q) @ a + model.bias(q, v) + friction, whole, atol=1e-10)
    np.testing.assert_allclose(
        model.gravity(q), pin.computeGeneralizedGravity(robot.model, robot.model.createData(), q)
    )
    assert np.abs(friction).max() > 0.1


def test_a_model_is_linear_in_parameters_that_are_no_bodies(robot, model):
    q, v, a = (x[None] for x in state(robot))
    other = np.random.default_rng(1).normal(size=model.parameters.size)
    both = ControlModel(model.regressor, model.parameters - 2.0 * other)
    alone = ControlModel(model.regressor, other)
    difference = model.inverse_dynamics(q, v, a) - 2.0 * alone.inverse_dynamics(q, v, a)
    np.testing.assert_allclose(both.inverse_dynamics(q, v, a), difference, atol=1e-9)


def test_a_file_is_as_good_as_its_parameters(robot):
    q, v, a = (x[None] for x in state(robot))
    from_file = ControlModel.from_file(find_model("arm.xml"))
    np.testing.assert_array_equal(
        from_file.inverse_dynamics(q, v, a), ControlModel.from_robot(robot).inverse_dynamics(q, v, a)
    )


@pytest.mark.parametrize("wrong", [np.zeros(3), np.full(140, np.nan)])
def test_parameters_that_do_not_fit_are_refused(robot, wrong):
    with pytest.raises(ParameterError, match="140 finite parameters"):
        ControlModel.from_robot(robot, wrong)


@pytest.mark.parametrize("gain", [-1.0, np.nan, np.zeros(3)])
def test_gains_that_make_no_sense_are_refused(robot, gain):
    with pytest.raises(ParameterError, match="PD: stiffness"):
        PD(robot, gain, 0.0)


def test_gravity_compensation_lets_the_robot_float(robot):
    plant = Plant(robot, IDEAL)
    motion = design_sinusoids(robot, duration=2.0)
    controller = GravityCompensation(ControlModel.from_robot(robot, plant.parameters), PD(robot, 0.0, 0.0))
    run = simulate(plant, controller, motion, rate=480.0, duration=0.5)
    np.testing.assert_allclose(run.q, np.broadcast_to(run.q[0], run.q.shape), atol=1e-6)


def point_at(robot, joint, point, qs):
    data, positions = robot.model.createData(), []
    for q in qs:
        pin.forwardKinematics(robot.model, data, q)
        positions.append(data.oMi[robot.model.getJointId(joint)].act(np.asarray(point)))
    return np.array(positions)


def test_operational_space_control_keeps_the_point_on_its_path(robot):
    plant = Plant(robot, IDEAL)
    model = ControlModel.from_robot(robot, plant.parameters)
    motion = design_sinusoids(robot, duration=3.0, seed=2)
    point = (0.0, 0.0, -0.05)
    controller = OperationalSpace(model=model, joint="wrist_abduction", point=point)
    run = simulate(plant, controller, motion, rate=480.0, duration=2.0)
    path = point_at(robot, "wrist_abduction", point, run.reference.q)
    assert np.ptp(path, axis=0).max() > 0.1
    assert np.abs(point_at(robot, "wrist_abduction", point, run.q) - path).max() < 2e-3


def test_operational_space_feedforward_is_inverse_dynamics_on_the_path(robot, model):
    motion = design_sinusoids(robot, duration=3.0).sample(np.array([1.3]))
    controller = OperationalSpace(model=model, joint="elbow", point=np.zeros(3))
    command = controller.react(motion.q[0], motion.v[0], motion, 0)
    np.testing.assert_allclose(command.feedback, 0.0, atol=1e-10)
    whole = model.inverse_dynamics(motion.q, motion.v, motion.a)[0]
    np.testing.assert_allclose(controller.plan(motion)[0] + command.model, whole, atol=1e-3)


def test_operational_space_refuses_what_it_cannot_divide_by(robot, model):
    with pytest.raises(ParameterError, match="no joint 'knee'"):
        OperationalSpace(model=model, joint="knee", point=np.zeros(3))
    with pytest.raises(ParameterError, match="not positive definite"):
        OperationalSpace(model=ControlModel(model.regressor, -model.parameters), joint="elbow", point=np.zeros(3))


def test_feedback_is_measured_on_the_way_round_for_continuous_joints():
    pin_model = pin.Model()
    joint = pin_model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "wheel")
    pin_model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    robot = Robot.from_pin(pin_model)
    motion = design_sinusoids(robot, duration=2.0).sample(np.array([0.0]))
    at = np.array([np.cos(3.0), np.sin(3.0)])
    torque = PD(robot, 1.0, 0.0).torque(at, np.zeros(1), motion, 0)
    assert torque[0] == pytest.approx(np.arctan2(motion.q[0, 1], motion.q[0, 0]) - 3.0)


def test_computed_torque_needs_no_feedback_on_the_path(robot, model):
    motion = design_sinusoids(robot, duration=3.0).sample(np.linspace(1.0, 2.0, 5))
    controller = ComputedTorque(model, PD.tuned(robot))
    np.testing.assert_array_equal(controller.plan(motion), model.inverse_dynamics(motion.q, motion.v, motion.a))
    assert (controller.react(motion.q[2], motion.v[2], motion, 2).feedback == 0).all()

"""The symbolic dynamics against Pinocchio, on random trees of all kinds of joints."""

import shutil
import subprocess

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.dynamics import Dynamics, build_dynamics, generate_c
from casysid.errors import ParameterError
from casysid.robot import JointKind, Robot
from tests.strategies import ALL_KINDS, Motion, motions, random_robot, robots

quick = settings(max_examples=25, deadline=None)


@st.composite
def moving_robots(draw) -> tuple[Robot, Dynamics, Motion]:
    robot = draw(robots())
    return robot, build_dynamics(robot), draw(motions(robot))


def assert_close(got, wanted, relative=1e-10):
    wanted = np.asarray(wanted, dtype=float)
    np.testing.assert_allclose(np.asarray(got).reshape(wanted.shape), wanted, rtol=0, atol=relative * scale(wanted))


def scale(values):
    return max(np.abs(values).max(initial=0.0), 1.0)


@quick
@given(moving_robots())
def test_every_function_agrees_with_pinocchio(case):
    robot, dynamics, motion = case
    model, data, theta = robot.model, robot.model.createData(), robot.inertial_parameters
    for q, v, a in zip(*motion, strict=True):
        tau = pin.rnea(model, data, q, v, a)
        assert_close(dynamics.inverse_dynamics(q, v, a, theta, robot.armature).full(), tau)
        assert_close(dynamics.mass_matrix(q, theta, robot.armature).full(), pin.crba(model, data, q))
        assert_close(dynamics.bias(q, v, theta).full(), pin.nle(model, data, q, v))
        assert_close(dynamics.gravity(q, theta).full(), pin.computeGeneralizedGravity(model, data, q))
        assert_close(dynamics.regressor(q, v, a).full(), pin.computeJointTorqueRegressor(model, data, q, v, a))
        assert_close(
            dynamics.forward_dynamics(q, v, tau, theta, robot.armature).full(), pin.aba(model, data, q, v, tau)
        )


@quick
@given(moving_robots())
def test_frames_are_where_pinocchio_puts_them(case):
    robot, dynamics, motion = case
    model, data = robot.model, robot.model.createData()
    for q in motion.q:
        pin.forwardKinematics(model, data, q)
        rotation, translation = (x.full() for x in dynamics.forward_kinematics(q))
        for i in range(len(robot.joints)):
            assert_close(rotation[:, 3 * i : 3 * i + 3], data.oMi[i + 1].rotation)
            assert_close(translation[:, i], data.oMi[i + 1].translation)


@quick
@given(moving_robots())
def test_bias_is_coriolis_and_gravity_and_inverse_dynamics_adds_the_mass(case):
    robot, dynamics, motion = case
    theta = robot.inertial_parameters
    for q, v, a in zip(*motion, strict=True):
        bias = dynamics.bias(q, v, theta)
        assert_close((dynamics.coriolis(q, v, theta) + dynamics.gravity(q, theta)).full(), bias.full())
        mass = dynamics.mass_matrix(q, theta, robot.armature)
        assert_close(mass.full(), mass.full().T)
        assert np.linalg.eigvalsh(mass.full()).min() > 0
        assert_close(dynamics.inverse_dynamics(q, v, a, theta, robot.armature).full(), (mass @ a + bias).full())


@quick
@given(moving_robots())
def test_inverse_dynamics_is_linear_in_the_parameters(case):
    robot, dynamics, motion = case
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(2, robot.inertial_parameters.size))
    q, v, a = (x[0] for x in motion)

    def torque(theta):
        return dynamics.inverse_dynamics(q, v, a, theta, 0).full().ravel()

    assert_close(torque(2 * one - 3 * other), 2 * torque(one) - 3 * torque(other))
    assert_close(dynamics.regressor(q, v, a).full() @ one, torque(one))


def test_derivatives_come_with_the_functions():
    robot = random_robot(np.random.default_rng(1), [JointKind.REVOLUTE] * 3)
    gravity = build_dynamics(robot).gravity
    q = np.array([0.3, -0.4, 0.5])
    jacobian = gravity.jacobian()(q, robot.inertial_parameters, 0)[0].full()
    numeric = [
        (gravity(q + step, robot.inertial_parameters) - gravity(q - step, robot.inertial_parameters)).full().ravel()
        / 2e-6
        for step in 1e-6 * np.eye(3)
    ]
    assert_close(jacobian, np.column_stack(numeric), relative=1e-7)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_generated_c_compiles_and_agrees(tmp_path):
    robot = random_robot(np.random.default_rng(2), ALL_KINDS)
    dynamics = build_dynamics(robot)
    source = generate_c([dynamics.mass_matrix, dynamics.gravity], tmp_path / "arm.c")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arm.c", "arm.h"]
    library = tmp_path / "arm.so"
    subprocess.run(["gcc", "-O1", "-fPIC", "-shared", source, "-o", library, "-lm"], check=True)
    compiled = ca.external("mass_matrix", str(library))
    q = np.linspace(-1, 1, robot.nq)
    wanted = dynamics.mass_matrix(q, robot.inertial_parameters, robot.armature).full()
    assert_close(compiled(q, robot.inertial_parameters, robot.armature).full(), wanted)


@pytest.mark.parametrize("name", ["arm.cpp", "my-arm.c"])
def test_c_source_with_an_unusable_name_is_refused(tmp_path, name):
    robot = random_robot(np.random.default_rng(3), [JointKind.REVOLUTE])
    with pytest.raises(ParameterError, match=r"named <identifier>\.c"):
        generate_c([build_dynamics(robot).gravity], tmp_path / name)
    assert not list(tmp_path.iterdir())

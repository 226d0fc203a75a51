"""The MuJoCo model of a robot is that robot."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import ParameterError, RobotError
from casysid.robot import JointKind, Robot
from casysid.robot.coordinates import channels_from_configuration
from casysid.simulation import IDEAL, Plant
from casysid.simulation.truth import drive_parameters
from tests.strategies import random_inertia, random_motion, robots

DRIVEN = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC, JointKind.SPHERICAL, JointKind.FREE_FLYER)
seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def assert_same_inverse_dynamics(robot, rng):
    plant = Plant(robot, IDEAL)
    machine, coordinates = plant.build(1e-3), plant.coordinates
    viscous, _, _, armature = drive_parameters(robot, plant.parameters)
    machine.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    data, model = mujoco.MjData(machine.model), robot.with_parameters(armature=armature).model
    reference = model.createData()
    for q in random_motion(robot, rng, 5).q:
        channels = channels_from_configuration(robot, q[None])[0]
        rates, change = rng.normal(size=(2, robot.nv))
        data.qpos[machine.positions], data.qvel[machine.rates], data.qacc[machine.rates] = channels, rates, change
        mujoco.mj_inverse(machine.model, data)
        v, a = coordinates.velocity(channels, rates), coordinates.acceleration(channels, rates, change)
        tau = pin.rnea(model, reference, q, v, a) + viscous * v
        got = coordinates.force(channels, data.qfrc_inverse[machine.rates])
        np.testing.assert_allclose(got, tau, rtol=0, atol=1e-11 * (1 + np.abs(tau).max()))


@settings(max_examples=25, deadline=None)
@given(robots(kinds=DRIVEN), seeds)
def test_inverse_dynamics_are_pinocchios(robot, rng):
    assert_same_inverse_dynamics(robot, rng)


def test_planar_joints_and_branches_added_late_are_right_too():
    rng, model = np.random.default_rng(0), pin.Model()
    parents = {}
    for name, kind, parent in (
        ("base", pin.JointModelPlanar(), None),
        ("left", pin.JointModelRX(), "base"),
        ("right", pin.JointModelPlanar(), "base"),
        ("left_tip", pin.JointModelSpherical(), "left"),
        ("right_tip", pin.JointModelRUBZ(), "right"),
    ):
        parents[name] = model.addJoint(parents.get(parent, 0), kind, pin.SE3.Random(), name)
        model.appendBodyToJoint(parents[name], random_inertia(rng), pin.SE3.Identity())
    assert_same_inverse_dynamics(Robot.from_pin(model), rng)


def test_two_joints_on_one_mjcf_body_are_two_joints(tmp_path):
    path = tmp_path / "knuckle.xml"
    path.write_text(
        '<mujoco><worldbody><body name="finger">'
        '<joint name="a" axis="0 1 0"/><joint name="b" axis="1 0 0" pos="0 0 .1"/>'
        '<inertial pos=".1 .02 .03" mass="1" diaginertia=".01 .02 .015"/></body></worldbody></mujoco>'
    )
    robot = Robot.from_file(path)
    assert [joint.link for joint in robot.joints] == [None, "finger"]
    plant = Plant(robot, IDEAL)
    machine = plant.build(1e-3)
    data = mujoco.MjData(machine.model)
    data.qpos[:], data.qvel[:], data.qacc[:] = (0.3, -0.4), (1.0, 2.0), (3.0, -1.0)
    machine.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    mujoco.mj_inverse(machine.model, data)
    viscous, _, _, armature = drive_parameters(robot, plant.parameters)
    tau = pin.rnea(robot.model, robot.model.createData(), data.qpos.copy(), data.qvel.copy(), data.qacc.copy())
    np.testing.assert_allclose(data.qfrc_inverse, tau + viscous * data.qvel + armature * data.qacc, atol=1e-6)


def inertial(robot, **changes):
    """The file's parameters and no friction, with some of the last link's ten replaced."""
    theta = np.concatenate([robot.inertial_parameters, np.zeros(4 * robot.nv)])
    for at, value in changes.items():
        theta[10 * (len(robot.links) - 1) + int(at.removeprefix("p"))] = value
    return theta


def test_an_inertia_that_misses_the_triangle_inequality_is_simulated_as_it_is():
    robot = Robot.from_file(find_model("two_link"))
    theta = inertial(robot, p9=0.5)  # Izz far beyond Ixx + Iyy: MuJoCo's compiler refuses it
    machine = Plant(robot, IDEAL, theta).build(1e-3)
    data = mujoco.MjData(machine.model)
    data.qacc[:] = 0.0, 1.0
    mujoco.mj_inverse(machine.model, data)
    model = robot.with_parameters(inertial_parameters=theta[:20]).model
    want = pin.rnea(model, model.createData(), np.zeros(2), np.zeros(2), np.array([0.0, 1.0]))
    np.testing.assert_allclose(data.qfrc_inverse, want, rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"p0": -1.0}, "give it mass"), ({"p0": 0.0}, "give it mass"), ({"p9": -5.0}, "not positive")],
)
def test_what_cannot_exist_is_refused_by_name(changes, message):
    robot = Robot.from_file(find_model("two_link"))
    with pytest.raises(RobotError, match=f"fore_link.*{message}"):
        Plant(robot, IDEAL, inertial(robot, **changes)).build(1e-3)


def test_a_last_link_without_mass_or_armature_is_refused():
    robot = Robot.from_file(find_model("two_link"))
    nothing = inertial(robot, **{f"p{k}": 0.0 for k in range(10)})
    with pytest.raises(RobotError, match="moves no mass"):
        _ = Plant(robot, IDEAL, nothing).fastest_decay


def test_friction_of_a_planar_joint_is_refused():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    model.damping = np.ones(3)
    with pytest.raises(RobotError, match=r"'cart'.*planar"):
        Plant(Robot.from_pin(model), IDEAL).build(1e-3)


@pytest.mark.parametrize("parameters", [np.zeros(3), np.full(28, np.nan), -np.ones(28)])
def test_parameters_that_cannot_be_are_refused_at_once(parameters):
    with pytest.raises(ParameterError, match="two_link"):
        Plant(Robot.from_file(find_model("two_link")), given=parameters)

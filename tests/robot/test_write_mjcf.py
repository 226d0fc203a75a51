import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from casysid.robot import Robot, write_robot
from tests.robot.bodies import consistent_parameters
from tests.robot.mjcf_models import CASES


def robot_of(tmp_path, text, **options):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return Robot.from_mjcf(path, **options)


def torque_of_regressor(robot, theta, armature, q, v, a):
    """Pinocchio's joint torque regressor, columns of carried links only, times parameters."""
    Y = pin.computeJointTorqueRegressor(robot.model, robot.model.createData(), q, v, a).reshape(robot.nv, -1)
    columns = np.concatenate([np.arange(10 * k, 10 * k + 10) for k, j in enumerate(robot.joints) if j.link is not None])
    return Y[:, columns] @ theta + armature * a


@pytest.mark.parametrize("name", CASES)
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_written_model_moves_as_its_parameters_say(name, data, tmp_path):
    robot = robot_of(tmp_path, CASES[name])
    theta = data.draw(consistent_parameters(len(robot.links)))
    damping, friction, armature = (np.zeros(robot.nv) for _ in range(3))
    for i, joint in enumerate(robot.joints):
        damping[joint.v], friction[joint.v], armature[joint.v] = 0.1 * i + 1 / 3, 0.2 * i + 1 / 7, 0.01 * i + 0.1 / 3
    if "free" in name:
        damping, friction, armature = robot.damping, robot.dry_friction, robot.armature
    written = write_robot(robot, tmp_path / "new.xml", theta, damping=damping, dry_friction=friction, armature=armature)
    again = Robot.from_mjcf(written.path)
    rng = np.random.default_rng(0)
    for _ in range(3):
        q, v, a = pin.randomConfiguration(unlimited(robot)), rng.normal(size=robot.nv), rng.normal(size=robot.nv)
        wanted = torque_of_regressor(robot, theta, armature, q, v, a)
        got = pin.rnea(again.model, again.model.createData(), q, v, a)
        np.testing.assert_allclose(got, wanted, atol=1e-9 * abs(wanted).max())
    np.testing.assert_allclose(again.damping, damping, rtol=1e-14)
    np.testing.assert_allclose(again.dry_friction, friction, rtol=1e-14)


def unlimited(robot):
    model = robot.model.copy()
    model.lowerPositionLimit, model.upperPositionLimit = np.full(model.nq, -1.0), np.full(model.nq, 1.0)
    return model

"""``casysid pose`` as a person meets it."""

import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

from casysid.bundled import find_model
from casysid.cli.app import app
from casysid.robot import Robot


def run(*arguments):
    return CliRunner().invoke(app, ["pose", *map(str, arguments)], env={"COLUMNS": "100"})


def test_pose_is_pinocchios():
    q = [0.5, -0.3, -0.01, 0.2]
    robot = Robot.from_file(find_model("scara"))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.array(q))
    wanted = data.oMf[robot.model.getFrameId("tool", pin.FrameType.BODY)]
    answer = run("scara", "--frame", "tool", *q)
    assert answer.exit_code == 0, answer.output
    for value in [
        *wanted.translation,
        *pin.Quaternion(wanted.rotation).coeffs(),
        *pin.rpy.matrixToRpy(wanted.rotation),
    ]:
        assert f"{value + 0.0:.6f}" in answer.stdout
    assert "manipulability" in answer.stdout
    assert "Centre of mass" in answer.stdout
    assert not answer.stderr


def test_without_a_frame_all_are_listed():
    answer = run("scara")
    assert answer.exit_code == 0, answer.output
    for frame in ("base", "inner_arm", "tool", "shoulder", "roll"):
        assert frame in answer.stdout


def test_positions_by_name_and_in_degrees():
    by_order = run("scara", "--frame", "tool", "0", np.pi / 4, "0.01", "0").stdout
    assert run("scara", "--frame", "tool", f"elbow={np.pi / 4}", "lift=0.01").stdout == by_order
    assert run("scara", "--frame", "tool", "--degrees", "elbow=45", "lift=0.01").stdout == by_order


def test_positions_beyond_limits_are_noted():
    answer = run("scara", "lift=5")
    assert answer.exit_code == 0
    assert "joint lift is outside its limits" in answer.stderr


def test_a_floating_base_has_quaternions():
    answer = run("scara", "--floating-base", "root_joint_x=3", "--frame", "tool")
    assert answer.exit_code == 0, answer.output
    assert "3.600000" in answer.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["scara", "--frame", "tol"], "no frame 'tol'; did you mean 'tool'?"),
        (["scara", "1", "2"], "wanted 4, for shoulder, elbow, lift, roll; got 2"),
        (["scara", "1", "2", "x", "4"], "wanted a number [rad or m] for 'lift'"),
        (["scara", "1", "2", "nan", "4"], "POSITION wants -10000 to 10000"),
        (["scara", "wrist=3"], "'wrist' is no channel"),
        (["scara", "elbow=3", "4"], "all as CHANNEL=POSITION or none"),
        (["scara", "--fram", "tool"], "there is no option '--fram'"),
        (["scara", "--floating-base", "root_joint_qw=0"], "the quaternion of sample 0 is zero"),
        (["nowhere.urdf"], "nowhere.urdf"),
    ],
)
def test_bad_input_gets_one_message_and_exit_code_2(arguments, message):
    answer = run(*arguments)
    assert answer.exit_code == 2
    assert answer.stderr.count("error:") == 1
    assert message in " ".join(answer.stderr.split())
    assert not answer.stdout

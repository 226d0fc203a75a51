"""``casysid reach`` as a person meets it."""

import numpy as np
import pytest
from typer.testing import CliRunner

from casysid.bundled import find_model
from casysid.cli.app import app
from casysid.kinematics import Kinematics
from casysid.robot import Robot

SCARA = ("scara", "--frame", "tool")


def run(*arguments):
    return CliRunner().invoke(app, ["reach", *map(str, arguments)], env={"COLUMNS": "100"})


def positions(answer, channels=("shoulder", "elbow", "lift", "roll")):
    lines = [line.split() for line in answer.stdout.splitlines()]
    return [float(next(words[1] for words in lines if words and words[0] == name)) for name in channels]


def test_what_is_found_is_where_it_should_be():
    robot = Robot.from_file(find_model("scara"))
    kinematics = Kinematics(robot)
    wanted = kinematics.poses("tool", [0.5, -0.7, -0.1, 0.3])
    answer = run(*SCARA, "--at", *wanted.translation, "--rpy", *wanted.rpy)
    assert answer.exit_code == 0, answer.output
    got = kinematics.poses("tool", positions(answer))
    np.testing.assert_allclose(got.translation, wanted.translation, atol=2e-6)
    np.testing.assert_allclose(got.rotation, wanted.rotation, atol=2e-6)
    assert "reached" in answer.stderr


def test_degrees_and_a_start():
    answer = run(*SCARA, "--at", 0.4, 0.2, 0.2, "--rpy", 0, 0, 30, "--degrees", "--start", "10,20,-0.1,0")
    assert answer.exit_code == 0, answer.output
    again = run(*SCARA, "--at", 0.4, 0.2, 0.2, "--rpy", 0, 0, np.pi / 6, "--start", f"{np.pi / 18},{np.pi / 9},-0.1,0")
    np.testing.assert_allclose(positions(answer), positions(again), atol=1e-6)


def test_out_of_reach_is_said_with_what_is_left():
    answer = run(*SCARA, "--at", 2, 0, 0.2)
    assert answer.exit_code == 1
    assert "not reached; this is the nearest posture found" in answer.stderr
    assert "1.4e+03" in answer.stdout


def test_distances_and_rest():
    answer = run(*SCARA, "--at", 0.4, 0.2, 0.2, "--clearance", 0.01, "--floor", 0, "--rest", "0.3,0.5,-0.1,0")
    assert answer.exit_code == 0, answer.output
    assert "least distance" in answer.stderr


def test_an_eye_looks_at_a_point():
    answer = run("head", "--frame", "left_eye", "--look-at", 2, 1, 1, "--axis", 1, 0, 0)
    assert answer.exit_code == 0, answer.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*SCARA], "wanted something to reach"),
        (["scara", "--frame", "tol", "--at", 0, 0, 0], "no frame 'tol'; did you mean 'tool'?"),
        ([*SCARA, "--at", "nan", 0, 0], "--at wants -10000 to 10000 m"),
        ([*SCARA, "--look-at", 1, 0, 0, "--axis", 0, 0, 0], "axis that looks must not be zero"),
        ([*SCARA, "--at", 0, 0, 0, "--start", "1,2"], "wanted 4, for shoulder, elbow, lift, roll; got 2"),
        ([*SCARA, "--at", 0, 0, 0, "--rest", "1,2,x,4"], "wanted a number"),
        ([*SCARA, "--at", 0, 0, 0, "--clearance", "-1"], "--clearance wants 0 to 10 m"),
        ([*SCARA, "--at", 0, 0, 0, "--box", "1,2"], "--box wants 6 numbers"),
        ([*SCARA, "--floating-base", "--at", 0, 0, 0, "--clearance", "0.1"], "several degrees of freedom"),
    ],
)
def test_bad_input_gets_one_message_and_exit_code_2(arguments, message):
    answer = run(*arguments)
    assert answer.exit_code == 2, answer.output
    assert answer.stderr.count("error:") == 1
    assert message in " ".join(answer.stderr.split())
    assert not answer.stdout

"""Ranks and manipulability of known mechanisms."""

import numpy as np
import pinocchio as pin
import pytest

from casysid.bundled import find_model
from casysid.kinematics import Frame, Kinematics, dexterity_at, random_configurations
from casysid.robot import Robot

UPPER, FORE = 0.4, 0.3  # [m]
TIP = Frame(name="tip", joint=1, rotation=np.eye(3), translation=np.array([FORE, 0.0, 0.0]))


@pytest.fixture(scope="module")
def planar_arm():
    model = pin.Model()
    shoulder = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "shoulder")
    model.addJoint(shoulder, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([UPPER, 0.0, 0.0])), "elbow")
    return Kinematics(Robot.from_pin(model))


@pytest.mark.parametrize("bend", [0.2, 1.0, -2.0])
def test_a_planar_arm_turns_about_one_axis_and_moves_in_a_plane(planar_arm, bend):
    found = dexterity_at(planar_arm, TIP, np.array([0.4, bend]))
    assert found.ranks == found.usual == (2, 1, 2)
    assert not found.is_singular
    np.testing.assert_allclose(found.manipulability, [UPPER * FORE * abs(np.sin(bend)), np.sqrt(2.0)], rtol=1e-12)


def test_a_stretched_arm_is_singular(planar_arm):
    found = dexterity_at(planar_arm, TIP, np.zeros(2))
    assert found.is_singular
    assert found.ranks == (1, 1, 2)
    assert found.manipulability[0] < 1e-12


def test_what_does_not_move_has_no_rank(planar_arm):
    ground = Frame(name="ground", joint=-1, rotation=np.eye(3), translation=np.zeros(3))
    found = dexterity_at(planar_arm, ground, np.zeros(2))
    assert found.ranks == found.usual == (0, 0, 0)
    assert found.manipulability == (0.0, 0.0)


def test_random_configurations_keep_the_limits():
    robot = Robot.from_file(find_model("arm"))
    q = random_configurations(robot, np.random.default_rng(0), 1000)
    assert (q >= robot.position_lower).all()
    assert (q <= robot.position_upper).all()
    middle, half = (robot.position_lower + robot.position_upper) / 2, (robot.position_upper - robot.position_lower) / 2
    np.testing.assert_allclose((q.mean(axis=0) - middle) / half, 0.0, atol=5 / np.sqrt(3 * 1000))

"""What the motion of a free base says of its own columns."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from casysid.bundled import find_model
from casysid.errors import RecordingError
from casysid.readers.base_motion import BaseMotion
from casysid.readers.generalised import continued_signs
from casysid.recording import Recording
from casysid.robot import Robot

TIME = np.arange(400) * 0.01


@pytest.fixture(scope="module")
def robot():
    return Robot.from_file(find_model("quadrotor"))


def turning(start=(0.0, 0.0, 0.0)):
    """Place, orientation, and twist in the body and in the world, of a base that turns about an axis of its own."""
    axis, angle, rate = np.array([0.48, 0.6, 0.64]), 1.5 * np.sin(2.0 * TIME), 3.0 * np.cos(2.0 * TIME)
    R = Rotation.from_rotvec(start) * Rotation.from_rotvec(angle[:, None] * axis)
    place = np.column_stack([np.sin(TIME), np.cos(1.3 * TIME), TIME**2 / 4.0])
    speed = np.column_stack([np.cos(TIME), -1.3 * np.sin(1.3 * TIME), TIME / 2.0])
    body = rate[:, None] * axis
    return place, R.as_quat(), (R.inv().apply(speed), body), (speed, R.apply(body))


def looked_at(robot, place, quaternion, twist):
    looked = BaseMotion(robot, "log")
    velocity = None if twist is None else np.hstack(twist)
    looked.add(
        Recording(
            channels=robot.channels,
            dofs=robot.dofs,
            time=TIME,
            position=np.hstack([place, quaternion]),
            velocity=velocity,
            torque=np.zeros((len(TIME), 6)),
        )
    )
    return looked


def test_the_axes_of_a_twist_are_found(robot):
    place, quaternion, body, world = turning()
    for linear, angular, found in (
        (body[0], body[1], ()),
        (world[0], body[1], ("linear",)),
        (body[0], world[1], ("angular",)),
        (world[0], world[1], ("linear", "angular")),
    ):
        if angular is world[1]:  # about a fixed axis both are the same
            angular, found = world[1], tuple(part for part in found if part == "linear")
        assert looked_at(robot, place, quaternion, (linear, angular)).twist_in_world() == found


def test_angular_velocity_along_the_worlds_axes_is_found(robot):
    place, quaternion, body, world = turning(start=(0.9, -0.5, 0.3))
    assert looked_at(robot, place, quaternion, (body[0], world[1])).twist_in_world() == ("angular",)


def test_a_quaternion_with_w_first_is_refused(robot):
    place, quaternion, body, _ = turning()
    assert looked_at(robot, place, quaternion, body).check_order() == ""
    with pytest.raises(RecordingError, match="read with w first"):
        looked_at(robot, place, quaternion[:, [3, 0, 1, 2]], body).check_order()


def test_without_a_twist_a_base_upside_down_is_doubted(robot):
    place = turning()[0]
    upright = Rotation.from_rotvec(0.3 * np.sin(TIME)[:, None] * np.array([1.0, 0.0, 0.0])).as_quat()
    assert looked_at(robot, place, upright, None).check_order() == ""
    assert "upside down" in looked_at(robot, place, upright[:, [3, 0, 1, 2]], None).check_order()


def test_signs_are_continued_across_pieces():
    quaternion = turning()[1]
    smooth = continued_signs(quaternion, np.empty(0))
    jumping = quaternion * np.where(np.random.default_rng(0).random(len(TIME)) < 0.5, -1.0, 1.0)[:, None]
    first = continued_signs(jumping[:150], np.empty(0))
    rest = continued_signs(jumping[150:], first[-1])
    continued = np.concatenate([first, rest])
    np.testing.assert_array_equal(continued, smooth * np.sign(np.sum(continued[0] * smooth[0])))

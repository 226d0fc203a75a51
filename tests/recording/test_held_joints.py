"""A lock is compared with what the log shows of the joint."""

import numpy as np
import pytest

from casysid.bundled import find_model
from casysid.recording.held_joints import held_joint_remark
from casysid.robot import Robot


@pytest.fixture
def log(tmp_path):
    """Writes positions of both joints of the two-link arm."""

    def write(elbow):
        time = np.linspace(0.0, 1.0, len(elbow))
        table = np.column_stack([time, np.sin(time), elbow, time, time])
        path = tmp_path / "log.csv"
        header = "time,q_shoulder,q_elbow,tau_shoulder,tau_elbow"
        np.savetxt(path, table, delimiter=",", header=header, comments="")
        return path

    return write


@pytest.fixture
def robot():
    """With its elbow locked at 0.5."""
    return Robot.from_file(find_model("two_link.urdf"), locked={"elbow": 0.5})


def test_a_joint_that_rests_where_it_is_locked_needs_no_word(log, robot):
    assert held_joint_remark(log(0.5 + 1e-3 * np.sin(np.arange(50.0))), robot) == ""
    assert held_joint_remark(log(np.ones(50)), Robot.from_file(find_model("two_link.urdf"))) == ""


def test_a_joint_that_moves_is_named_with_how_far(log, robot):
    remark = held_joint_remark(log(np.linspace(0.0, 1.25, 50)), robot)
    assert "q_elbow moves by 1.25" in remark
    assert "do not lock it" in remark


def test_a_joint_that_rests_elsewhere_is_named_with_the_lock_to_copy(log, robot):
    assert "q_elbow rests at 1.5, not at 0.5: --lock elbow=1.5" in held_joint_remark(log(np.full(50, 1.5)), robot)

"""Joints that follow others are held where they stand beside their leaders."""

import pytest

from casysid.bundled import find_model
from casysid.cli.options import load_robot
from casysid.errors import CasysidWarning, RobotError
from casysid.robot import Robot
from casysid.robot.following import following_joints

MIMICS = {
    "no": "",
    "follower": '<mimic joint="lead" multiplier="-2" offset="0.25"/>',
    "second": '<mimic joint="follower" multiplier="3"/>',
    "narrow": '<mimic joint="lead" multiplier="100" offset="9"/>',
}


@pytest.fixture
def file(tmp_path):
    """Writes a chain of joints on one leader, with these words in them."""

    def write(mimics):
        names = ["lead", *mimics]
        links = "".join(
            f'<link name="l_{name}"><inertial><mass value="1"/>'
            '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            for name in names
        )
        joints = "".join(
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="l_{name}"/><axis xyz="0 1 0"/>'
            f'<limit lower="-1" upper="1" velocity="1" effort="1"/>{mimics.get(name, "")}</joint>'
            for name, parent in zip(names, ["base", *(f"l_{name}" for name in names)], strict=False)
        )
        path = tmp_path / "gripper.urdf"
        path.write_text(f'<robot name="gripper"><link name="base"/>{links}{joints}</robot>')
        return path

    return write


def test_followers_stand_beside_their_leaders_within_their_limits(file):
    path = file(MIMICS)
    assert following_joints(path, {}) == pytest.approx({"follower": 0.25, "second": 0.75, "narrow": 1.0})
    held = {"lead": 0.25}
    assert following_joints(path, held) == pytest.approx({"follower": -0.25, "second": -0.75, "narrow": 1.0})
    assert Robot.from_file(path, locked=following_joints(path, {})).dofs == ("lead", "no")


def test_lock_auto_holds_them_and_says_so(file):
    with pytest.warns(CasysidWarning, match="held: --lock follower=0.25 --lock second=0.75 --lock narrow=1. Where"):
        robot = load_robot(str(file(MIMICS)), None, ["auto", "no=0.5"], False)
    assert robot.dofs == ("lead",)


def test_a_model_without_followers_needs_no_lock():
    assert following_joints(find_model("two_link.urdf"), {}) == {}
    assert following_joints(find_model("arm.xml"), {}) == {}


@pytest.mark.parametrize(
    ("mimic", "words"),
    [
        ('joint="lead" multiplier="two"', "of <mimic>: wanted a number; got 'two'"),
        ('joint="a"', "in a ring"),
    ],
)
def test_what_cannot_be_followed_is_refused(file, mimic, words):
    with pytest.raises(RobotError, match=words):
        following_joints(file({"a": f"<mimic {mimic}/>"}), {})

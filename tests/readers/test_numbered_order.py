"""Numbers count the joints as the model file has them, whatever order Pinocchio gives a link's children."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from casysid.readers.columns import match_columns
from casysid.robot import Robot

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
JOINT = (
    '<joint name="{0}" type="revolute"><parent link="base"/><child link="l_{0}"/><axis xyz="0 1 0"/>'
    '<limit effort="1" velocity="1" lower="-1" upper="1"/></joint>'
)


@pytest.mark.parametrize("names", [("right", "left"), ("left", "right"), ("c", "a", "b")])
def test_a_robot_knows_the_order_of_its_file(names, tmp_path):
    parts = [
        '<link name="base"/>',
        *(f'<link name="l_{name}">{INERTIAL}</link>' for name in names),
        *map(JOINT.format, names),
    ]
    (tmp_path / "arms.urdf").write_text(f'<robot name="arms">{"".join(parts)}</robot>')
    robot = Robot.from_file(tmp_path / "arms.urdf")
    assert robot.dofs == tuple(sorted(names))
    assert robot.numbered == (names, names)


@given(st.permutations(["a", "b", "c", "d"]))
def test_numbered_columns_go_where_the_file_has_their_joints(counted):
    own = ("a", "b", "c", "d")
    found = ("time", *(f"q{k}" for k in range(1, 5)), *(f"tau{k}" for k in range(1, 5)))
    layout = match_columns(found, own, own, "log", numbered=(counted, counted))
    for k, name in enumerate(own):
        number = int(np.flatnonzero(np.array(counted) == name)[0]) + 1
        assert (layout.position[k], layout.torque[k]) == (f"q{number}", f"tau{number}")

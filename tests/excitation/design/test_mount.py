import numpy as np
import pytest

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.excitation import build_excitation, design_excitation
from casysid.excitation.constraints.keep_clear import ClearanceConstraint
from casysid.robot import Robot

LEG = """<robot name="leg"><link name="base"/><link name="l"><inertial><mass value="1"/><origin xyz="0 0 {0}"/>
<inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial>
<collision><origin xyz="0 0 {0}"/><geometry><sphere radius=".05"/></geometry></collision></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="l"/><origin xyz="0 0 {1}"/><axis xyz="0 1 0"/>
<limit lower="-1.2" upper="1.2" velocity="2" effort="50"/></joint></robot>"""


def planes(problem):
    kept = [one for one in problem.constraints if isinstance(one, ClearanceConstraint)]
    return [(plane.name, plane.offset) for one in kept for plane in one.every.obstacles]


def robot_of(path, lever, height):
    path.write_text(LEG.format(lever, height))
    return Robot.from_file(path)


def test_a_robot_stands_on_the_plane_under_its_base_and_says_so(tmp_path):
    problem = build_excitation(robot_of(tmp_path / "arm.urdf", 0.4, 0.2))
    assert planes(problem) == [("floor", 0.0)]
    assert "stands on a floor at 0 m" in problem.notes[0]


def test_a_robot_that_hangs_has_no_floor_and_says_so(tmp_path):
    problem = build_excitation(robot_of(tmp_path / "leg.urdf", -0.4, 0.2))
    assert planes(problem) == []
    assert "hangs" in problem.notes[0]


def test_a_robot_below_its_base_wherever_its_joints_are_has_no_floor(tmp_path):
    problem = build_excitation(robot_of(tmp_path / "low.urdf", 0.05, 0.0))
    assert planes(problem) == []
    assert "no floor" in problem.notes[0]


def test_the_floor_of_the_file_is_kept_clear_of(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(
        '<mujoco><worldbody><geom type="plane" size="1 1 1" pos="0 0 -.3"/><body name="l" pos="0 0 .2">'
        '<joint name="j" axis="0 1 0" range="-70 70"/><geom type="capsule" fromto="0 0 0 0 0 .4" size=".03"/>'
        "</body></worldbody></mujoco>"
    )
    assert planes(build_excitation(Robot.from_file(path))) == [("floor", pytest.approx(-0.3))]


@pytest.mark.parametrize(("floor", "offsets"), [(None, []), (-0.7, [-0.7])])
def test_a_floor_can_be_dropped_or_put_elsewhere(tmp_path, floor, offsets):
    problem = build_excitation(robot_of(tmp_path / "arm.urdf", 0.4, 0.2), floor=floor)
    assert [offset for _, offset in planes(problem)] == offsets


@pytest.mark.parametrize("floor", ["ground", np.nan])
def test_other_words_are_refused(tmp_path, floor):
    with pytest.raises(ParameterError, match="floor must be a height"):
        build_excitation(robot_of(tmp_path / "arm.urdf", 0.4, 0.2), floor=floor)


def test_a_designed_motion_stays_above_the_floor_that_nobody_asked_for():
    problem = build_excitation(Robot.from_file(find_model("two_link.urdf")))
    design = design_excitation(problem, starts=1, max_iterations=30)
    distances = problem.solids.distances(design.trajectory.motion(problem.series.grid(500)).position)
    above = [k for k, label in enumerate(problem.solids.labels) if "floor" in label]
    assert distances[:, above].min(initial=np.inf) > 0.0

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from casysid.errors import OutputError, ParameterError, RobotError
from casysid.robot import Robot, write_robot
from tests.robot.bodies import consistent_parameters
from tests.robot.urdf_models import ARM, trees

REAL = sorted((Path(__file__).parents[3] / "shared" / "data").glob("*/*.urdf"))
BODY = np.array([2.0, 0.1, 0.2, 0.3, 0.2, -0.01, 0.25, -0.02, -0.03, 0.25])
QUIET = settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return Robot.from_urdf(path)


def moves_as(path, robot, theta, **options):
    """Whether the file's inverse dynamics are regressor times parameters."""
    again, rng = Robot.from_urdf(path, **options), np.random.default_rng(0)
    for _ in range(3):
        q, v, a = pin.randomConfiguration(robot.model), rng.normal(size=robot.nv), rng.normal(size=robot.nv)
        Y = pin.computeJointTorqueRegressor(robot.model, robot.model.createData(), q, v, a).reshape(robot.nv, -1)
        got = pin.rnea(again.model, again.model.createData(), q, v, a)
        np.testing.assert_allclose(got, Y @ theta, atol=1e-9 * abs(Y @ theta).max())
    return again


@QUIET
@given(text=trees(), data=st.data())
def test_a_written_tree_moves_as_its_parameters_say(text, data, tmp_path):
    source = tmp_path / "tree.urdf"
    source.write_text(text)
    robot = Robot.from_urdf(source)
    theta = data.draw(consistent_parameters(len(robot.links)))
    damping, friction = np.arange(robot.nv) / 3, np.arange(robot.nv) / 7
    written = write_robot(robot, tmp_path / "new.urdf", theta, damping=damping, dry_friction=friction)
    again = moves_as(written.path, robot, theta)
    np.testing.assert_array_equal(again.damping, damping)
    np.testing.assert_array_equal(again.dry_friction, friction)


@pytest.mark.skipif(not REAL, reason="no robots' logs at ../shared/data")
@pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.stem)
def test_a_real_robot_moves_as_its_written_parameters_say(path, tmp_path):
    robot = Robot.from_urdf(path)
    theta = np.tile(BODY, len(robot.links))
    moves_as(write_robot(robot, tmp_path / path.name, theta).path, robot, theta)


def test_writing_what_was_read_changes_nothing_but_inertias(arm, tmp_path):
    written = write_robot(arm, tmp_path / "new.urdf", arm.inertial_parameters)
    assert written.notes == ()
    bare = [re.sub(r"<(origin|mass|inertia) [^>]*>|\s", "", text) for text in (ARM, written.path.read_text())]
    assert bare[0] == bare[1]
    assert 'velocity="3" effort="80"/>\n    <dynamics damping="0.3" friction="0.2"/>' in written.path.read_text()


def test_a_tool_keeps_its_inertia_where_the_rest_is_a_body(arm, tmp_path):
    text = write_robot(arm, tmp_path / "new.urdf", arm.inertial_parameters * 1.5).path.read_text()
    assert '<mass value="0.5"/>' in text
    assert '<mass value="1.75"/>' in text


def test_a_tool_is_folded_into_its_link_where_the_rest_is_no_body(arm, tmp_path):
    theta = np.concatenate([BODY, 0.1 * BODY])
    written = write_robot(arm, tmp_path / "new.urdf", theta)
    assert written.notes == ("link 'tool': its inertia is part of link 'lower'",)
    assert "<!-- the inertia of this link is part of link 'lower' -->" in written.path.read_text()
    moves_as(written.path, arm, theta)


def test_a_dummy_link_leaves_the_inertia_to_the_link_fixed_to_it(tmp_path):
    source = tmp_path / "dummy.urdf"
    source.write_text(re.sub(r'(<link name="lower">)\s*<inertial>.*?</inertial>', r"\1", ARM, count=1, flags=re.DOTALL))
    robot, theta = Robot.from_urdf(source), np.concatenate([BODY, 0.3 * BODY])
    written = write_robot(robot, tmp_path / "new.urdf", theta)
    assert written.notes == ()
    assert written.path.read_text().count("<inertial>") == 3
    moves_as(written.path, robot, theta)


def test_a_link_without_inertia_gets_one(tmp_path):
    source = tmp_path / "bare.urdf"
    source.write_text(re.sub(r"<inertial>.*?</inertial>", "", ARM, flags=re.DOTALL))
    with pytest.warns(UserWarning, match="has no <inertial>"):
        robot = Robot.from_urdf(source)
    theta = np.concatenate([BODY, 0.3 * BODY])
    moves_as(write_robot(robot, tmp_path / "new.urdf", theta).path, robot, theta)


def test_armature_is_left_to_a_note_and_a_comment(arm, tmp_path):
    written = write_robot(arm, tmp_path / "new.urdf", arm.inertial_parameters, armature=[0.25, 0.0])
    assert written.notes == ("URDF has no place for armature [kg m², kg]: shoulder 0.25",)
    assert "<!-- URDF has no place for armature [kg m^2, kg]: shoulder 0.25 -->" in written.path.read_text()


def test_an_impossible_body_is_written_with_a_note(arm, tmp_path):
    written = write_robot(arm, tmp_path / "new.urdf", -arm.inertial_parameters)
    assert [note.split(":")[0] for note in written.notes if "not those of a body" in note] == [
        "link 'upper'",
        "link 'lower'",
    ]


def test_a_floating_and_locked_robot_is_written(tmp_path):
    source, options = tmp_path / "arm.urdf", {"floating_base": True, "locked": {"elbow": 0.4}, "gravity": (0, 1, 2)}
    source.write_text(ARM.replace('value="-7"', 'value="7"'))
    robot = Robot.from_urdf(source, **options)
    theta, friction = np.concatenate([BODY, 0.3 * BODY]), np.full(robot.nv, 0.5)
    written = write_robot(robot, tmp_path / "new.urdf", theta, damping=friction)
    assert any("no place for the friction of a free-flyer joint" in note for note in written.notes)
    model = robot.model.copy()
    model.lowerPositionLimit, model.upperPositionLimit = np.full(model.nq, -1.0), np.full(model.nq, 1.0)
    again, q = Robot.from_urdf(written.path, **options), pin.randomConfiguration(model)
    a = np.random.default_rng(0).normal(size=robot.nv)
    Y = pin.computeJointTorqueRegressor(robot.model, robot.model.createData(), q, a, a)
    np.testing.assert_allclose(pin.rnea(again.model, again.model.createData(), q, a, a), Y @ theta, atol=1e-10)


def test_meshes_are_still_found_from_another_folder(arm, tmp_path):
    (tmp_path / "out").mkdir()
    text = write_robot(arm, tmp_path / "out" / "new.urdf", arm.inertial_parameters).path.read_text()
    assert '<mesh filename="../meshes/upper.stl" scale="1 1 1"/>' in text


def test_nothing_is_left_behind_where_writing_fails(arm, tmp_path):
    before = sorted(tmp_path.iterdir())
    with pytest.raises(ParameterError, match=r"inertial_parameters: wanted shape \(20,\); got \(3,\)"):
        write_robot(arm, tmp_path / "new.urdf", [1, 2, 3])
    with pytest.raises(ParameterError, match="damping: must be finite; number 1 is not"):
        write_robot(arm, tmp_path / "new.urdf", arm.inertial_parameters, damping=[0, np.nan])
    with pytest.raises(OutputError, match="cannot be written: No such file or directory"):
        write_robot(arm, tmp_path / "none" / "new.urdf", arm.inertial_parameters)
    arm.source.write_text(ARM.replace('xyz="0.4 0 0"', 'xyz="0.5 0 0"'))
    with pytest.raises(RobotError, match="joint 'elbow' stands elsewhere in the written file; it was not kept"):
        write_robot(arm, tmp_path / "new.urdf", arm.inertial_parameters)
    assert sorted(tmp_path.iterdir()) == before


def test_a_robot_without_a_file_cannot_be_written(tmp_path):
    robot = Robot.from_pin(pin.buildSampleModelManipulator())
    with pytest.raises(RobotError, match="only robots read from a file are written"):
        write_robot(robot, tmp_path / "new.urdf", robot.inertial_parameters)

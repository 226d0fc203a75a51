import re

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from casysid.errors import CasysidWarning, RobotError
from casysid.robot import Robot, write_robot
from tests.robot.bodies import consistent_parameters
from tests.robot.mjcf_models import CASES, FULL, INERTIAL, TURNED, model, trees


def robot_of(tmp_path, text, **options):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return Robot.from_mjcf(path, **options)


def torque_of_regressor(robot, theta, armature, q, v, a):
    """Pinocchio's joint torque regressor, columns of carried links only, times parameters."""
    Y = pin.computeJointTorqueRegressor(robot.model, robot.model.createData(), q, v, a).reshape(robot.nv, -1)
    columns = np.concatenate([np.arange(10 * k, 10 * k + 10) for k, j in enumerate(robot.joints) if j.link is not None])
    return Y[:, columns] @ theta + armature * a


def is_written_as(tmp_path, text, data):
    robot = robot_of(tmp_path, text)
    theta = data.draw(consistent_parameters(len(robot.links)))
    friction = np.concatenate([np.full(j.v.stop - j.v.start, 0.1 * k + 1 / 3) for k, j in enumerate(robot.joints)])
    values = {"damping": friction, "dry_friction": friction / 2, "armature": friction / 10}
    if "<freejoint" in text:
        values = {name: getattr(robot, name) for name in values}
    again = Robot.from_mjcf(write_robot(robot, tmp_path / "new.xml", theta, **values).path)
    rng = np.random.default_rng(0)
    for _ in range(3):
        q, v, a = pin.randomConfiguration(unlimited(robot)), rng.normal(size=robot.nv), rng.normal(size=robot.nv)
        wanted = torque_of_regressor(robot, theta, values["armature"], q, v, a)
        got = pin.rnea(again.model, again.model.createData(), q, v, a)
        np.testing.assert_allclose(got, wanted, atol=1e-9 * abs(wanted).max())
    np.testing.assert_allclose(again.damping, values["damping"], rtol=1e-12)
    np.testing.assert_allclose(again.dry_friction, values["dry_friction"], rtol=1e-12)


@pytest.mark.parametrize("name", CASES)
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_written_model_moves_as_its_parameters_say(name, data, tmp_path):
    is_written_as(tmp_path, CASES[name], data)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=trees(), data=st.data())
def test_a_written_tree_moves_as_its_parameters_say(text, data, tmp_path):
    is_written_as(tmp_path, text, data)


def unlimited(robot):
    copy = robot.model.copy()
    copy.lowerPositionLimit, copy.upperPositionLimit = np.full(copy.nq, -1.0), np.full(copy.nq, 1.0)
    return copy


BODY = np.array([2.0, 0.1, 0.2, 0.3, 0.2, -0.01, 0.25, -0.02, -0.03, 0.25])
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
HINGE = f'<body name="a"><joint name="j1" axis="0 1 0"/>{INERTIAL}</body>'


def reads_back(written, theta, **options):
    again = Robot.from_mjcf(written.path, **options)
    np.testing.assert_allclose(again.inertial_parameters, theta, atol=1e-13)
    return again


def test_everything_but_the_numbers_stays(tmp_path):
    robot = robot_of(tmp_path, CASES["frames and defaults"])
    text = write_robot(robot, tmp_path / "new.xml", np.tile(BODY, 2)).path.read_text()
    bare = [re.sub(r"<inertial[^>]*>", "", t) for t in (CASES["frames and defaults"], text)]
    assert bare[0] == bare[1]
    assert "<!-- kept -->" in text


def test_a_body_in_an_included_file_is_written_into_one_file(tmp_path):
    (tmp_path / "parts").mkdir()
    body = HINGE.replace('name="a"', 'name="a" pos=".1234567890123 0 0"')
    (tmp_path / "parts" / "body.xml").write_text(f"<any>{body}</any>")
    robot = robot_of(tmp_path, model('<include file="parts/body.xml"/>'))
    written = write_robot(robot, tmp_path / "new.xml", BODY)
    assert written.notes == ("written as one file: what was included, attached or replicated stands in it",)
    assert reads_back(written, BODY).joints[0].placement.translation[0] == 0.1234567890123


def test_an_include_of_other_things_stays(tmp_path):
    (tmp_path / "parts.xml").write_text('<any><default><joint damping=".3"/></default></any>')
    robot = robot_of(tmp_path, model(HINGE, before='<include file="parts.xml"/>'))
    written = write_robot(robot, tmp_path / "new.xml", BODY)
    assert '<include file="parts.xml"/>' in written.path.read_text()
    assert written.notes == ()
    (tmp_path / "out").mkdir()
    moved = write_robot(robot, tmp_path / "out" / "new.xml", BODY)
    assert "<include" not in moved.path.read_text()
    assert reads_back(moved, BODY).damping[0] == 0.3


def test_an_attached_model_is_written_into_one_file(tmp_path):
    (tmp_path / "hand.xml").write_text(model(HINGE))
    robot = robot_of(
        tmp_path,
        '<mujoco><asset><model name="hand" file="hand.xml"/></asset><worldbody><body name="arm"><joint name="j0"/>'
        f'{FULL}<attach model="hand" body="a" prefix="l_"/></body></worldbody></mujoco>',
    )
    assert robot.links == ("arm", "l_a")
    reads_back(write_robot(robot, tmp_path / "new.xml", np.tile(BODY, 2)), np.tile(BODY, 2))


def test_meshes_are_still_found_from_another_folder(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "meshes" / "m.obj").write_text(TETRAHEDRON)
    asset = '<asset><mesh name="m" file="{}"/></asset>'
    body = '<body name="a"><joint name="j1"/><geom type="mesh" mesh="m"/></body>'
    for before in ('<compiler meshdir="meshes"/>' + asset.format("m.obj"), asset.format("meshes/m.obj")):
        robot = robot_of(tmp_path, model(body, before=before))
        written = write_robot(robot, tmp_path / "out" / "new.xml", BODY)
        reads_back(written, BODY)
        mujoco.MjModel.from_xml_path(str(written.path))


def test_meshes_of_an_attached_model_are_still_found(tmp_path):
    (tmp_path / "hand" / "meshes").mkdir(parents=True)
    (tmp_path / "out").mkdir()
    (tmp_path / "hand" / "meshes" / "m.obj").write_text(TETRAHEDRON)
    hand = HINGE.replace("</body>", '<geom type="mesh" mesh="m"/></body>')
    assets = '<compiler meshdir="meshes"/><asset><mesh name="m" file="m.obj"/></asset>'
    (tmp_path / "hand" / "hand.xml").write_text(model(hand, before=assets))
    robot = robot_of(
        tmp_path,
        '<mujoco><asset><model name="hand" file="hand/hand.xml"/></asset><worldbody><body name="arm"><joint name="j0"/>'
        f'{FULL}<attach model="hand" body="a" prefix="l_"/></body></worldbody></mujoco>',
    )
    for path in (tmp_path / "new.xml", tmp_path / "out" / "new.xml"):
        write_robot(robot, path, np.tile(BODY, 2))
        assert mujoco.MjModel.from_xml_path(str(path)).nmesh == 1


def test_a_fixed_body_is_folded_where_the_rest_is_no_body(tmp_path):
    robot = robot_of(tmp_path, CASES["fixed tools"])
    theta = np.concatenate([BODY, BODY])
    written = write_robot(robot, tmp_path / "new.xml", theta)
    assert written.notes == (
        "body 'grip': its inertia is part of body 'a'",
        "body 'tip': its inertia is part of body 'a'",
    )
    reads_back(written, theta)
    kept = write_robot(robot, tmp_path / "new.xml", 2.0 * robot.inertial_parameters)
    assert kept.notes == ()
    assert TURNED in kept.path.read_text()


def test_an_inertia_in_a_frame_moves_to_its_body(tmp_path):
    robot = robot_of(tmp_path, model(f'<body name="a"><joint name="j1"/><frame pos="0 0 1">{INERTIAL}</frame></body>'))
    reads_back(write_robot(robot, tmp_path / "new.xml", BODY), BODY)


def test_what_actuators_add_is_not_counted_twice(tmp_path):
    robot = robot_of(tmp_path, CASES["geared motors"])
    written = write_robot(robot, tmp_path / "new.xml", np.tile(BODY, 2), armature=[0.01, 0.2], damping=[1.0, 1.0])
    assert written.notes == ("joint 'j1': its own armature is negative (-0.08), its actuators may add to it",)
    again = reads_back(written, np.tile(BODY, 2))
    np.testing.assert_allclose(again.armature, [0.01, 0.2], rtol=1e-14)
    np.testing.assert_allclose(again.damping, [1.0, 1.0], rtol=1e-14)


@pytest.mark.filterwarnings("ignore:.*not part of the dynamic model:casysid.errors.CasysidWarning")
def test_springs_and_higher_damping_stay(tmp_path):
    robot = robot_of(tmp_path, model(HINGE.replace('name="j1"', 'name="j1" springdamper=".1 1"')))
    again = reads_back(write_robot(robot, tmp_path / "new.xml", BODY), BODY)
    np.testing.assert_allclose(again.damping, robot.damping, rtol=1e-14)
    robot = robot_of(tmp_path, model(HINGE.replace('name="j1"', 'name="j1" damping=".1 .2 .3"')))
    assert 'damping="0.5 0.2 0.3"' in write_robot(robot, tmp_path / "new.xml", BODY, damping=[0.5]).path.read_text()


def test_one_number_stands_for_all_directions_of_a_ball(tmp_path):
    robot = robot_of(tmp_path, CASES["free base, ball and hinge"])
    damping, theta = np.arange(robot.nv) / 10, robot.inertial_parameters
    written = write_robot(robot, tmp_path / "new.xml", theta, damping=damping)
    assert "<freejoint> has no place for damping" in written.notes[0]
    assert "joint 'hip': MJCF has one damping for all directions, the mean of 0.6 0.7 0.8" in written.notes[1]
    np.testing.assert_allclose(Robot.from_mjcf(written.path).damping[6:9], 0.7)


def test_a_floating_and_locked_robot_is_written(tmp_path):
    options = {"floating_base": True, "locked": {"j2": 0.4}}
    robot = robot_of(tmp_path, CASES["tilted axis and joint offset"], **options)
    theta = BODY
    assert robot.links == ("a",)
    reads_back(write_robot(robot, tmp_path / "new.xml", theta), theta, **options)


def test_an_impossible_body_is_written_but_mujoco_refuses_it(tmp_path):
    robot = robot_of(tmp_path, model(HINGE))
    written = write_robot(robot, tmp_path / "new.xml", -BODY)
    assert written.notes == ("link 'a': its parameters are not those of a body; simulators may refuse the file",)
    with pytest.raises(RobotError, match="MuJoCo does not accept"):
        Robot.from_mjcf(written.path)


def test_a_body_frame_that_follows_its_inertia_is_refused(tmp_path):
    robot = robot_of(tmp_path, model(f'<body name="a">{INERTIAL}<freejoint align="true"/></body>'))
    with pytest.raises(RobotError, match=r"the frame of body 'a' follows its inertia \(alignfree\)"):
        write_robot(robot, tmp_path / "new.xml", BODY)


def test_a_scaled_total_mass_is_no_longer_scaled(tmp_path):
    with pytest.warns(CasysidWarning, match="settotalmass"):
        robot = robot_of(tmp_path, model(HINGE, before='<compiler settotalmass="7"/>'))
    reads_back(write_robot(robot, tmp_path / "new.xml", BODY), BODY)

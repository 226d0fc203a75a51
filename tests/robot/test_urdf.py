import math
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings

from casysid.errors import CasysidWarning, RobotError
from casysid.robot import FaultKind, JointKind, Robot, write_robot
from tests.robot.urdf_models import ARM, trees

REAL = sorted((Path(__file__).parents[3] / "shared" / "data").glob("*/*.urdf"))


@pytest.fixture
def read(tmp_path):
    def read_text(text, **options):
        path = tmp_path / "arm.urdf"
        path.write_text(text)
        return Robot.from_urdf(path, **options)

    return read_text


def same_model(robot, model):
    assert list(robot.model.names) == list(model.names)
    for k in range(1, model.njoints):
        assert robot.model.jointPlacements[k].isApprox(model.jointPlacements[k], 1e-14)
        assert robot.model.inertias[k].isApprox(model.inertias[k], 1e-13)
    np.testing.assert_allclose(robot.model.damping, model.damping)
    rng = np.random.default_rng(0)
    q, v, a = pin.randomConfiguration(model), rng.normal(size=model.nv), rng.normal(size=model.nv)
    torque = pin.rnea(model, model.createData(), q, v, a)
    np.testing.assert_allclose(pin.rnea(robot.model, robot.model.createData(), q, v, a), torque, atol=1e-10)


def test_an_arm_is_read_with_names_limits_and_parameters(read):
    robot = read(ARM)
    assert (robot.name, robot.source_format, robot.links) == ("arm", "urdf", ("upper", "lower"))
    assert robot.dofs == robot.channels == ("shoulder", "elbow")
    assert [joint.kind for joint in robot.joints] == [JointKind.REVOLUTE, JointKind.CONTINUOUS]
    assert [joint.parent for joint in robot.joints] == [-1, 0]
    assert (robot.nq, robot.nv) == (3, 2)
    np.testing.assert_allclose(robot.joints[1].axis, [0.0, 0.6, 0.8])
    np.testing.assert_array_equal(robot.position_lower, [-2.5, -math.inf])
    np.testing.assert_array_equal(robot.position_upper, [1.5, math.inf])
    np.testing.assert_array_equal(robot.velocity_limit, [3.0, 2.0])
    np.testing.assert_array_equal(robot.effort_limit, [80.0, 30.0])
    np.testing.assert_array_equal(robot.damping, [0.3, 0.0])
    np.testing.assert_array_equal(robot.dry_friction, [0.2, 0.0])
    np.testing.assert_array_equal(robot.gravity, [0.0, 0.0, -9.81])
    assert robot.inertial_parameters[10] == 1.5  # the tool is part of the lower link
    assert robot.faults == ()  # the base does not move: its mass is nobody's business


def test_an_arm_is_what_pinocchio_reads(read):
    same_model(read(ARM), pin.buildModelFromXML(ARM))


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=trees())
def test_any_tree_is_what_pinocchio_reads(text, read):
    same_model(read(text), pin.buildModelFromXML(text))


@pytest.mark.skipif(not REAL, reason="no robots' logs at ../shared/data")
@pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.stem)
def test_a_real_robot_is_what_pinocchio_reads(path):
    robot = Robot.from_file(path)
    same_model(robot, pin.buildModelFromUrdf(path))
    assert robot.source == path


def test_a_floating_base_adds_a_free_joint_that_carries_the_base(read):
    robot = read(ARM.replace('value="-7"', 'value="7"'), floating_base=True)
    assert robot.links == ("base", "upper", "lower")
    assert robot.joints[0].kind is JointKind.FREE_FLYER
    assert robot.channels[:7] == tuple(f"root_joint_{x}" for x in ("x", "y", "z", "qx", "qy", "qz", "qw"))
    assert robot.dofs[:6] == tuple(f"root_joint_{x}" for x in ("vx", "vy", "vz", "wx", "wy", "wz"))
    assert robot.floating_base


def test_a_floating_base_is_not_made_to_float_twice(read):
    text = ARM.replace('name="shoulder" type="revolute"', 'name="shoulder" type="floating"')
    robot = read(text, floating_base=True)
    assert robot.links == ("upper", "lower")
    assert not robot.floating_base


def test_the_name_of_the_free_joint_must_be_free(read):
    with pytest.raises(RobotError, match="floating_base: a joint is named 'root_joint' already"):
        read(ARM.replace('name="elbow"', 'name="root_joint"'), floating_base=True)


def test_a_joint_and_a_link_may_share_a_name(read):
    assert read(ARM.replace('name="elbow"', 'name="upper"')).links == ("upper", "lower")


def test_a_locked_joint_joins_its_link_to_the_one_before(read):
    free, locked = read(ARM), read(ARM, locked={"elbow": 0.7})
    assert (locked.links, locked.dofs) == (("upper",), ("shoulder",))
    q, a = np.array([0.4, math.cos(0.7), math.sin(0.7)]), np.array([1.3, 0.0])
    torque = pin.rnea(free.model, free.model.createData(), q, np.zeros(2), a)
    np.testing.assert_allclose(
        pin.rnea(locked.model, locked.model.createData(), q[:1], np.zeros(1), a[:1]), torque[:1], rtol=1e-12
    )
    assert locked.locked == (("elbow", 0.7),)


def test_gravity_can_be_given(read):
    np.testing.assert_array_equal(read(ARM, gravity=(1, 2, -3)).gravity, [1.0, 2.0, -3.0])


@pytest.mark.parametrize("gravity", [(0, 0), (0, 0, math.nan), "down", 9.81, (0, 0, "x")])
def test_gravity_must_be_three_finite_numbers(gravity, read):
    with pytest.raises(RobotError, match="gravity: wanted three"):
        read(ARM, gravity=gravity)


BROKEN = {
    "not xml": (ARM.replace("</robot>", ""), r"arm\.urdf:47: not well-formed XML"),
    "other format": ("<mujoco/>", "the root element is <mujoco>, a URDF has <robot>; this looks like MJCF"),
    "sdf": ("<sdf/>", "the root element is <sdf>"),
    "no links": ("<robot/>", "has no <link>"),
    "xacro macro": (
        ARM.replace('<robot name="arm">', '<robot name="arm" xmlns:xacro="x"><xacro:arm/>'),
        r"arm\.urdf:3: is a xacro file, not yet expanded; run `xacro arm\.urdf > arm_expanded\.urdf`",
    ),
    "xacro expression": (ARM.replace('value="2.0"', 'value="${m}"'), "is a xacro file"),
    "no moving joint": ('<robot name="x"><link name="a"/></robot>', "no joint moves"),
    "joint twice": (ARM.replace('"elbow"', '"shoulder"'), "joint 'shoulder' is defined twice .first in line 29"),
    "link twice": (ARM.replace('<link name="lower">', '<link name="upper">'), "link 'upper' is defined twice"),
    "nameless link": (ARM.replace('<link name="lower">', "<link>"), "<link> without a name"),
    "nameless joint": (ARM.replace('name="elbow" ', ""), "<joint> without a name"),
    "wrong parent": (
        ARM.replace('parent link="upper"', 'parent link="uper"'),
        "joint 'elbow': parent link 'uper' does not exist; links are base, lower, tool, upper",
    ),
    "wrong child": (
        ARM.replace('child link="lower"', 'child link="l"'),
        "joint 'elbow': child link 'l' does not exist",
    ),
    "no parent": (ARM.replace('<parent link="upper"/>', ""), "joint 'elbow': needs <parent link="),
    "two parents": (
        ARM.replace('<child link="tool"/>', '<child link="upper"/>'),
        "link 'upper' has two parents, joints 'shoulder' and 'flange'; closed loops",
    ),
    "two bases": (ARM.replace("</robot>", '<link name="other"/></robot>'), "links base, other have no parent"),
    "detached loop": (
        ARM.replace('<parent link="base"/>', '<parent link="tool"/>'),
        "links lower, tool, upper form a loop",
    ),
    "ball": (
        ARM.replace('"continuous"', '"spherical"'),
        'type="spherical" is not one of .*ball joints are possible in MJCF',
    ),
    "mimic": (
        ARM.replace('<axis xyz="0 3 4"/>', '<axis xyz="0 3 4"/><mimic joint="shoulder"/>'),
        "mimic others.*joint 'elbow' .line 36. 'shoulder'; lock them .--lock elbow=0.",
    ),
    "origin": (
        ARM.replace('xyz="0.4 0 0"', 'xyz="0,4 0 0"'),
        "joint 'elbow': <origin xyz=\"0,4 0 0\"> is not three finite",
    ),
    "no direction": (ARM.replace('xyz="0 3 4"', 'xyz="0 0 0"'), "joint 'elbow': <axis xyz=\"0 0 0\"> has no direction"),
    "planar axis": (ARM.replace('"continuous"', '"planar"'), "joint 'elbow': a planar joint moves in the x-y plane"),
    "limit": (
        ARM.replace('lower="-2.5"', 'lower="abc"'),
        "joint 'shoulder': <limit lower=\"abc\"> is not a finite number",
    ),
    "limits swapped": (ARM.replace('lower="-2.5"', 'lower="2.5"'), "lower limit 2.5 exceeds upper limit 1.5"),
    "negative effort": (ARM.replace('effort="80"', 'effort="-80"'), "effort limit -80 must not be negative"),
    "damping": (ARM.replace('damping="0.3"', 'damping="0,3"'), '<dynamics damping="0,3"> is not a finite number'),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_refused_with_the_reason(name, read):
    text, message = BROKEN[name]
    with pytest.raises(RobotError, match=message):
        read(text)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(RobotError, match=r"none\.urdf: no such file"):
        Robot.from_file(tmp_path / "none.urdf")
    with pytest.raises(RobotError, match="is a folder"):
        Robot.from_file(tmp_path)
    (tmp_path / "x.sdf").write_text("<sdf/>")
    with pytest.raises(RobotError, match=r"<sdf>; wanted <robot> \(URDF\) or <mujoco> \(MJCF\)"):
        Robot.from_file(tmp_path / "x.sdf")


@pytest.mark.parametrize(
    ("locked", "message"),
    [
        ({"wrist": 0.0}, "locked joint 'wrist' does not exist; moving joints: shoulder, elbow"),
        ({"flange": 0.0}, "locked joint 'flange' does not exist"),
        ({"elbow": math.nan}, "locked joint 'elbow': wanted a finite position"),
        ({"elbow": "up"}, "locked joint 'elbow': wanted a position"),
        ({"elbow": 0.0, "shoulder": 0.0}, "no joint moves"),
    ],
)
def test_what_cannot_be_locked_is_named(locked, message, read):
    with pytest.raises(RobotError, match=message):
        read(ARM, locked=locked)


def test_a_mimic_joint_can_be_locked(read):
    text = ARM.replace('<axis xyz="0 3 4"/>', '<axis xyz="0 3 4"/><mimic joint="shoulder"/>')
    assert read(text, locked={"elbow": 0.0}).dofs == ("shoulder",)


UPPER = re.compile(r'<link name="upper">\s*<inertial>.*?</inertial>', re.DOTALL)
FAULTY = {
    "missing": (UPPER.sub('<link name="upper">', ARM), "upper", FaultKind.MISSING, "has no <inertial>"),
    "letters": (
        ARM.replace('ixx="0.02"', 'ixx="abc"'),
        "upper",
        FaultKind.UNREADABLE,
        'ixx="abc" is not a finite number',
    ),
    "numpy": (ARM.replace('ixx="0.02"', 'ixx="np.float64(1.0)"'), "upper", FaultKind.UNREADABLE, 'ixx="np.float64'),
    "no entry": (ARM.replace('ixy="0.001" ', ""), "upper", FaultKind.UNREADABLE, "ixy is missing"),
    "comma": (ARM.replace('value="2.0"', 'value="1,5"'), "upper", FaultKind.UNREADABLE, 'mass value="1,5"'),
    "nan": (ARM.replace('value="2.0"', 'value="nan"'), "upper", FaultKind.UNREADABLE, 'mass value="nan"'),
    "no mass": (ARM.replace('<mass value="2.0" />', ""), "upper", FaultKind.UNREADABLE, "has no mass value"),
    "origin": (ARM.replace('xyz="0.1 0 0.02"', 'xyz="0.1 0"'), "upper", FaultKind.UNREADABLE, 'origin xyz="0.1 0"'),
    "zero": (ARM.replace('value="2.0"', 'value="0"'), "upper", FaultKind.MASS_NOT_POSITIVE, "mass is 0 kg"),
    "negative": (ARM.replace('value="2.0"', 'value="-2"'), "upper", FaultKind.MASS_NOT_POSITIVE, "mass is -2 kg"),
    "indefinite": (ARM.replace('ixx="0.02"', 'ixx="-1"'), "upper", FaultKind.INERTIA_NOT_POSITIVE, "must be positive"),
    "triangle": (ARM.replace('ixx="0.02"', 'ixx="2"'), "upper", FaultKind.TRIANGLE_INEQUALITY, "exceeds the sum"),
    "fixed child": (ARM.replace('izz="0.0005"', 'izz="5"'), "tool", FaultKind.TRIANGLE_INEQUALITY, "exceeds the sum"),
}


@pytest.mark.parametrize("name", FAULTY)
def test_a_fault_of_inertia_warns_by_name_and_leaves_finite_numbers(name, read):
    text, link, kind, message = FAULTY[name]
    with pytest.warns(CasysidWarning, match=re.escape(message)) as caught:
        robot = read(text)
    assert len(caught) == 1
    assert f"link '{link}'" in str(caught[0].message)
    assert caught[0].filename == __file__
    assert [(fault.link, fault.kind) for fault in robot.faults] == [(link, kind)]
    assert np.isfinite(robot.inertial_parameters).all()


def test_every_link_without_inertia_is_still_only_a_warning(read):
    text = re.sub(r"<inertial>.*?</inertial>", "", ARM, flags=re.DOTALL)
    with pytest.warns(CasysidWarning, match=r"of 2 links .*'upper': has no .*'lower': has no .* fixed to it: 'tool'"):
        robot = read(text)
    assert not robot.inertial_parameters.any()


def test_a_link_whose_inertia_stands_in_a_fixed_child_is_no_fault(read):
    text = re.sub(r'(<link name="lower">)\s*<inertial>.*?</inertial>', r"\1", ARM, count=1, flags=re.DOTALL)
    assert read(text).faults == ()


def test_a_joint_without_limits_is_unlimited_with_a_warning(read):
    text = ARM.replace('<limit lower="-2.5" upper="1.5" velocity="3" effort="80"/>', "")
    with pytest.warns(CasysidWarning, match="joint 'shoulder': no position limits, taken as unlimited"):
        robot = read(text)
    assert robot.joints[0].kind is JointKind.REVOLUTE
    assert np.isinf([robot.position_lower[0], robot.velocity_limit[0], robot.effort_limit[0]]).all()


def test_negative_friction_is_doubted(read):
    with pytest.warns(CasysidWarning, match="joint 'shoulder': negative friction"):
        read(ARM.replace('damping="0.3"', 'damping="-0.3"'))


def test_all_joints_that_mimic_others_stand_in_one_message_with_what_locks_them(read):
    mimic = '<mimic joint="shoulder"/>'
    text = ARM.replace('<axis xyz="0 3 4"/>', f'<axis xyz="0 3 4"/>{mimic}')
    with pytest.raises(RobotError) as caught:
        read(text)
    assert "--lock elbow=0" in str(caught.value)
    assert "elbow" not in read(text, locked={"elbow": 0.0}).dofs


def test_negative_coulomb_friction_is_a_doubtful_prior_and_no_more(read):
    text = ARM.replace('<axis xyz="0 3 4"/>', '<axis xyz="0 3 4"/><dynamics damping="0.1" friction="-0.2"/>')
    with pytest.warns(
        CasysidWarning, match="joint 'elbow': negative friction .damping 0.1, friction -0.2. is no usable"
    ):
        robot = read(text)
    assert (robot.dry_friction >= 0.0).all()


ENCODINGS = {"gb2312": "gb2312", "GBK": "gbk", "shift_jis": "shift_jis", "ANSI": "cp1252", "windows-1251": "cp1251"}


@pytest.mark.parametrize("declared", ENCODINGS)
def test_encodings_of_vendors_are_read_and_written_as_utf8(declared, tmp_path):
    letters = {"gb2312": "机器人", "GBK": "機器人", "shift_jis": "ロボット", "ANSI": "Größe", "windows-1251": "робот"}
    text = ARM.replace("a comment before the robot", letters[declared]).replace(
        '<?xml version="1.0"?>', f'<?xml version="1.0" encoding="{declared}"?>'
    )
    path = tmp_path / "arm.urdf"
    path.write_bytes(text.encode(ENCODINGS[declared]))
    robot = Robot.from_file(path)
    assert robot.dofs
    out = tmp_path / "out.urdf"
    write_robot(robot, out, robot.inertial_parameters)
    written = out.read_text(encoding="utf-8")
    assert letters[declared] in written
    assert 'encoding="UTF-8"' in written
    np.testing.assert_allclose(Robot.from_file(out).inertial_parameters, robot.inertial_parameters)


def test_a_text_that_is_not_what_it_declares_is_refused(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_bytes(b'<?xml version="1.0" encoding="shift_jis"?><robot name="\x81\x20\xff"/>')
    with pytest.raises(RobotError, match=r"not in the encoding that it declares, shift_jis .*save it as UTF-8"):
        Robot.from_file(path)


def test_a_link_and_a_fixed_joint_may_share_a_name(read):
    twin = """<link name="pedestal"/><link name="stand"/>
      <joint name="pedestal" type="fixed"><parent link="stand"/><child link="pedestal"/></joint>
      <joint name="elbow_stand" type="fixed"><parent link="pedestal"/><child link="base"/></joint></robot>"""
    robot = read(ARM.replace("</robot>", twin), locked={"elbow": 0.1})
    assert "elbow" not in robot.dofs
    assert "pedestal" in [frame.name for frame in robot.model.frames]

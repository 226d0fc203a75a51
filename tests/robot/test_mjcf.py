import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings

from casysid.errors import CasysidWarning, RobotError
from casysid.robot import FaultKind, JointKind, Robot
from tests.robot.mjcf_models import CASES, FULL, INERTIAL, model, trees

DISABLED = (
    mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT | mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
)


@pytest.fixture
def read(tmp_path):
    def read_text(text, **options):
        path = tmp_path / "robot.xml"
        path.write_text(text)
        return Robot.from_mjcf(path, **options)

    return read_text


def mujoco_torque(compiled, robot, rng):
    """Random state in Pinocchio's coordinates, and MuJoCo's inverse dynamics at it."""
    data = mujoco.MjData(compiled)
    compiled.opt.disableflags |= DISABLED
    data.qpos[:], data.qvel[:], data.qacc[:] = (rng.normal(size=n) for n in (compiled.nq, compiled.nv, compiled.nv))
    mujoco.mj_normalizeQuat(compiled, data.qpos)
    mujoco.mj_inverse(compiled, data)
    q, v, a, tau = (np.array(x) for x in (data.qpos, data.qvel, data.qacc, data.qfrc_inverse))
    for joint in robot.joints:
        if joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER):
            q[joint.q][-4:] = np.roll(q[joint.q][-4:], -1)
        if joint.kind is JointKind.FREE_FLYER:
            i = joint.v.start
            R = pin.Quaternion(q[joint.q][3:]).toRotationMatrix()
            v[i : i + 3] = R.T @ v[i : i + 3]
            a[i : i + 3] = R.T @ a[i : i + 3] - np.cross(v[i + 3 : i + 6], v[i : i + 3])
            tau[i : i + 3] = R.T @ tau[i : i + 3]
    return q, v, a, tau


def has_the_dynamics_of(robot, text):
    rng, compiled = np.random.default_rng(1), mujoco.MjModel.from_xml_string(text)
    for _ in range(5):
        q, v, a, tau = mujoco_torque(compiled, robot, rng)
        predicted = pin.rnea(robot.model, robot.model.createData(), q, v, a) + robot.damping * v
        np.testing.assert_allclose(predicted, tau, atol=1e-12 * max(1.0, abs(tau).max()))


@pytest.mark.parametrize("name", CASES)
def test_the_model_has_the_inverse_dynamics_of_mujoco(name, read):
    has_the_dynamics_of(read(CASES[name]), CASES[name])


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=trees())
def test_any_tree_has_the_inverse_dynamics_of_mujoco(text, read):
    has_the_dynamics_of(read(text), text)


HINGE = f'<body name="a"><joint name="j1" axis="0 1 0"/>{INERTIAL}'
PAIR = HINGE + f'<body name="b" pos=".1 0 0"><joint name="j2" axis="1 0 0"/>{FULL}</body></body>'


def test_names_limits_and_gravity_are_those_of_the_file(read):
    robot = read(
        model(
            '<body name="a"><joint name="j1" range="-90 45" actuatorfrcrange="-7 9"/>' + INERTIAL + "</body>",
            before='<option gravity="1 2 3"/>',
        )
    )
    assert (robot.name, robot.source_format, robot.links, robot.dofs) == ("case", "mjcf", ("a",), ("j1",))
    np.testing.assert_allclose([robot.position_lower[0], robot.position_upper[0]], np.radians([-90, 45]))
    np.testing.assert_array_equal(robot.gravity, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(robot.effort_limit, [7.0])
    np.testing.assert_array_equal(robot.velocity_limit, [np.inf])


def test_gravity_can_be_switched_off_and_given(read):
    text = model(PAIR, before='<option><flag gravity="disable"/></option>')
    np.testing.assert_array_equal(read(text).gravity, np.zeros(3))
    np.testing.assert_array_equal(read(text, gravity=(0, 0, -1)).gravity, [0.0, 0.0, -1.0])


def test_motors_add_inertia_and_damping_by_gear_squared_and_limit_torque(read):
    robot = read(CASES["geared motors"])
    np.testing.assert_allclose(robot.armature, [0.1 + 9 * 0.01, 100 * 0.001])
    np.testing.assert_allclose(robot.damping, [0.2 + 9 * 0.02, 0.0])
    np.testing.assert_allclose(robot.effort_limit, [15.0, 40.0])


def test_the_last_joint_of_a_body_carries_it(read):
    robot = read(CASES["several joints on one body"])
    assert [joint.link for joint in robot.joints] == [None, None, "a", "b"]
    assert robot.links == ("a", "b")
    robot = read(CASES["several joints on one body"], locked={"turn": 0.3})
    assert [joint.link for joint in robot.joints] == [None, "a", "b"]


def test_what_has_no_name_is_given_one(read):
    robot = read(CASES["nothing has a name"])
    assert (robot.links, robot.dofs) == (("body1", "body2"), ("joint0", "joint1"))
    assert read(CASES["free base, ball and hinge"]).dofs[0] == "root_joint_vx"


def test_a_floating_base_is_put_under_the_one_body_in_the_world(read):
    robot = read(model(PAIR), floating_base=True)
    assert robot.links == ("a", "b")
    assert [joint.link for joint in robot.joints] == [None, "a", "b"]
    assert robot.dofs[:2] == ("root_joint_vx", "root_joint_vy")
    assert not read(CASES["free base, ball and hinge"], floating_base=True).floating_base
    with pytest.raises(RobotError, match="which of the bodies 'a', 'c' is the base"):
        read(model(PAIR + f'<body name="c"><joint/>{FULL}</body>'), floating_base=True)


def test_the_name_of_the_free_joint_must_be_free(read):
    with pytest.raises(RobotError, match="floating_base: a joint is named 'root_joint' already"):
        read(model(PAIR.replace("j2", "root_joint")), floating_base=True)


def test_a_locked_joint_joins_its_body_to_the_one_before(read):
    free, locked = read(model(PAIR)), read(model(PAIR), locked={"j2": 0.4})
    assert (locked.links, locked.dofs) == (("a",), ("j1",))
    q, a = np.array([0.2, 0.4]), np.array([1.0, 0.0])
    torque = pin.rnea(free.model, free.model.createData(), q, np.zeros(2), a)[:1]
    got = pin.rnea(locked.model, locked.model.createData(), q[:1], np.zeros(1), a[:1])
    np.testing.assert_allclose(got, torque, rtol=1e-12)
    with pytest.raises(RobotError, match="joint 'hip' cannot be locked: only joints with one degree of freedom"):
        read(CASES["free base, ball and hinge"], locked={"hip": 0.0})


LOOPS = {
    "connect": ('<connect name="rod" body1="a" body2="b" anchor="0 0 0"/>', "<connect> 'rod' of bodies 'a' and 'b'"),
    "weld": ('<weld body1="b"/>', "<weld> of bodies 'b' and 'world'"),
    "sites": ('<weld site1="s" site2="t"/>', "<weld> of sites 's' and 't'"),
    "joint": ('<joint joint1="j2" joint2="j1"/>', "<joint> of joint 'j2' and joint 'j1'.*--lock j2=0"),
}


@pytest.mark.parametrize("name", LOOPS)
def test_a_closed_loop_is_refused_by_name(name, read):
    text, message = LOOPS[name]
    bodies = PAIR.replace('<joint name="j2"', '<site name="t"/><joint name="j2"') + '<site name="s"/>'
    with pytest.raises(RobotError, match=f"equality constraint {message}"):
        read(model(bodies, after=f"<equality>{text}</equality>"))
    inactive = text.replace("/>", ' active="false"/>')
    assert read(model(bodies, after=f"<equality>{inactive}</equality>")).nv == 2


def test_a_coupled_joint_can_be_locked(read):
    text = model(PAIR, after=f"<equality>{LOOPS['joint'][0]}</equality>")
    assert read(text, locked={"j2": 0.0}).dofs == ("j1",)


FOUR_BAR = HINGE + "".join(
    f'<body name="{name}"><joint name="{name}" axis="1 0 0" range="10 90"/>{FULL}</body>' for name in ("p", "q")
)
CONNECT = '<equality><connect name="bar" body1="p" body2="q" anchor="0 0 0"/></equality>'


def test_a_loop_asks_for_the_locks_that_open_it_and_loads_with_them(read):
    text = model(FOUR_BAR + "</body>", after=CONNECT)
    with pytest.raises(RobotError, match=r"--lock p=0.174533 --lock q=0.174533"):
        read(text)
    with pytest.raises(RobotError, match=r"lock what moves in them \(--lock q=0.174533\)"):
        read(text, locked={"p": 0.2})
    assert read(text, locked={"p": 0.2, "q": 0.2}).dofs == ("j1",)


def test_all_loops_stand_in_one_message(read):
    loops = CONNECT.replace("</equality>", '<joint joint1="j1"/></equality>')
    with pytest.raises(RobotError, match=r"<connect> 'bar'.*<joint> of joint 'j1'.*--lock p=.*--lock q=.*--lock j1=0"):
        read(model(FOUR_BAR + "</body>", after=loops))


LOOSE = f'<body name="cube" pos="1 0 0"><freejoint name="cube_free"/>{FULL}</body>'


def test_a_free_body_beside_the_robot_is_left_out_and_named(read):
    with pytest.warns(CasysidWarning, match="left out: bodies of the scene that float beside the robot: 'cube'"):
        robot = read(model(PAIR + LOOSE))
    assert (robot.links, robot.dofs) == (("a", "b"), ("j1", "j2"))
    alone = read(model(PAIR))
    np.testing.assert_array_equal(robot.inertial_parameters, alone.inertial_parameters)
    with pytest.warns(CasysidWarning, match="left out"):
        assert read(model(PAIR + LOOSE), locked={"cube_free": 0.0}).dofs == ("j1", "j2")
    with pytest.warns(CasysidWarning, match="left out"):
        assert read(model(PAIR + LOOSE), floating_base=True).nv == 8


def test_a_free_body_alone_is_a_robot(read):
    assert read(model(LOOSE)).nv == 6


def test_a_weld_to_a_mocap_body_is_left_out(read):
    mocap = '<body name="hand" mocap="true"/>'
    with pytest.warns(CasysidWarning, match="<weld> that draws body 'b' to a mocap body"):
        assert read(model(PAIR + mocap, after='<equality><weld body1="hand" body2="b"/></equality>')).nv == 2


def test_a_joint_and_its_body_may_share_a_name(read):
    text = model(PAIR.replace('name="j2"', 'name="b"').replace('name="j1"', 'name="a"'))
    robot, locked = read(text), read(text, locked={"b": 0.4})
    assert (locked.links, locked.dofs) == (("a",), ("a",))
    assert {frame.name for frame in locked.model.frames} == {frame.name for frame in robot.model.frames}


EXTRAS = {
    "stiffness": (PAIR.replace('name="j1"', 'name="j1" stiffness="3"'), "", "stiffness of joints j1"),
    "damping": (PAIR.replace('name="j1"', 'name="j1" damping="3 2 1"'), "", "nonlinear damping of joints j1"),
    "gravcomp": (PAIR.replace('name="b"', 'name="b" gravcomp="1"'), "", "gravcomp of bodies b"),
    "tendon": (PAIR, '<tendon><fixed><joint joint="j1" coef="1"/></fixed></tendon>', r"tendons \(1\)"),
    "fluid": (PAIR, '<option density="1.2"/>', "the fluid around the robot"),
    "actuator": (
        f'<body name="a"><joint name="j1" type="ball"/>{INERTIAL}</body>',
        '<actuator><motor name="m" joint="j1" armature="1"/></actuator>',
        "armature and damping of actuator 'm'",
    ),
}


@pytest.mark.parametrize("name", EXTRAS)
def test_forces_outside_the_model_are_named(name, read):
    bodies, after, message = EXTRAS[name]
    with pytest.warns(CasysidWarning, match=f"robot.xml: not part of the dynamic model: {message}") as caught:
        read(model(bodies, after=after))
    assert caught[0].filename == __file__


BROKEN = {
    "urdf": ("<robot/>", "the root element is <robot>, an MJCF has <mujoco>; this looks like URDF"),
    "infeasible": (
        model(PAIR.replace('diaginertia=".1 .2 .25"', 'diaginertia=".1 .2 .9"')),
        "MuJoCo does not accept the file: .*A . B >= C.*Element name 'a'",
    ),
    "massless": (model('<body name="a"><joint/></body>'), "mass and inertia of moving bodies must be larger"),
    "twice": (model(PAIR.replace("j2", "j1")), "repeated name 'j1' in joint"),
    "letters": (model(PAIR.replace('axis="0 1 0"', 'axis="0 x 0"')), "attribute 'axis'"),
    "include": (model('<include file="none.xml"/>'), "none.xml"),
    "static": (model(f'<body name="a">{INERTIAL}</body>'), "no joint moves"),
    "mesh": (
        '<mujoco><asset><mesh name="m" file="no.stl"/></asset><worldbody><body name="a"><joint/>'
        '<geom type="mesh" mesh="m"/></body></worldbody></mujoco>',
        "opening file 'no.stl'; it is needed for the inertia of body 'a', which states none",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_refused_with_the_reason(name, read):
    text, message = BROKEN[name]
    with pytest.raises(RobotError, match=message) as caught:
        read(text)
    assert "robot.xml" in str(caught.value)


def test_missing_meshes_are_forgiven_where_bodies_state_their_inertia(read):
    robot = read(
        '<mujoco><asset><texture name="t" type="2d" file="no.png"/><material name="c" texture="t"/>'
        f'<mesh name="m" file="no.stl"/></asset><worldbody>{HINGE}<geom type="mesh" mesh="m" material="c"/></body>'
        "</worldbody></mujoco>"
    )
    assert robot.inertial_parameters[0] == 2.0


def test_another_suffix_is_read_with_its_meshes_but_not_its_includes(tmp_path):
    path = tmp_path / "robot.mjcf"
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    mesh = '<asset><mesh name="m" file="m.obj"/></asset>'
    path.write_text(model('<body name="a"><joint/><geom type="mesh" mesh="m"/></body>', before=mesh))
    assert Robot.from_file(path).inertial_parameters[0] > 1.0
    path.write_text(model('<include file="x.xml"/>'))
    with pytest.raises(RobotError, match=r"x\.xml.*includes are found only from a file named \.xml"):
        Robot.from_file(path)


def test_messages_of_mujoco_are_passed_on(read):
    with pytest.warns(CasysidWarning, match=r"robot.xml: MuJoCo: compiler attribute 'settotalmass' is deprecated"):
        assert read(model(PAIR, before='<compiler settotalmass="5"/>')).nv == 2


def test_an_inertia_that_mujoco_lets_pass_is_still_doubted(read):
    flat = '<inertial pos="0 0 0" mass="1" diaginertia=".1 1e-14 .1"/>'
    with pytest.warns(CasysidWarning, match="link 'a': principal moments of inertia 1.*e-14"):
        robot = read(model(f'<body name="a"><joint name="j1"/>{flat}</body>'))
    assert robot.faults[0].kind is FaultKind.INERTIA_NOT_POSITIVE

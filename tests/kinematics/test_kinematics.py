"""Poses, velocities, Jacobians, centre of mass and momentum against Pinocchio, on random trees of all joints."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.kinematics import Axes, Frame, Kinematics
from casysid.robot import JointKind, Robot
from tests.strategies import Motion, generators, motions, random_motion, random_placement, random_robot, robots

REFERENCES = {
    Axes.WORLD: pin.LOCAL_WORLD_ALIGNED,
    Axes.FRAME: pin.LOCAL,
    Axes.SPATIAL: pin.WORLD,
}
thorough = settings(max_examples=200, deadline=None)
quick = settings(max_examples=20, deadline=None)


@st.composite
def cases(draw) -> tuple[Kinematics, Frame, Motion]:
    """A robot with a frame somewhere on one of its links."""
    robot, rng = draw(robots(max_joints=6)), draw(generators())
    place = random_placement(rng)
    joint = draw(st.integers(0, len(robot.joints) - 1))
    frame = Frame(name="tool", joint=joint, rotation=place.rotation, translation=place.translation)
    return Kinematics(robot), frame, draw(motions(robot, samples=2))


def assert_close(got, wanted, relative=1e-10):
    wanted = np.reshape(wanted, np.shape(got))  # Pinocchio drops the axis of a single joint
    np.testing.assert_allclose(got, wanted, rtol=0, atol=relative * max(np.abs(wanted).max(initial=0.0), 1.0))


def pinned(robot: Robot, frame: Frame):
    model = robot.model.copy()
    place = pin.SE3(np.array(frame.rotation), np.array(frame.translation))
    index = model.addFrame(pin.Frame("the frame", frame.joint + 1, 0, place, pin.FrameType.OP_FRAME))
    return model, model.createData(), index


@thorough
@given(cases())
def test_frames_and_their_motion_agree_with_pinocchio(case):
    kinematics, frame, (q, v, _) = case
    model, data, index = pinned(kinematics.robot, frame)
    pose = kinematics.poses(frame, q)
    for axes, reference in REFERENCES.items():
        jacobians, velocities = kinematics.jacobians(frame, q, axes), kinematics.velocities(frame, q, v, axes)
        for k in range(len(q)):
            pin.forwardKinematics(model, data, q[k], v[k])
            pin.updateFramePlacements(model, data)
            assert_close(pose.rotation[k], data.oMf[index].rotation)
            assert_close(pose.translation[k], data.oMf[index].translation)
            assert_close(jacobians[k], pin.computeFrameJacobian(model, data, q[k], index, reference))
            assert_close(velocities[k], pin.getFrameVelocity(model, data, index, reference).vector)


@thorough
@given(cases())
def test_center_of_mass_and_momentum_agree_with_pinocchio(case):
    kinematics, _, (q, v, _) = case
    model = kinematics.robot.model
    data = model.createData()
    centers, jacobians = kinematics.centers_of_mass(q), kinematics.center_of_mass_jacobians(q)
    matrices, momenta = kinematics.momentum_matrices(q), kinematics.momenta(q, v)
    for k in range(len(q)):
        assert_close(centers[k], pin.centerOfMass(model, data, q[k]))
        assert_close(jacobians[k], pin.jacobianCenterOfMass(model, data, q[k]))
        assert_close(matrices[k], pin.computeCentroidalMap(model, data, q[k]))
        assert_close(momenta[k], pin.computeCentroidalMomentum(model, data, q[k], v[k]).vector)


@quick
@given(cases())
def test_one_sample_is_as_one_of_many(case):
    kinematics, frame, (q, v, _) = case
    for of in (
        lambda q, v: kinematics.poses(frame, q).rotation,
        lambda q, v: kinematics.poses(frame, q).quaternion,
        lambda q, v: kinematics.poses(frame, q).rpy,
        lambda q, v: kinematics.jacobians(frame, q),
        lambda q, v: kinematics.velocities(frame, q, v),
        lambda q, v: kinematics.centers_of_mass(q),
        lambda q, v: kinematics.momenta(q, v),
    ):
        assert_close(of(q[0], v[0]), of(q, v)[0], relative=1e-13)


@quick
@given(cases())
def test_other_masses_move_the_center(case):
    kinematics, _, (q, _, _) = case
    theta = np.array(kinematics.robot.inertial_parameters)
    other = kinematics.robot.with_parameters(inertial_parameters=np.concatenate([3.0 * theta[:10], theta[10:]]))
    wanted = Kinematics(other).centers_of_mass(q)
    assert_close(kinematics.centers_of_mass(q, other.inertial_parameters), wanted)


URDF = """<robot name="r"><link name="base"/><link name="arm"/><link name="tool"/><link name="stand"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="flange" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.5 0 0" rpy="0 0 0.5"/></joint>
<joint name="bolts" type="fixed"><parent link="base"/><child link="stand"/><origin xyz="0 2 0"/></joint></robot>"""
MJCF = """<mujoco><worldbody><body name="arm" pos="0 0 1"><joint name="turn" axis="0 0 1" pos="0.1 0 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><site name="tool" pos="0.5 0 0" euler="0 0 30"/>
<camera name="eye" pos="0 0 0.2"/><site pos="1 1 1"/></body><site name="mark" pos="3 0 0"/></worldbody></mujoco>"""


@pytest.fixture(params=["urdf", "xml"])
def file(request, tmp_path):
    path = tmp_path / f"robot.{request.param}"
    path.write_text(URDF if request.param == "urdf" else MJCF)
    return path


@pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")
def test_fixed_frames_of_the_file_are_there(file):
    kinematics = Kinematics(Robot.from_file(file))
    format_ = kinematics.robot.source_format
    fixed = {"urdf": {"stand": (0, 2, 0), "base": (0, 0, 0)}, "mjcf": {"mark": (3, 0, 0)}}
    names = {"urdf": "base arm tool stand turn flange bolts", "mjcf": "arm tool mark eye turn"}
    assert set(kinematics.frames) == set(names[format_].split())
    for name, place in fixed[format_].items():
        np.testing.assert_allclose(kinematics.poses(name, [0.3]).translation, place)
        assert not kinematics.jacobians(name, [0.3]).any()
    here = kinematics.poses("tool", [0.0])
    np.testing.assert_allclose(here.translation, [0.5, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(here.rpy, [0, 0, {"urdf": 0.5, "mjcf": np.pi / 6}[format_]], atol=1e-9)


@pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")
def test_frames_beyond_a_locked_joint_move_with_the_joint_before_it(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(
        URDF.replace("</robot>", "")
        + '<link name="hand"/><joint name="wrist" type="revolute"><parent link="tool"/><child link="hand"/>'
        '<origin xyz="1 0 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
    )
    free, held = Robot.from_file(path), Robot.from_file(path, locked={"wrist": 0.4})
    for got, wanted in zip(
        Kinematics(held).poses("hand", [0.2]), Kinematics(free).poses("hand", [0.2, 0.4]), strict=True
    ):
        np.testing.assert_allclose(got, wanted, atol=1e-14)


def test_a_links_name_wins_over_a_joints(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(URDF.replace('joint name="bolts"', 'joint name="tool"'))
    with pytest.warns(match="has no <inertial>"):
        kinematics = Kinematics(Robot.from_file(path))
    np.testing.assert_allclose(kinematics.poses("tool", [0.0]).translation, [0.5, 0.0, 1.0])


def test_a_pickled_kinematics_gives_the_same():
    robot = random_robot(np.random.default_rng(0), [JointKind.REVOLUTE, JointKind.SPHERICAL])
    q = random_motion(robot, np.random.default_rng(1), 3).q
    kinematics = Kinematics(robot)
    wanted = kinematics.jacobians("joint_2", q)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(kinematics)).jacobians("joint_2", q), wanted)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda k: k.poses("jiont_1", np.zeros(5)), r"no frame 'jiont_1'; did you mean .*'joint_1'"),
        (lambda k: k.poses("joint_1", np.zeros(3)), r"q: wanted shape \(5,\) or \(N, 5\).*got \(3,\)"),
        (lambda k: k.poses("joint_1", [0, 0, 0, 0, 0]), "'joint_2' wants a quaternion .* of unit length"),
        (lambda k: k.poses("joint_1", [0, 0, np.nan, 0, 1]), "q: must be finite; sample 0"),
        (lambda k: k.velocities("joint_1", [0, 0, 0, 0, 1], [[0, 0, 0, 0]]), "as many of one as of the other"),
        (lambda k: k.centers_of_mass([0, 0, 0, 0, 1], np.zeros(20)), "masses sum to 0 kg"),
        (lambda k: k.centers_of_mass([0, 0, 0, 0, 1], np.zeros(3)), "wanted 20 finite numbers"),
        (
            lambda k: k.poses(Frame(name="f", joint=7, rotation=np.eye(3), translation=np.zeros(3)), [0, 0, 0, 0, 1]),
            "moves with joint 7",
        ),
        (lambda k: Frame(name="f", joint=0, rotation=2 * np.eye(3), translation=np.zeros(3)), "no rotation matrix"),
        (
            lambda k: Frame(name="f", joint=0, rotation=np.eye(2), translation=np.zeros(3)),
            r"wanted a rotation \(3, 3\)",
        ),
    ],
)
def test_bad_input_is_named(ask, message):
    robot = random_robot(np.random.default_rng(0), [JointKind.REVOLUTE, JointKind.SPHERICAL])
    with pytest.raises(ParameterError, match=message):
        ask(Kinematics(robot))

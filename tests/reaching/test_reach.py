"""Inverse kinematics: what can be reached is reached, what cannot ends at the nearest posture."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.kinematics import Frame, Kinematics, random_configurations, rotation_from_vector
from casysid.reaching import InverseKinematics, LookAt, PoseTarget, ReachSettings, ReachStatus
from casysid.robot import Robot
from tests.strategies import generators, robots

UPPER, FORE = 0.5, 0.3  # [m]
TIP = Frame(name="tip", joint=1, rotation=np.eye(3), translation=np.array([FORE, 0.0, 0.0]))


def planar_arm(limit=np.pi):
    model = pin.Model()
    place = pin.SE3(np.eye(3), np.array([UPPER, 0.0, 0.0]))
    shoulder = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "shoulder")
    model.addJoint(shoulder, pin.JointModelRZ(), place, "elbow")
    model.lowerPositionLimit, model.upperPositionLimit = np.full(2, -limit), np.full(2, limit)
    return Robot.from_pin(model)


def gantry():
    model = pin.Model()
    last = 0
    for name, joint in (("x", pin.JointModelPX()), ("y", pin.JointModelPY()), ("z", pin.JointModelPZ())):
        last = model.addJoint(last, joint, pin.SE3.Identity(), name)
    return Robot.from_pin(model)


def tip_at(x, y, z=0.0, **more):
    return PoseTarget(frame=TIP, position=np.array([x, y, z]), **more)


@settings(max_examples=40, deadline=None)
@given(robots(max_joints=5), generators())
def test_poses_of_any_tree_are_reached_within_its_limits(robot, rng):
    kinematics = Kinematics(robot)
    frame = f"joint_{len(robot.joints)}"
    wanted = kinematics.poses(frame, random_configurations(robot, rng, 1)[0])
    answer = InverseKinematics(kinematics).reach(
        PoseTarget(frame=frame, position=wanted.translation, rotation=wanted.rotation)
    )
    assert answer.status is ReachStatus.REACHED
    got = kinematics.poses(frame, answer.configuration)
    np.testing.assert_allclose(got.translation, wanted.translation, atol=1e-6)
    np.testing.assert_allclose(got.rotation, wanted.rotation, atol=2e-6)
    assert (answer.position >= robot.position_lower).all()
    assert (answer.position <= robot.position_upper).all()


@pytest.mark.parametrize("model", ["scara", "arm", "head"])
def test_bundled_robots_reach_what_they_can(model):
    robot = Robot.from_file(find_model(model))
    solver = InverseKinematics(robot)
    frame = {"scara": "tool", "arm": "palm", "head": "left_eye"}[model]
    q = random_configurations(robot, np.random.default_rng(5), 40)
    poses = solver.kinematics.poses(frame, q)
    for position, rotation in zip(poses.translation, poses.rotation, strict=True):
        answer = solver.reach(PoseTarget(frame=frame, position=position, rotation=rotation))
        assert answer.success
        assert max(answer.distance[0], answer.angle[0]) <= 1e-6


@given(st.floats(0.0, 2 * np.pi), st.floats(0.81, 5.0) | st.floats(0.0, 0.19), st.floats(-1.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_beyond_reach_the_nearest_posture_is_found(angle, radius, height):
    answer = InverseKinematics(planar_arm()).reach(tip_at(radius * np.cos(angle), radius * np.sin(angle), height))
    gap = radius - (UPPER + FORE) if radius > 0.5 else (UPPER - FORE) - radius
    assert answer.status is ReachStatus.NEAREST
    np.testing.assert_allclose(answer.distance, [np.hypot(gap, height)], atol=1e-6)


def test_a_stretched_arm_is_no_trap():
    answer = InverseKinematics(planar_arm()).reach(tip_at(0.5, 0.0), start=[0.0, 0.0])
    assert answer.success


@pytest.mark.parametrize("reach", [UPPER + FORE, UPPER - FORE])
def test_poses_that_are_singular_are_reached(reach):
    answer = InverseKinematics(planar_arm()).reach(tip_at(0.0, reach), start=[0.3, 0.4])
    assert answer.success
    assert np.isfinite(answer.configuration).all()


def test_limits_are_kept_where_they_are_in_the_way():
    robot = planar_arm(limit=0.5)
    answer = InverseKinematics(robot).reach(tip_at(-0.4, 0.3))
    assert answer.status is ReachStatus.NEAREST
    assert np.abs(answer.configuration).max() <= 0.5
    grid = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 401)] * 2), axis=-1).reshape(-1, 2)
    dense = np.linalg.norm(Kinematics(robot).poses(TIP, grid).translation - [-0.4, 0.3, 0.0], axis=1).min()
    np.testing.assert_allclose(answer.distance, [dense], atol=1e-4)


def test_several_targets_are_weighed():
    targets = [PoseTarget(frame="z", position=p, weight=w) for p, w in (([1, 0, 0], 1.0), ([0, 2, 4], 3.0))]
    answer = InverseKinematics(gantry()).reach(*targets)
    np.testing.assert_allclose(answer.configuration, [0.1, 1.8, 3.6], atol=1e-6)
    assert answer.status is ReachStatus.NEAREST
    np.testing.assert_allclose(answer.distance, [0.9 * np.sqrt(21), 0.1 * np.sqrt(21)], rtol=1e-6)


def test_two_frames_are_reached_at_once():
    robot = Robot.from_file(find_model("arm"))
    solver = InverseKinematics(robot)
    q = random_configurations(robot, np.random.default_rng(1), 10)
    for one in q:
        targets = [
            PoseTarget(frame=frame, position=solver.kinematics.poses(frame, one).translation)
            for frame in ("index_finger", "thumb", "palm")
        ]
        assert solver.reach(*targets).success


def test_eyes_look_at_a_point():
    solver = InverseKinematics(Robot.from_file(find_model("head")))
    eyes, point = ("left_eye", "right_eye"), np.array([1.0, 0.3, 0.4])
    answer = solver.reach(*(LookAt(frame=eye, point=point, axis=[1, 0, 0]) for eye in eyes))
    assert answer.success
    for eye in eyes:
        pose = solver.kinematics.poses(eye, answer.configuration)
        gap = point - pose.translation
        np.testing.assert_allclose(pose.rotation[:, 0], gap / np.linalg.norm(gap), atol=1e-6)


def test_a_path_is_followed_without_jumps():
    solver = InverseKinematics(planar_arm())
    path = [[tip_at(0.6 * np.cos(t), 0.6 * np.sin(t))] for t in np.linspace(0.0, 1.0, 50)]
    answers = solver.reach_path(path, start=[-0.3, 0.5])
    assert all(answer.success for answer in answers)
    assert np.abs(np.diff([answer.configuration for answer in answers], axis=0)).max() < 0.05


def test_a_start_that_is_there_is_the_answer():
    solver = InverseKinematics(planar_arm())
    start = np.array([0.4, -1.1])
    position = solver.kinematics.poses(TIP, start).translation
    answer = solver.reach(PoseTarget(frame=TIP, position=position), start=start)
    np.testing.assert_array_equal(answer.configuration, start)
    assert (answer.starts, answer.steps) == (1, 0)


@pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")
def test_a_floating_base_reaches_anywhere():
    robot = Robot.from_file(find_model("scara"), floating_base=True)
    R = rotation_from_vector([0.0, 2.0, -2.0])
    answer = InverseKinematics(robot).reach(PoseTarget(frame="tool", position=[9.0, -7.0, 5.0], rotation=R))
    assert answer.success


def test_loose_tolerances_take_fewer_steps():
    loose = ReachSettings(position_tolerance=1e-2, rotation_tolerance=1e-2)
    target, start = tip_at(0.2, 0.5), [0.0, 0.4]
    few = InverseKinematics(planar_arm(), loose).reach(target, start=start)
    many = InverseKinematics(planar_arm()).reach(target, start=start)
    assert few.success
    assert many.success
    assert few.steps < many.steps


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda s: s.reach(), "wanted at least one"),
        (lambda s: s.reach(PoseTarget(frame="tip", position=np.zeros(3))), "no frame 'tip'"),
        (lambda s: s.reach(tip_at(1, 0), start=[0.0]), r"q: wanted shape \(2,\)"),
        (lambda s: s.reach(tip_at(1, 0), start=np.zeros((3, 2))), "start: wanted one configuration"),
        (lambda s: s.reach(tip_at(1, 0), start=[0.0, np.inf]), "must be finite"),
        (lambda s: ReachSettings(starts=0), "starts must be positive"),
        (lambda s: ReachSettings(position_tolerance=-1.0), "position_tolerance must be positive"),
    ],
)
def test_bad_input_is_named(ask, message):
    with pytest.raises(ParameterError, match=message):
        ask(InverseKinematics(planar_arm()))

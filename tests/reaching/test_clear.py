"""Postures that keep distances and stay near a posture to rest in."""

import casadi as ca
import numpy as np
import pytest

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.excitation import Box, Capsule, HalfSpace, capsules_of
from casysid.kinematics import random_configurations
from casysid.reaching import InverseKinematics, PoseTarget, ReachStatus
from casysid.reaching.distances import distances
from casysid.reaching.guard import Guard
from casysid.robot import JointKind, Robot
from tests.reaching.test_reach import TIP, gantry, planar_arm, tip_at
from tests.strategies import random_robot

OBSTACLES = (HalfSpace("floor", [0.1, 0, 1.0], -0.2), Box("crate", [0.2, -0.4, 0.0], [0.5, 0.1, 0.4]))


@pytest.mark.parametrize("model", ["scara", "arm"])
def test_distances_are_those_of_excitation_and_their_slopes_too(model):
    robot = Robot.from_file(find_model(model))
    clearance = Guard(robot, OBSTACLES, None, 0.01).clearance
    q = ca.SX.sym("q", robot.nq)
    symbolic = distances(robot, q, clearance)
    function = ca.Function("f", [q], [symbolic, ca.jacobian(symbolic, q)])
    between = len(clearance.pairs)
    flat = sum(isinstance(clearance.obstacles[k], HalfSpace) for _, k in clearance.meetings)
    rng = np.random.default_rng(0)
    for sample in random_configurations(robot, rng, 20):
        frames = clearance.points.frames(sample[None])
        found = clearance.closest(frames)
        values = found.near.distance
        got, jacobian = (x.full() for x in function(sample))
        ends = values[0][between : between + 2 * flat].reshape(2, -1)  # of each capsule, to planes
        is_flat = [isinstance(clearance.obstacles[k], HalfSpace) for _, k in clearance.meetings]
        to_obstacles = np.empty(len(is_flat))
        to_obstacles[np.array(is_flat)] = ends.min(axis=0)
        to_obstacles[~np.array(is_flat)] = values[0][between + 2 * flat :]
        np.testing.assert_allclose(got.ravel(), [*values[0][:between], *to_obstacles], atol=2e-6)
        weights = np.zeros_like(values)
        weights[0, :between] = rng.normal(size=between) * (values[0, :between] > 1e-3)
        slopes = clearance.pull_back(frames, found, weights)[0]
        np.testing.assert_allclose(weights[0, :between] @ jacobian[:between], slopes, atol=1e-3)


def test_a_posture_that_reaches_is_kept():
    robot = Robot.from_file(find_model("arm"))
    solver = InverseKinematics(robot)
    for rest in random_configurations(robot, np.random.default_rng(2), 3):
        pose = solver.kinematics.poses("palm", rest)
        target = PoseTarget(frame="palm", position=pose.translation)
        answer = solver.reach_clear(target, start=np.zeros(robot.nq), rest=rest, capsules=())
        assert answer.success
        np.testing.assert_allclose(answer.configuration, rest, atol=1e-3)


def test_of_two_elbows_the_one_near_rest_is_taken():
    solver = InverseKinematics(planar_arm())
    for sign in (1.0, -1.0):
        answer = solver.reach_clear(tip_at(0.6, 0.0), rest=[0.0, sign], capsules=())
        assert answer.success
        assert np.sign(answer.configuration[1]) == sign


def arm_capsules():
    return [
        Capsule("upper", 0, np.zeros(3), np.array([0.5, 0, 0]), 0.02),
        Capsule("fore", 1, np.zeros(3), np.array([0.3, 0, 0]), 0.02),
    ]


def test_an_obstacle_makes_it_take_the_other_elbow():
    crate = Box("crate", [0.2, 0.15, -0.1], [0.5, 0.35, 0.1])
    solver = InverseKinematics(planar_arm())
    free = solver.reach_clear(tip_at(0.6, 0.0), rest=[0.5, -1.0], capsules=())
    answer = solver.reach_clear(
        tip_at(0.6, 0.0), rest=[0.5, -1.0], obstacles=[crate], capsules=arm_capsules(), margin=0.03
    )
    assert free.configuration[1] < 0.0 < answer.configuration[1]
    assert answer.success
    assert answer.clearance >= 0.03 - 1e-6
    assert "crate" in answer.nearest


def test_what_is_inside_an_obstacle_is_come_near_to():
    wall = HalfSpace("wall", [-1.0, 0, 0], -0.5)
    answer = InverseKinematics(planar_arm()).reach_clear(
        tip_at(0.6, 0.1), obstacles=[wall], capsules=arm_capsules(), margin=0.01
    )
    assert answer.status is ReachStatus.NEAREST
    np.testing.assert_allclose(answer.distance, [0.6 - 0.5 + 0.02 + 0.01], atol=1e-4)
    assert answer.clearance >= 0.01 - 1e-6
    assert answer.nearest == "link 'fore' and 'wall'"


def test_where_no_posture_is_clear_it_is_said():
    floor = HalfSpace("floor", [0, 0, 1.0], 1.0)
    capsule = Capsule("tip", 2, np.zeros(3), np.array([0.1, 0, 0]), 0.02)
    model = gantry().model.copy()
    model.lowerPositionLimit, model.upperPositionLimit = np.full(3, -0.5), np.full(3, 0.5)
    target = PoseTarget(frame="z", position=np.zeros(3))
    answer = InverseKinematics(Robot.from_pin(model)).reach_clear(target, obstacles=[floor], capsules=[capsule])
    assert answer.status is ReachStatus.IN_THE_WAY
    assert not answer.success


def test_the_robots_own_links_are_kept_apart():
    robot = Robot.from_file(find_model("arm"))
    solver = InverseKinematics(robot)
    pose = solver.kinematics.poses("palm", np.zeros(robot.nq))
    answer = solver.reach_clear(PoseTarget(frame="palm", position=pose.translation), margin=0.005)
    assert answer.success
    guard = Guard(robot, (), capsules_of(robot), 0.005)
    assert guard.least(answer.configuration)[0] == answer.clearance >= 0.005 - 1e-6


def test_joints_of_all_kinds_rest_where_they_are():
    kinds = [JointKind.SPHERICAL, JointKind.CONTINUOUS, JointKind.PLANAR, JointKind.REVOLUTE]
    robot = random_robot(np.random.default_rng(3), kinds)
    solver = InverseKinematics(robot)
    rest = random_configurations(robot, np.random.default_rng(4), 1)[0]
    pose = solver.kinematics.poses("joint_4", rest)
    target = PoseTarget(frame="joint_4", position=pose.translation, rotation=pose.rotation)
    answer = solver.reach_clear(target, rest=rest, capsules=())
    assert answer.success
    np.testing.assert_allclose(answer.configuration, rest, atol=1e-4)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"margin": -0.1}, "margin: wanted a distance"),
        ({"capsules": (), "obstacles": OBSTACLES}, "no capsules to keep at a distance"),
        ({"rest": [0.0]}, r"q: wanted shape \(2,\)"),
    ],
)
def test_bad_input_is_named(more, message):
    with pytest.raises(ParameterError, match=message):
        InverseKinematics(planar_arm()).reach_clear(PoseTarget(frame=TIP, position=np.zeros(3)), **more)


def test_distances_of_joints_with_several_freedoms_are_refused():
    robot = random_robot(np.random.default_rng(0), [JointKind.SPHERICAL])
    with pytest.raises(ParameterError, match="'joint_1' has several degrees of freedom"):
        InverseKinematics(robot).reach_clear(PoseTarget(frame="joint_1", position=np.zeros(3)))

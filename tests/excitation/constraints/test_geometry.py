import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.excitation.constraints import distance
from casysid.excitation.constraints.capsules import Capsule, capsules_of, cover
from casysid.excitation.constraints.clearance import build_clearance
from casysid.excitation.constraints.kinematics import WORLD, Points
from casysid.excitation.constraints.obstacles import Box, HalfSpace
from casysid.excitation.motion.limits import limits_of
from casysid.robot import JointKind, Robot
from casysid.robot.coordinates import configuration_from_channels
from tests.strategies import random_robot

seeds = st.integers(0, 2**32 - 1)
SINGLE = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


def tree(rng, joints):
    return random_robot(
        rng, [SINGLE[k] for k in rng.integers(3, size=joints)], rng.integers(0, 3, size=joints).tolist()
    )


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_frames_are_those_of_pinocchio(seed):
    rng = np.random.default_rng(seed)
    robot = tree(rng, 4)
    position = rng.uniform(-2.0, 2.0, (3, 4))
    frames, data = Points(robot).frames(position), robot.model.createData()
    for k, q in enumerate(position):
        pin.forwardKinematics(robot.model, data, configuration_from_channels(robot, q[None])[0])
        for i in range(4):
            np.testing.assert_allclose(frames.rotation[:, :, k, i], data.oMi[i + 1].rotation, atol=1e-12)
            np.testing.assert_allclose(frames.origin[:, k, i], data.oMi[i + 1].translation, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_segment_distances_are_those_of_coal(seed):
    rng = np.random.default_rng(seed)
    ends = rng.normal(size=(4, 3, 1))
    near = distance.between_segments(*ends)
    shapes = [_coal_capsule(ends[i, :, 0], ends[i + 1, :, 0], 1e-3) for i in (0, 2)]
    wanted = coal.distance(*shapes[0], *shapes[1], coal.DistanceRequest(), coal.DistanceResult())
    assert near.distance[0] - 2e-3 == pytest.approx(wanted, abs=1e-5)


def _coal_capsule(start, end, radius):
    axis = (end - start) / np.linalg.norm(end - start)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).toRotationMatrix()
    return coal.Capsule(radius, float(np.linalg.norm(end - start))), coal.Transform3s(turn, (start + end) / 2.0)


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_box_distances_are_least_over_the_segment(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(scale=1.5, size=(2, 3, 1))
    half = rng.uniform(0.2, 1.0, (3, 1))
    near = distance.to_boxes(a, b, -half, half)
    points = a + np.linspace(0.0, 1.0, 4001) * (b - a)
    beyond = np.abs(points) - half
    signed = np.linalg.norm(np.maximum(beyond, 0.0), axis=0) + np.minimum(beyond.max(axis=0), 0.0)
    assert near.distance[0] == pytest.approx(signed.min(), abs=2e-3)
    assert near.distance[0] <= signed.min() + 1e-6


@settings(max_examples=15, deadline=None)
@given(seeds)
def test_distances_have_the_slopes_of_finite_differences(seed):
    rng = np.random.default_rng(seed)
    robot = tree(rng, 5)
    around = [Capsule(f"l{i}", i, rng.normal(size=3), rng.normal(size=3), 0.01) for i in (WORLD, 0, 1, 2, 3, 4)]
    obstacles = [
        HalfSpace("floor", np.array([0.1, 0.2, 1.0]), -1.0),
        Box("box", np.array([1.0, 1.0, 1.0]), np.array([2.0, 2.0, 3.0])),
    ]
    position = rng.uniform(-1.0, 1.0, (2, 5))
    clearance = build_clearance(robot, around, obstacles, rng.uniform(-3.0, 3.0, (50, 5)), -10.0)
    frames, distances = clearance.points.frames(position), clearance.distances(position)
    found = clearance.closest(frames)
    h, direction = 1e-6, rng.normal(size=5)
    ahead, behind = (clearance.distances(position + step * direction) for step in (h, -h))
    smooth = np.abs(ahead + behind - 2 * distances) < 1e-8  # a kink where the nearest points change
    weights = rng.normal(size=distances.shape) * smooth
    slope = clearance.pull_back(frames, found, weights) @ direction
    wanted = (weights * (ahead - behind) / (2 * h)).sum(axis=1)
    np.testing.assert_allclose(slope, wanted, atol=1e-4 * max(1.0, np.abs(wanted).max()))
    assert smooth.mean() > 0.5


@settings(max_examples=25, deadline=None)
@given(st.floats(0.01, 1.0), st.floats(0.01, 1.0))
def test_covers_hold_the_corners(half, radius):
    capsule = cover("link", 0, pin.SE3.Identity(), 2, half, radius)
    corner = np.array([[radius], [0.0], [half]])
    near = distance.between_segments(capsule.start[:, None], capsule.end[:, None], corner, corner)
    assert near.distance[0] <= capsule.radius + 1e-12


@pytest.mark.parametrize("name", ["two_link", "head", "scara"])
def test_urdf_and_mjcf_of_a_machine_have_capsules_in_the_same_places(name):
    def reach(suffix):
        robot = Robot.from_file(find_model(f"{name}{suffix}"))
        limits = limits_of(robot)
        position = np.random.default_rng(0).uniform(limits.lower, limits.upper, (20, robot.nv))
        capsules = [capsule for capsule in capsules_of(robot) if capsule.joint != WORLD]
        joint = np.array([capsule.joint for capsule in capsules])
        points = Points(robot)
        middles = np.array([(capsule.start + capsule.end) / 2.0 for capsule in capsules])
        places = points.places(points.frames(position), joint, middles).transpose(1, 2, 0)
        return np.sort(places, axis=1), sorted(capsule.radius for capsule in capsules)

    (urdf, thick), (mjcf, same) = reach(".urdf"), reach(".xml")
    np.testing.assert_allclose(thick, same, atol=2e-3)
    np.testing.assert_allclose(urdf, mjcf, atol=1e-3)


def test_neighbours_and_whatever_always_overlaps_are_left_out_and_named():
    robot = Robot.from_file(find_model("two_link"))
    fat = [Capsule("base", WORLD, np.zeros(3), np.ones(3), 5.0), Capsule("tip", 1, np.zeros(3), np.ones(3), 5.0)]
    clearance = build_clearance(robot, fat, (), np.zeros((3, 2)), 0.01)
    assert len(clearance) == 0
    assert "overlap" in clearance.ignored[0]
    assert "tip" in clearance.ignored[0]


@pytest.mark.parametrize(
    "make",
    [
        lambda: Capsule("l", 0, np.zeros(3), np.zeros(3), 0.0),
        lambda: HalfSpace("f", np.zeros(3), 0.0),
        lambda: Box("b", np.ones(3), np.zeros(3)),
    ],
)
def test_impossible_shapes_are_refused(make):
    with pytest.raises(ParameterError, match=r"wanted"):
        make()

"""Errors, their Jacobians and their lengths: against finite differences, against NumPy, at half turns."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.kinematics import Frame, Kinematics, rotation_from_vector
from casysid.reaching import LookAt, PoseTarget
from casysid.reaching.problem import Problem
from tests.strategies import configurations, generators, random_placement, robots

quick = settings(max_examples=30, deadline=None)


@st.composite
def frames(draw, robot):
    place = random_placement(draw(generators()))
    joint = draw(st.integers(0, len(robot.joints) - 1))
    return Frame(name="tool", joint=joint, rotation=place.rotation, translation=place.translation)


@st.composite
def targets(draw, robot):
    rng, frame, weights = draw(generators()), draw(frames(robot)), draw(st.sampled_from([(1.0, 1.0), (3.0, 0.2)]))
    more = {"frame": frame, "weight": weights[0], "radius": weights[1]}
    position, rotation = rng.normal(size=3), rotation_from_vector(rng.uniform(-1.7, 1.7, 3))
    match draw(st.sampled_from(["pose", "position", "rotation", "look"])):
        case "pose":
            return PoseTarget(position=position, rotation=rotation, **more)
        case "position":
            return PoseTarget(position=position, **more)
        case "rotation":
            return PoseTarget(rotation=rotation, **more)
        case _:
            return LookAt(point=3.0 * position, axis=rng.normal(size=3), **more)


@st.composite
def problems(draw):
    robot = draw(robots(max_joints=5))
    some = [draw(targets(robot)) for _ in range(draw(st.integers(1, 3)))]
    return Kinematics(robot), some, draw(configurations(robot))


@quick
@given(problems())
def test_descent_is_the_gradient(case):
    kinematics, some, q = case
    problem, model, step = Problem(kinematics, some), kinematics.robot.model, 1e-6
    problem.aim(some)
    for target in some:  # at a half turn the shortest way back jumps from one side to the other
        if target.lengths(kinematics.poses(target.frame, q))[1] > 3.0:
            return
    here = problem.at(q)
    for k in range(kinematics.robot.nv):
        ahead, behind = (
            problem.at(pin.integrate(model, q, s * step * np.eye(len(here.descent))[k])).cost for s in (1, -1)
        )
        np.testing.assert_allclose(-2.0 * here.descent[k], (ahead - behind) / (2 * step), atol=1e-6 * (1 + here.cost))


@quick
@given(problems())
def test_lengths_are_those_of_numpy_and_make_the_cost(case):
    kinematics, some, q = case
    problem = Problem(kinematics, some)
    problem.aim(some)
    here = problem.at(q)
    wanted = np.array([target.lengths(kinematics.poses(target.frame, q)) for target in some])
    np.testing.assert_allclose(here.lengths, wanted, atol=2e-7)  # an arcsine near a half turn has half the digits
    weights = np.array([[target.weight, target.weight * target.radius] for target in some])
    np.testing.assert_allclose(here.cost, np.sum((weights * here.lengths) ** 2), rtol=1e-12)


def ball():
    model = pin.Model()
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    from casysid.robot import Robot

    return Kinematics(Robot.from_pin(model))


@pytest.mark.parametrize("axis", [*np.eye(3), [1, 1, 0], [1, -2, 3]])
@pytest.mark.parametrize("short", [0.0, 1e-12, 1e-9, 1e-7, 1e-4])
def test_half_a_turn_away_is_told_as_such(axis, short):
    vector = (np.pi - short) * np.array(axis) / np.linalg.norm(axis)
    target = PoseTarget(frame="ball", rotation=rotation_from_vector(vector))
    problem = Problem(ball(), [target])
    problem.aim([target])
    here = problem.at(np.array([0, 0, 0, 1.0]))
    np.testing.assert_allclose(here.lengths, [[0.0, np.pi - short]], atol=1e-7)
    np.testing.assert_allclose(np.abs(here.descent), np.abs(vector), atol=1e-6)


def test_looking_the_wrong_way_leads_back():
    target = LookAt(frame="ball", point=[0, 0, -2.0], axis=[0, 0, 1.0])
    problem = Problem(ball(), [target])
    problem.aim([target])
    here = problem.at(np.array([0, 0, 0, 1.0]))
    np.testing.assert_allclose(here.lengths, [[0.0, np.pi]])
    np.testing.assert_allclose(np.linalg.norm(here.descent), np.pi)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PoseTarget(frame="f"), "'f': wanted a position, a rotation, or both"),
        (lambda: PoseTarget(frame="f", position=[0, 1]), "three finite numbers as its position"),
        (lambda: PoseTarget(frame="f", position=[0, 1, np.nan]), "three finite numbers as its position"),
        (lambda: PoseTarget(frame="f", rotation=-np.eye(3)), "no rotation matrix"),
        (lambda: PoseTarget(frame="f", rotation=np.zeros((3, 3))), "no rotation matrix"),
        (lambda: PoseTarget(frame="f", position=np.zeros(3), weight=0.0), "wanted a positive weight; got 0"),
        (lambda: PoseTarget(frame="f", position=np.zeros(3), radius=-1.0), "wanted a positive radius"),
        (lambda: LookAt(frame="f", point=np.zeros(3), axis=np.zeros(3)), "axis that looks must not be zero"),
    ],
)
def test_what_is_no_target_is_refused(make, message):
    with pytest.raises(ParameterError, match=message):
        make()

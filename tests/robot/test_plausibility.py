"""What no link can be is named, whatever the robot's size; what files usually get wrong is not."""

import dataclasses
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import CasysidWarning
from casysid.inertia import inertial_parameters, is_consistent, mass_properties
from casysid.robot import Robot
from casysid.robot.likely_bodies import believed
from casysid.robot.plausibility import Implausibility, bodies_of, doubtful_inertias

MODELS = Path(__file__).resolve().parents[2] / "models"
WRONG = {
    "mass in g": (1e3, 1.0, 1.0),
    "centre of mass in mm": (1.0, 1e3, 1.0),
    "inertia in kg mm²": (1.0, 1.0, 1e6),
    "inertia in g mm²": (1.0, 1.0, 1e9),
    "inertia in g cm²": (1.0, 1.0, 1e7),
}


@st.composite
def arms(draw, most: int = 5) -> Robot:
    """Arms of bars 5 cm to 1.5 m long, a fifth to a half as thick, as dense as parts of robots are."""
    count, model, onward = draw(st.integers(2, most)), pin.Model(), 0.0
    scale = draw(st.floats(0.1, 1.5))
    for k in range(count):
        length = scale * draw(st.floats(0.5, 1.0))
        before = np.array([0.0, 0.0, onward])
        kind = pin.JointModelRY() if k % 2 else pin.JointModelRX()
        joint = model.addJoint(k, kind, pin.SE3(np.eye(3), before), f"j{k}")
        size = length * np.array([draw(st.floats(0.2, 0.5)), draw(st.floats(0.2, 0.5)), 1.0])
        mass = draw(st.floats(200.0, 3000.0)) * np.prod(size)
        square = np.square(size) / 12.0
        center = length * np.array([draw(st.floats(-0.2, 0.2)), 0.02, draw(st.floats(0.3, 0.7))])
        theta = inertial_parameters(mass, center, mass * np.diag(square.sum() - square))
        model.appendBodyToJoint(joint, pin.Inertia.FromDynamicParameters(theta), pin.SE3.Identity())
        onward = length
    return Robot.from_pin(model, name="arm")


def spoilt(robot: Robot, link: int | slice, factors: tuple[float, float, float]) -> Robot:
    """Mass, centre of mass and inertia of one link, or of several, multiplied."""
    bodies = robot.inertial_parameters.reshape(-1, 10).copy()
    body = mass_properties(bodies)
    wrong = inertial_parameters(body.mass * factors[0], body.center_of_mass * factors[1], body.inertia * factors[2])
    bodies[link] = wrong[link]
    return robot.with_parameters(inertial_parameters=bodies.ravel())


@given(robot=arms(), data=st.data())
@settings(max_examples=60, deadline=None)
def test_files_that_are_off_by_a_half_are_believed(robot, data):
    factor = st.floats(0.5, 2.0)
    robot = spoilt(robot, slice(None), (data.draw(factor), 1.0, data.draw(factor)))
    assert doubtful_inertias(robot) == ()
    assert believed(robot).robot is robot


@given(robot=arms(), data=st.data())
@settings(max_examples=60, deadline=None)
@pytest.mark.parametrize("unit", WRONG)
def test_one_link_in_other_units_is_named_and_read_in_them(unit, robot, data):
    link = data.draw(st.integers(0, len(robot.links) - 1))
    witness = believed(spoilt(robot, link, WRONG[unit]))
    assert [one.doubt.link for one in witness.replacements] == [robot.links[link]]
    found, true = (mass_properties(one.inertial_parameters.reshape(-1, 10)) for one in (witness.robot, robot))
    np.testing.assert_allclose(found.mass, true.mass, rtol=1e-9)
    np.testing.assert_allclose(found.center_of_mass, true.center_of_mass, atol=1e-9)
    ratio = np.sqrt(np.trace(found.inertia[link]) / np.trace(true.inertia[link]))
    assert 0.3 < ratio < 4.0  # g cm² and kg mm² are a factor of three apart in a body's size, as links are


@given(robot=arms())
@settings(max_examples=40, deadline=None)
@pytest.mark.parametrize("unit", ["mass in g", "centre of mass in mm", "inertia in kg mm²", "inertia in g mm²"])
def test_a_whole_file_in_other_units_is_read_as_meant(unit, robot):
    witness = believed(spoilt(robot, slice(None), WRONG[unit]))
    assert {one.doubt.link for one in witness.replacements} == set(robot.links)
    np.testing.assert_allclose(
        witness.robot.inertial_parameters,
        robot.inertial_parameters,
        rtol=1e-6,
        atol=1e-7 * robot.inertial_parameters.max(),
    )


@given(robot=arms(), inertia=st.sampled_from([1.0, 0.1, 0.01, 0.001]))
@settings(max_examples=60, deadline=None)
def test_one_inertia_for_links_of_different_mass_is_a_placeholder_and_masses_are_kept(robot, inertia):
    body = mass_properties(robot.inertial_parameters.reshape(-1, 10))
    body = dataclasses.replace(body, mass=body.mass * (1.0 + 0.01 * np.arange(len(robot.links))))
    tensors = np.tile(inertia * np.eye(3), (len(robot.links), 1, 1))
    placeholder = robot.with_parameters(
        inertial_parameters=inertial_parameters(body.mass, body.center_of_mass, tensors).ravel()
    )
    doubts = doubtful_inertias(placeholder)
    assert [doubt.link for doubt in doubts] == list(robot.links)
    assert all(Implausibility.COPIED in doubt.kinds for doubt in doubts)
    found = mass_properties(believed(placeholder).robot.inertial_parameters.reshape(-1, 10))
    np.testing.assert_allclose(found.mass, body.mass)
    np.testing.assert_allclose(found.center_of_mass, body.center_of_mass)


@given(robot=arms(), size=st.sampled_from([1.0, 0.1, 0.01]))
@settings(max_examples=60, deadline=None)
def test_what_takes_the_place_of_placeholders_is_possible_and_of_the_links_size(robot, size):
    ball = inertial_parameters(size, np.zeros(3), size * np.eye(3))
    witness = believed(robot.with_parameters(inertial_parameters=np.tile(ball, len(robot.links))))
    assert len(witness.replacements) == len(robot.links)
    bodies = bodies_of(witness.robot)
    assert is_consistent(witness.robot.inertial_parameters.reshape(-1, 10)).all()
    assert (bodies.gyration < bodies.length).all()
    assert (bodies.density < 8000.0).all()
    assert doubtful_inertias(witness.robot) == ()


@given(robot=arms(), exponent=st.integers(-3, 3))
@settings(max_examples=40, deadline=None)
def test_what_is_named_does_not_depend_on_the_scale_of_a_robot_in_proportion(robot, exponent):
    """Lengths times s and masses times s³: the same robot, larger."""
    wide = spoilt(robot, 0, (1.0, 1.0, 1e6))
    scale = 1.5**exponent
    model = robot.model.copy()
    for k in range(1, model.njoints):
        place = model.jointPlacements[k].copy()
        place.translation = scale * place.translation
        model.jointPlacements[k] = place
    larger = Robot.from_pin(model).with_parameters(
        inertial_parameters=wide.inertial_parameters
        * np.tile(scale ** np.repeat([3.0, 4.0, 5.0], [1, 3, 6]), len(robot.links))
    )
    assert [doubt.link for doubt in doubtful_inertias(larger)] == [doubt.link for doubt in doubtful_inertias(wide)]


def test_equal_parts_are_no_placeholders():
    """A chain of equal modules, and a mirrored pair of legs."""
    model = pin.Model()
    theta = inertial_parameters(1.2, np.array([0.0, 0.01, 0.07]), np.diag([2e-3, 2e-3, 5e-4]))
    for k in range(4):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.15]) if k else np.zeros(3))
        joint = model.addJoint(k, pin.JointModelRX() if k % 2 else pin.JointModelRY(), place, f"j{k}")
        model.appendBodyToJoint(joint, pin.Inertia.FromDynamicParameters(theta), pin.SE3.Identity())
    assert doubtful_inertias(Robot.from_pin(model)) == ()


def test_a_kept_link_stays_as_it_is():
    model = pin.buildSampleModelManipulator()
    good = Robot.from_pin(model)
    wrong = spoilt(good, 1, (1.0, 1.0, 1e9))
    witness = believed(wrong, kept=[good.links[1]])
    np.testing.assert_array_equal(
        witness.robot.inertial_parameters.reshape(-1, 10)[1], wrong.inertial_parameters.reshape(-1, 10)[1]
    )


def test_bundled_models_are_believed():
    for path in sorted(MODELS.glob("*/*.urdf")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CasysidWarning)
            assert doubtful_inertias(Robot.from_file(path)) == (), path

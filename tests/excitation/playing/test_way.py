import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.excitation import FourierSeries, PlayedMotion, build_excitation, design_excitation, find_way
from casysid.excitation.constraints.obstacles import Box
from casysid.excitation.playing.files import write_excitation
from casysid.excitation.playing.way import SPEED, Way
from casysid.recording import read_recording
from casysid.robot import Robot


@pytest.fixture(scope="module")
def problem():
    return build_excitation(Robot.from_file(find_model("two_link.urdf")), series=FourierSeries(5.0, 3), rate=100.0)


@pytest.fixture(scope="module")
def design(problem):
    return design_excitation(problem, starts=1, max_iterations=20)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_way_rests_at_its_places_and_its_derivatives_are_those_of_its_positions(seed):
    rng = np.random.default_rng(seed)
    way = Way(rng.normal(size=(3, 2)), rng.uniform(0.5, 3.0, 2))
    since = np.concatenate([[0.0], np.cumsum(way.durations)])
    at = way.motion(since)
    np.testing.assert_allclose(at.position, way.places, atol=1e-12)
    np.testing.assert_allclose(at.velocity, 0.0, atol=1e-9)
    np.testing.assert_allclose(at.acceleration, 0.0, atol=1e-9)
    time, h = rng.uniform(1e-3, way.duration - 1e-3, 20), 1e-5
    time = time[np.abs(time[:, None] - since).min(axis=1) > h]
    ahead, here, behind = (way.motion(time + step) for step in (h, 0.0, -h))
    for order in range(3):
        np.testing.assert_allclose((ahead[order] - behind[order]) / (2 * h), here[order + 1], atol=1e-3)
    np.testing.assert_allclose(way.back().motion(way.duration - time).position, here.position, atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_way_uses_its_share_of_the_velocity_limits(problem, seed):
    rng = np.random.default_rng(seed)
    limits = problem.limits
    places = limits.middle + rng.uniform(-0.3, 0.3, (2, 2)) * limits.half_range
    way = find_way(dataclasses.replace(problem, constraints=()), places[0], places[1])
    moved = way.motion(np.linspace(0.0, way.duration, 400))
    assert (np.abs(moved.velocity) <= SPEED * limits.velocity * (1 + 1e-9)).all()


def test_the_way_goes_around_what_is_in_the_way():
    robot = Robot.from_file(find_model("scara.urdf"))
    wall = Box("post", np.array([0.45, -0.05, -1.0]), np.array([0.55, 0.05, 1.0]))
    problem = build_excitation(robot, obstacles=(wall,))
    quill = problem.limits.middle[2]
    way = find_way(problem, [0.7, 0.0, quill, 0.0], np.array([-0.7, 0.0, quill, 0.0]))
    distances = problem.solids.distances(way.motion(np.linspace(0.0, way.duration, 500)).position)
    assert len(way.places) > 2
    assert distances.min() > 0.0


@pytest.mark.parametrize(
    ("present", "message"),
    [([0.0], "must be 2 finite numbers"), ([0.0, 99.0], "within its limits"), ([np.nan, 0.0], "finite")],
)
def test_a_place_where_the_robot_cannot_be_is_refused(problem, present, message):
    with pytest.raises(ParameterError, match=message):
        find_way(problem, present, problem.limits.middle)


def test_what_is_played_is_continuous_and_returns(design):
    here = design.trajectory.start * 0.9
    played = PlayedMotion(design.trajectory, find_way(design.problem, here, design.trajectory.start))
    time = np.linspace(0.0, played.duration, 5000)
    moved = played.motion(time)
    np.testing.assert_allclose(moved.position[[0, -1]], [here, here], atol=1e-9)
    step = np.diff(moved.position, axis=0) / np.diff(time)[:, None]
    np.testing.assert_allclose(step, (moved.velocity[1:] + moved.velocity[:-1]) / 2.0, atol=2e-2)


def test_half_the_speed_is_the_same_path_at_half_the_velocity(design):
    slow = design.at_speed(0.5)
    time = np.linspace(0.0, design.trajectory.duration, 50)
    fast, slower = design.trajectory.motion(time), slow.trajectory.motion(2.0 * time)
    for order in range(4):
        np.testing.assert_allclose(slower[order], fast[order] * 0.5**order, atol=1e-9)
    assert slow.check().passed
    with pytest.raises(ParameterError, match="speed"):
        design.at_speed(1.5)


def test_files_hold_the_ways_at_the_controllers_rate(design, tmp_path):
    here = design.trajectory.start * 0.9
    played = PlayedMotion(design.trajectory, find_way(design.problem, here, design.trajectory.start))
    write_excitation(design, tmp_path, rate=250.0, played=played)
    recording = read_recording(tmp_path / "excitation.csv", design.problem.robot)
    assert recording.rate == pytest.approx(250.0)
    np.testing.assert_allclose(recording.position, played.motion(recording.time).position, atol=1e-6)
    message = (tmp_path / "joint_trajectory.yaml").read_text()
    assert message.count("positions:") == len(recording.time)
    noted = json.loads((tmp_path / "excitation.json").read_text())
    assert noted["approach"]["places"][0] == pytest.approx(here.tolist())
    assert noted["collisions"]["distance"] > 0.0
    assert "From the present position" in (tmp_path / "excitation.txt").read_text()

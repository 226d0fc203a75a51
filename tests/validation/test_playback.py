"""A designed motion, played on a simulated machine, keeps the robot's limits."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.excitation import FourierSeries, build_excitation, design_excitation, design_set, limits_of
from casysid.robot import Robot
from casysid.validation import DesignedMotion, RehearsalSettings, play
from casysid.validation.exciting import plan_set
from casysid.validation.rehearsal import build_machine

SERIES = FourierSeries(5.0, 3)


@pytest.fixture(scope="module")
def robot():
    return Robot.from_file(find_model("two_link"))


@pytest.fixture(scope="module")
def designs(robot):
    return design_set(build_excitation(robot, series=SERIES), 2, starts=1)


def test_a_machine_unlike_its_file_keeps_the_files_limits(robot, designs):
    limits = limits_of(robot, position_share=1.0, velocity_share=1.0, torque_share=1.0)
    file = build_excitation(robot, series=SERIES, limits=limits, clearance=0.0)
    played = play(designs[0], build_machine(robot, RehearsalSettings(seed=3)), within=file)
    assert played.verification.passed
    assert {margin.kind for margin in played.verification.margins} == {"position", "velocity", "torque", "distance"}
    assert np.abs(played.run.q - played.run.reference.q).max() > 1e-5


def test_a_machine_like_its_file_hardly_leaves_the_motion(designs):
    played = play(designs[0], rate=1000.0)
    planned = designs[0].check(10 * designs[0].problem.samples)
    for was, planned_one in zip(played.verification.margins, planned.margins, strict=True):
        if was.kind in ("position", "velocity"):
            assert abs(was.share - planned_one.share) < 0.01


def test_a_motion_beyond_the_limits_is_seen_to_violate_them(designs):
    larger = dataclasses.replace(designs[0].trajectory, coordinates=1.3 * designs[0].trajectory.coordinates)
    played = play(dataclasses.replace(designs[0], trajectory=larger))
    assert {one.kind for one in played.verification.violations} >= {"position", "velocity"}


def test_motions_of_a_set_follow_one_another_without_a_jump(designs):
    motion = DesignedMotion.of(designs)
    time = np.linspace(0.0, motion.duration + 1.0, 4001)
    reference = motion.sample(time)
    speed = np.abs(reference.v).max(axis=0)
    assert (np.abs(np.diff(reference.q, axis=0)).max(axis=0) <= 1.01 * speed * time[1]).all()
    second = designs[1].trajectory.motion(1.25)
    np.testing.assert_allclose(motion.sample(np.array([6.25])).q[0], np.ravel(second.position), atol=1e-12)
    np.testing.assert_allclose(motion.sample(np.array([11.0])).q, motion.sample(np.array([1.0])).q, atol=1e-9)


def test_motions_from_different_places_are_refused(robot, designs):
    other = design_excitation(build_excitation(robot, series=SERIES, start=[0.3, 0.4]), starts=1, max_iterations=5)
    with pytest.raises(ParameterError, match="must start where the one before it ends; joint '"):
        DesignedMotion.of([designs[0], other])


@settings(deadline=None)
@given(st.floats(3.0, 20.0), st.floats(4.0, 300.0))
def test_a_set_fills_the_recording_with_whole_periods_of_about_the_usual_length(period, duration):
    series, count, periods = plan_set(FourierSeries(period, 5), duration)
    assert count * periods * series.period == pytest.approx(duration)
    assert 1 <= count <= 3
    if duration >= period:
        assert 0.5 <= series.period / period <= 2.0

"""Wrong clocks, and torques that hold no inertia, are found out; honest logs of wrong models are left alone."""

import dataclasses

import numpy as np
import pytest

from casysid.dynamics import Armature, Coulomb, Offset, Viscous, build_regressor
from casysid.errors import CasysidWarning, ParameterError
from casysid.identification import Settings, identify
from casysid.identification.passes import Passes
from casysid.identification.tuning.band import choose_band
from casysid.identification.tuning.candidates import gather_candidates
from casysid.identification.tuning.clock import (
    choose_clock,
    has_placeholder_inertias,
    inertial_shares,
    split_moments,
)
from casysid.recording import Recording
from casysid.simulation import design_sinusoids
from tests.simulated import bundled_robot

RATE, DURATION = 200.0, 20.0
FRICTION = (Viscous(), Coulomb(width=1e-3), Offset(), Armature())


def recorded(name, seed=0, *, quasi_static=False, rotor=1.0, velocity=False, noise=1e-5, highest=1.0):
    """A log of a robot whose bodies are up to 30 % off its file's, and whose rotors are ``rotor`` times as large."""
    robot, rng = bundled_robot(name), np.random.default_rng(seed)
    time = np.arange(0, DURATION, 1 / RATE)
    motion = design_sinusoids(robot, duration=DURATION, seed=seed, band=(0.1, highest)).sample(time)
    regressor = build_regressor(robot, friction=FRICTION, quasi_static=quasi_static)
    off = np.repeat(rng.uniform(0.7, 1.3, len(robot.links)), 10)
    drives = [rotor if parameter.kind == "armature" else 1.0 for parameter in regressor.parameters[off.size :]]
    tau = regressor.predict(regressor.prior * np.concatenate([off, drives]), motion.q, motion.v, motion.a)
    recording = Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=time,
        position=motion.channels + noise * rng.normal(size=motion.channels.shape),
        velocity=motion.v if velocity else None,
        torque=tau + 0.03 * tau.std(axis=0) * rng.normal(size=tau.shape),
    )
    return robot, recording


def gathered(robot, recording):
    """One pass over a recording with all columns."""
    passes = Passes(robot, [recording], choose_band([recording]))
    return passes, gather_candidates(passes, Settings(choose_friction=False))


def found_clock(robot, recording, *given):
    return choose_clock(*gathered(robot, recording), *given)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["arm", "head", "two_link"])
def test_an_honest_clock_is_left_alone(name, seed):
    robot, recording = recorded(name, seed)
    found = found_clock(robot, recording)
    assert (found.scale, found.quasi_static, found.reason) == (1.0, False, "")
    assert 0.4 < found.inertial_share < 2.5


@pytest.mark.parametrize("seed", range(2))
def test_heavy_noise_of_the_positions_does_not_hide_inertial_torques(seed):
    robot, recording = recorded("scara", seed, noise=1e-3, highest=6.0)
    found = found_clock(robot, recording)
    assert not found.quasi_static
    assert found.scale == 1.0
    assert np.isnan(found.inertial_share) or 0.4 < found.inertial_share < 2.5  # the lift is at rest but for noise


@pytest.mark.parametrize("seed", range(2))
def test_large_rotors_are_not_taken_for_a_slow_clock(seed):
    robot, recording = recorded("arm", seed, rotor=30.0)
    assert found_clock(robot, recording).reason == ""


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("factor", [5.0, 0.2])
@pytest.mark.parametrize("name", ["arm", "two_link"])
def test_a_clock_that_is_five_times_off_is_found(name, factor, seed):
    robot, recording = recorded(name, seed)
    found = found_clock(robot, recording.with_time_scaled(factor))
    assert found.scale * factor == pytest.approx(1.0, rel=0.25)
    assert not found.quasi_static


def test_logged_velocities_confirm_the_clock():
    robot, recording = recorded("arm", velocity=True)
    slow = dataclasses.replace(recording.with_time_scaled(5.0), velocity=recording.velocity / 5.0)
    assert found_clock(robot, slow).scale == 1.0


@pytest.mark.parametrize("velocity", [False, True])
@pytest.mark.parametrize("name", ["arm", "two_link"])
def test_torque_without_inertia_is_explained_by_gravity_and_friction(name, velocity):
    robot, recording = recorded(name, quasi_static=True, velocity=velocity)
    found = found_clock(robot, recording)
    assert found.quasi_static
    assert found.scale == 1.0
    assert abs(found.inertial_share) < 0.25


def test_what_is_given_is_taken_as_it_is():
    robot, recording = recorded("two_link")
    slow = recording.with_time_scaled(5.0)
    assert found_clock(robot, slow, 1.0).scale == 1.0
    assert found_clock(robot, recording, None, True).quasi_static
    with pytest.raises(ParameterError, match="time scale"):
        Settings(time_scale=0.0)


def test_shares_are_a_quarter_when_time_stamps_are_half_as_dense():
    """Twice the time makes accelerations a quarter, so that the torque holds four times the inertia they promise."""
    robot, recording = recorded("two_link")
    honest = inertial_shares(split_moments(gathered(robot, recording)[1]))
    slow = inertial_shares(split_moments(gathered(robot, recording.with_time_scaled(2.0))[1]))
    assert slow == pytest.approx(4.0 * honest, rel=1e-3)


def test_identification_corrects_the_clock_and_says_so():
    robot, recording = recorded("two_link")
    train, test = recording.with_time_scaled(5.0).split(0.6)
    with pytest.warns(CasysidWarning, match="time stamps were multiplied"):
        result = identify(robot, train, held_out=[test])
    assert result.held_out.relative < 0.1
    assert result.to_json()["time_base"]["scale"] == result.time_base.scale


def test_a_quasi_static_identification_leaves_rotors_at_the_file():
    robot, recording = recorded("two_link", quasi_static=True)
    with pytest.warns(CasysidWarning, match="gravity and friction alone"):
        result = identify(robot, recording)
    rotors = [k for k, parameter in enumerate(result.regressor.parameters) if parameter.kind == "armature"]
    assert result.estimate.parameters[rotors] == pytest.approx(robot.armature, abs=1e-9)
    assert result.drive_vector("armature") == pytest.approx(robot.armature, abs=2e-3)  # an interior point's rest
    assert result.train.relative < 0.1
    assert result.is_physically_consistent


@pytest.mark.parametrize("inertia", ["identity", "of a hundredth"])
@pytest.mark.parametrize("name", ["arm", "two_link"])
def test_inertias_that_stand_for_none_leave_the_clock_alone(name, inertia):
    """A file whose author wrote the same inertia for all bodies says nothing of time."""
    robot, recording = recorded(name)
    bodies = np.array(robot.inertial_parameters.reshape(-1, 10))
    heavy = bodies[:, 0] > 0.0
    mass, first = bodies[heavy, 0, None], bodies[heavy, 1:4]
    centre = first / mass
    moment = 1.0 if inertia == "identity" else 0.01
    square = (centre**2).sum(axis=1)[:, None, None] * np.eye(3) - centre[:, :, None] * centre[:, None, :]
    about_joint = moment * np.eye(3) + mass[:, :, None] * square
    bodies[heavy, 4:] = about_joint[:, (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]
    placeholder = robot.with_parameters(inertial_parameters=bodies.ravel())
    assert not has_placeholder_inertias(robot)
    found = found_clock(placeholder, recording)
    assert (found.scale, found.quasi_static, found.reason) == (1.0, False, "")
    assert has_placeholder_inertias(placeholder) or heavy.sum() <= 2

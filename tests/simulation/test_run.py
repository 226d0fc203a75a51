"""Simulated runs: truth obeys the equations of motion, true parameters track, and every switch does what it says."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import CasysidWarning, ParameterError, SolverError
from casysid.robot import JointKind, Robot
from casysid.simulation import (
    IDEAL,
    NO_MECHANICS,
    PD,
    PERFECT_ACTUATION,
    PERFECT_SENSING,
    PLAIN_MECHANICS,
    Actuation,
    Command,
    ComputedTorque,
    ControlModel,
    Mechanics,
    Plant,
    PlantSettings,
    RunStatus,
    Sensing,
    design_sinusoids,
    simulate,
)
from casysid.simulation.truth import drive_parameters
from tests.strategies import robots

RATE = 500.0
PERFECT = dataclasses.asdict(PERFECT_SENSING)


def load(name):
    return Robot.from_file(find_model(f"{name}.xml"))


def follow(plant, *, duration=2.0, seed=0, parameters=None, motion_seed=0, bandwidth=3.0):
    """Computed torque along sinusoids, by the true parameters unless others are given."""
    robot = plant.robot
    feedback = PD.tuned(robot, plant.parameters, bandwidth=bandwidth)
    controller = ComputedTorque(
        ControlModel.from_robot(robot, plant.parameters if parameters is None else parameters), feedback
    )
    motion = design_sinusoids(robot, duration=duration, seed=motion_seed, ramp=0.4)
    return simulate(plant, controller, motion, rate=RATE, duration=duration, seed=seed)


def rigid_and_viscous(plant, run):
    viscous, _, offset, armature = drive_parameters(plant.robot, plant.parameters)
    inertial = plant.parameters[: plant.robot.inertial_parameters.size]
    model = plant.robot.with_parameters(inertial_parameters=inertial, armature=armature).model
    data = model.createData()
    rnea = [pin.rnea(model, data, *x) for x in zip(run.q, run.v, run.a, strict=True)]
    return np.array(rnea) + viscous * run.v + offset


def with_sensing(**changes):
    return PlantSettings(mechanics=PLAIN_MECHANICS, actuation=PERFECT_ACTUATION, sensing=Sensing(**PERFECT | changes))


@pytest.mark.parametrize("name", ["two_link", "scara", "head", "arm"])
@pytest.mark.parametrize("level", [IDEAL, PlantSettings()], ids=["ideal", "realistic"])
def test_truth_obeys_the_equations_of_motion(name, level):
    plant = Plant(load(name), level)
    run = follow(plant, duration=1.5)
    assert run.status is RunStatus.COMPLETED
    tau = rigid_and_viscous(plant, run) + run.dry_friction + run.cable
    np.testing.assert_allclose(tau, run.tau, rtol=0, atol=1e-9)


@settings(max_examples=10, deadline=None)
@given(robots(max_joints=3, kinds=[k for k in JointKind if k is not JointKind.PLANAR]), st.integers(0, 9))
def test_truth_obeys_the_equations_of_motion_for_any_robot(robot, seed):
    plant = Plant(robot)
    run = follow(plant, duration=1.0, motion_seed=seed)
    tau = rigid_and_viscous(plant, run) + run.dry_friction + run.cable
    np.testing.assert_allclose(tau, run.tau, rtol=0, atol=1e-8 * (1 + np.abs(run.tau).max()))


def test_the_regressor_explains_an_ideal_plant_away_from_standstill():
    plant = Plant(load("two_link"), IDEAL)
    run = follow(plant)
    predicted = ControlModel.from_robot(plant.robot, plant.parameters).inverse_dynamics(run.q, run.v, run.a)
    moving = np.abs(run.v) > 0.1
    assert moving.mean() > 0.5
    np.testing.assert_allclose(predicted[moving], run.tau[moving], rtol=0, atol=1e-6)


def test_positions_velocities_and_accelerations_belong_together():
    settings_ = dataclasses.replace(IDEAL, mechanics=NO_MECHANICS, actuation=Actuation(lag=0.004, saturation=False))
    run = follow(Plant(load("two_link"), settings_))
    np.testing.assert_allclose(np.gradient(run.q, 1 / RATE, axis=0)[5:-5], run.v[5:-5], atol=2e-4)
    np.testing.assert_allclose(np.gradient(run.v, 1 / RATE, axis=0)[5:-5], run.a[5:-5], atol=0.08)


def test_energy_is_kept_by_bodies_alone():
    robot = load("two_link")
    theta = np.concatenate([robot.inertial_parameters, np.zeros(8)])
    plant = Plant(robot, dataclasses.replace(IDEAL, mechanics=NO_MECHANICS), theta)
    motion = design_sinusoids(robot, duration=1.0, ramp=0.3)
    run = simulate(plant, PD(robot, 0.0, 0.0), motion, rate=RATE, duration=0.5)
    model = robot.with_parameters(armature=np.zeros(2)).model
    data = model.createData()
    energy = [
        pin.computeKineticEnergy(model, data, q, v) + pin.computePotentialEnergy(model, data, q)
        for q, v in zip(run.q, run.v, strict=True)
    ]
    assert np.abs(run.v).max() > 2.0  # it fell
    assert np.ptp(energy) < 1e-6


@pytest.mark.parametrize("name", ["head", "arm"])
def test_true_parameters_track_and_wrong_ones_need_more_feedback(name):
    plant = Plant(load(name), IDEAL)
    right, wrong = follow(plant), follow(plant, parameters=0.5 * plant.parameters)
    assert np.abs(right.q - right.reference.q).max() < 0.01
    assert np.sqrt(np.mean(right.feedback**2)) < 0.1 * np.sqrt(np.mean(wrong.feedback**2))


def test_the_same_seed_gives_the_same_run_and_another_another():
    plant = Plant(load("two_link"))
    first, same, other = (follow(plant, duration=1.0, seed=s).recording for s in (3, 3, 4))
    np.testing.assert_array_equal(first.position, same.position)
    np.testing.assert_array_equal(first.torque, same.torque)
    assert (first.position != other.position).mean() > 0.5


def test_perfect_sensing_logs_the_truth():
    run = follow(Plant(load("head"), IDEAL), duration=1.0)
    np.testing.assert_array_equal(run.recording.position, run.channels)
    np.testing.assert_array_equal(run.recording.velocity, run.v)
    np.testing.assert_array_equal(run.recording.torque, run.tau)
    np.testing.assert_allclose(np.diff(run.recording.time), 1 / RATE)


def test_noise_has_the_strength_asked_for_and_no_memory():
    plant = Plant(load("two_link"), with_sensing(position_noise=2e-3, torque_noise=0.01))
    run = follow(plant, duration=4.0, bandwidth=1.0)
    noise = run.recording.position - run.channels
    np.testing.assert_allclose(noise.std(axis=0), 2e-3, rtol=0.06)
    assert np.abs(np.mean(noise[1:] * noise[:-1], axis=0)).max() < 0.08 * 2e-3**2
    torque_noise = run.recording.torque - run.tau
    np.testing.assert_allclose(torque_noise.std(axis=0), 0.01 * plant.torque_scale, rtol=0.06)


def test_readings_are_whole_steps_of_the_resolution():
    plant = Plant(load("two_link"), with_sensing(position_resolution=1e-3, torque_resolution=0.01))
    run = follow(plant, duration=1.0)
    steps = run.recording.position / 1e-3
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.abs(run.recording.position - run.channels).max() <= 0.5e-3 + 1e-12
    steps = run.recording.torque / (0.01 * plant.torque_scale)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


@pytest.mark.parametrize("delay", [0.0007, 0.002, 0.0031])
def test_a_delayed_position_is_that_of_earlier(delay):
    run = follow(Plant(load("two_link"), with_sensing(position_delay=delay)))
    time = run.recording.time[10:]
    for k in range(2):
        want = np.interp(time - delay, run.recording.time, run.channels[:, k])
        np.testing.assert_allclose(run.recording.position[10:, k], want, atol=3e-5)
        assert np.abs(run.recording.position[10:, k] - run.channels[10:, k]).max() > 5e-4


def test_a_delayed_torque_is_that_of_earlier():
    run = follow(Plant(load("two_link"), with_sensing(torque_delay=0.003)))
    want = 0.5 * (run.tau[1:-1] + run.tau[:-2])  # one and a half samples of 2 ms ago
    np.testing.assert_allclose(run.recording.torque[2:], want, atol=1e-9)


def test_jitter_shifts_samples_by_velocity_times_time():
    run = follow(Plant(load("two_link"), with_sensing(sample_jitter=2e-4)))
    moving = np.abs(run.v[:, 0]) > 0.5
    instants = ((run.recording.position - run.channels)[moving] / run.v[moving])[:, 0]
    assert instants.std() == pytest.approx(2e-4, rel=0.12)


def test_velocity_is_the_low_passed_difference_of_logged_positions():
    run = follow(Plant(load("two_link"), with_sensing(velocity_cutoff=30.0, position_noise=1e-4)), duration=1.0)
    position, velocity = run.recording.position, run.recording.velocity
    gain = 1 - np.exp(-2 * np.pi * 30.0 / RATE)
    want = velocity[:-1] + gain * (np.diff(position, axis=0) * RATE - velocity[:-1])
    np.testing.assert_allclose(velocity[1:], want, atol=1e-9)


def test_a_lag_makes_the_torque_follow_the_command():
    lagging = dataclasses.replace(IDEAL, actuation=Actuation(lag=0.02, saturation=False))
    run = follow(Plant(load("two_link"), lagging), bandwidth=1.0)
    plan = ControlModel.from_robot(load("two_link"), Plant(load("two_link"), IDEAL).parameters).inverse_dynamics(
        run.reference.q, run.reference.v, run.reference.a
    )
    command = plan + run.feedback
    want = command[:-1] + (run.tau[:-1] - command[:-1]) * np.exp(-(1 / RATE) / 0.02)
    np.testing.assert_allclose(run.tau[1:], want, atol=1e-4)


def test_actuators_stop_at_their_limit_and_the_run_says_so():
    robot = load("two_link")
    weak = dataclasses.replace(robot, effort_limit=np.array([15.0, 20.0]))
    plant = Plant(weak, dataclasses.replace(IDEAL, actuation=Actuation(lag=0.0)))
    controller = ComputedTorque(ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot))
    motion = design_sinusoids(robot, duration=2.0, ramp=0.4)
    with pytest.warns(CasysidWarning, match="'shoulder' the torque"):
        run = simulate(plant, controller, motion, rate=RATE, duration=2.0)
    assert np.abs(run.tau[:, 0]).max() == pytest.approx(15.0)
    assert run.saturated[0] > 0.01


def test_the_log_can_have_the_command_instead_of_the_torque():
    lagging = dataclasses.replace(with_sensing(torque_is_command=True), actuation=Actuation(lag=0.02))
    run = follow(Plant(load("two_link"), lagging), duration=1.0)
    assert np.abs(run.recording.torque - run.tau).max() > 0.1


def test_coulomb_friction_is_its_level_while_sliding_and_stiction_holds_more():
    robot = load("two_link")
    sticky = dataclasses.replace(IDEAL, mechanics=dataclasses.replace(PLAIN_MECHANICS, stiction=1.5))
    run = follow(Plant(robot, sticky))
    sliding = np.abs(run.v) > 0.2
    np.testing.assert_allclose((run.dry_friction * np.sign(run.v) / robot.dry_friction)[sliding], 1.0, atol=1e-3)
    assert np.abs(run.dry_friction / robot.dry_friction).max() == pytest.approx(1.5, rel=0.05)


def test_stiction_holds_a_robot_that_is_pushed_less():
    robot = load("scara")  # no gravity on the elbow
    plant = Plant(robot, dataclasses.replace(IDEAL, mechanics=dataclasses.replace(PLAIN_MECHANICS, stiction=1.5)))

    class Push:
        def __init__(self, torque):
            self.torque = np.array([0.0, torque, 0.0, 0.0])

        def plan(self, reference):
            hold = np.array([0.0, 0.0, 9.81 * (1.07 + 1.07), 0.0])  # the quill's weight
            return np.tile(self.torque + hold, (len(reference), 1))

        def react(self, q, v, reference, k):
            return Command(np.zeros(4), np.zeros(4))

    motion = design_sinusoids(robot, duration=2.0, ramp=0.5)
    still = simulate(plant, Push(1.4 * robot.dry_friction[1]), motion, rate=RATE, duration=0.2)
    moved = simulate(plant, Push(1.6 * robot.dry_friction[1]), motion, rate=RATE, duration=0.2)
    assert abs(still.q[-1, 1] - still.q[0, 1]) < 1e-4
    assert abs(moved.q[-1, 1] - moved.q[0, 1]) > 1e-3


def test_commands_come_in_whole_steps_and_hide_rounding_errors():
    robot = load("head")
    plant = Plant(robot)

    class Rounded(ComputedTorque):
        def plan(self, reference):
            return super().plan(reference) * (1 + 2e-16)

    model, feedback = ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters)
    motion = design_sinusoids(robot, duration=2.0, ramp=0.4)
    runs = [
        simulate(plant, controller, motion, rate=RATE, duration=2.0)
        for controller in (ComputedTorque(model, feedback), Rounded(model, feedback))
    ]
    np.testing.assert_array_equal(runs[0].recording.position, runs[1].recording.position)
    coarse = dataclasses.replace(IDEAL, actuation=dataclasses.replace(PERFECT_ACTUATION, resolution=0.01))
    steps = follow(Plant(robot, coarse), duration=1.0).tau / (0.01 * plant.torque_scale)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


def test_cables_pull_with_their_share_at_the_end_of_the_range():
    robot = load("two_link")
    plant = Plant(robot, dataclasses.replace(IDEAL, mechanics=Mechanics(cable_pull=0.05)))
    np.testing.assert_allclose(plant.cable_torque(robot.position_upper[None])[0], 0.05 * plant.torque_scale)
    np.testing.assert_allclose(plant.cable_torque(robot.position_lower[None])[0], -0.05 * plant.torque_scale)


def test_switches_take_friction_armature_and_offset_away():
    robot = load("arm")
    drives = drive_parameters(robot, Plant(robot, PlantSettings(mechanics=NO_MECHANICS)).parameters)
    assert (drives == 0).all()
    drives = drive_parameters(robot, Plant(robot).parameters)
    np.testing.assert_array_equal(drives[[0, 1, 3]], [robot.damping, robot.dry_friction, robot.armature])
    np.testing.assert_allclose(np.abs(drives[2]), 0.002 * Plant(robot).torque_scale)


def test_a_file_without_armature_gets_a_plausible_one():
    robot = Robot.from_file(find_model("arm"))  # URDF
    assert (robot.armature == 0).all()
    assert (drive_parameters(robot, Plant(robot).parameters)[3] > 0).all()


@pytest.mark.parametrize("times", [3.0, 1e13])
def test_a_robot_that_runs_away_is_stopped_and_leaves_nothing_behind(times, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    robot = load("head")
    plant = Plant(robot, IDEAL)
    pushing = ControlModel.from_robot(robot, -times * plant.parameters)
    motion = design_sinusoids(robot, duration=4.0, ramp=0.4)
    with pytest.warns(CasysidWarning, match="was stopped after"):
        run = simulate(plant, ComputedTorque(pushing, PD(robot, 0.0, 0.0)), motion, rate=RATE, duration=4.0)
    assert run.status is RunStatus.DIVERGED
    assert 0 < len(run) < 4.0 * RATE
    assert len(run) == len(run.recording) == len(run.reference)
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")


def test_a_command_that_is_not_finite_is_an_error_at_the_start():
    robot = load("two_link")

    class Broken(PD):
        def torque(self, q, v, reference, k):
            return np.full(2, np.nan)

    with pytest.raises(SolverError, match="not finite"):
        simulate(
            Plant(robot, IDEAL), Broken(robot, 1.0, 1.0), design_sinusoids(robot, duration=2.0), rate=RATE, duration=1.0
        )


def test_rates_and_robots_that_do_not_fit_are_refused():
    robot, other = load("two_link"), load("scara")
    plant, motion = Plant(robot, IDEAL), design_sinusoids(robot, duration=2.0)
    for rate, duration in ((0.0, 1.0), (RATE, 0.0), (RATE, 0.001), (np.inf, 1.0)):
        with pytest.raises(ParameterError, match="rate and duration"):
            simulate(plant, PD(robot, 1.0, 1.0), motion, rate=rate, duration=duration)
    with pytest.raises(ParameterError, match="channels"):
        simulate(plant, PD(robot, 1.0, 1.0), design_sinusoids(other, duration=2.0), rate=RATE, duration=1.0)


def test_progress_goes_from_nothing_to_all():
    robot, told = load("two_link"), []
    simulate(
        Plant(robot, IDEAL),
        PD(robot, 1.0, 1.0),
        design_sinusoids(robot, duration=4.0),
        rate=RATE,
        duration=2.5,
        progress=told.append,
    )
    assert told[0] == 0.0
    assert told[-1] == 1.0
    assert told == sorted(told)


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (Mechanics, {"stiction": 0.5}),
        (Mechanics, {"cable_pull": -1.0}),
        (Mechanics, {"stribeck_velocity": 0.0}),
        (Mechanics, {"rotor_acceleration": 0.0}),
        (Actuation, {"lag": float("nan")}),
        (Sensing, {"velocity_cutoff": 0.0}),
        (Sensing, {"position_noise": float("inf")}),
        (PlantSettings, {"physics_step": 0.0}),
    ],
)
def test_settings_out_of_range_are_refused_by_name(kind, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        kind(**wrong)

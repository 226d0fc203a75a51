"""Random experiments have the truth that they claim: bodies, motions, friction, logs and wrong files."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.inertia import is_consistent

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
seeds = st.integers(0, 10_000)
few = settings(max_examples=15, deadline=None)


@pytest.fixture(scope="module")
def part():
    """Modules of the package by name."""
    sys.path.insert(0, str(SCRIPTS))
    yield lambda name: importlib.import_module(f"population.{name}")
    sys.path.remove(str(SCRIPTS))


@few
@given(seed=seeds)
def test_torques_and_regressor_of_all_samples_at_once_are_pinocchios(part, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = part("mechanisms").draw_mechanism(rng).robot
    robot = robot.with_parameters(armature=np.zeros(robot.nv))
    q, v, a = rng.normal(size=(3, 4, robot.nv))
    bodies, data = part("rigid").RigidBodies(robot), robot.model.createData()
    expected = [pin.rnea(robot.model, data, *state) for state in zip(q, v, a, strict=True)]
    columns = [
        np.array(pin.computeJointTorqueRegressor(robot.model, data, *state)).reshape(robot.nv, -1)
        for state in zip(q, v, a, strict=True)
    ]
    scale = max(np.abs(expected).max(), 1.0)
    np.testing.assert_allclose(bodies.torque(robot.inertial_parameters, q, v, a), expected, atol=1e-11 * scale)
    np.testing.assert_allclose(bodies.regressor(q, v, a), columns, atol=1e-11 * np.abs(columns).max())


@few
@given(seed=seeds)
def test_bodies_are_possible_also_in_files_that_are_off(part, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = part("mechanisms").draw_mechanism(rng).robot
    assert is_consistent(robot.inertial_parameters.reshape(-1, 10)).all()
    for kind in part("files").KINDS:
        file, _ = part("files").draw_file(rng, robot, kind)
        assert is_consistent(file.inertial_parameters.reshape(-1, 10)).all()
        assert not np.allclose(file.inertial_parameters, robot.inertial_parameters)


@few
@given(seed=seeds, kind=st.sampled_from(["fourier", "chirp", "point to point"]))
def test_velocity_and_acceleration_are_the_motions_derivatives_within_its_limits(part, seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    mechanism = part("mechanisms").draw_mechanism(rng)
    family = part("families").draw_family(rng, mechanism, mechanism.robot, kind)
    time = np.linspace(0.0, 8.0, 40_001)
    q, v, a = family.draw(rng, 8.0).at(time)
    step, limits = time[1], mechanism.limits
    np.testing.assert_allclose(np.diff(q, axis=0) / step, (v[1:] + v[:-1]) / 2.0, atol=step * np.abs(a).max())
    integral = np.cumsum((a[1:] + a[:-1]) / 2.0, axis=0) * step
    np.testing.assert_allclose(integral, v[1:] - v[0], atol=50.0 * step * np.abs(a).max())
    assert (np.abs(q[:, family.at_rest]) == 0.0).all()
    if not family.rests:
        bounds = (limits.half_range, limits.speed, limits.acceleration)
        assert all((np.abs(x).max(axis=0) <= 1.03 * bound).all() for x, bound in zip((q, v, a), bounds, strict=True))


def test_a_designed_motion_keeps_the_limits_and_starts_at_rest(part) -> None:
    rng = np.random.default_rng(1)
    mechanism = part("mechanisms").draw_mechanism(np.random.default_rng(2))
    motion = part("families").draw_family(rng, mechanism, mechanism.robot, "designed").draw(rng, 10.0)
    q, v, _ = motion.at(np.linspace(0.0, 20.0, 2001))
    assert (np.abs(q) <= mechanism.limits.half_range * (1.0 + 1e-6)).all()
    assert (np.abs(v) <= mechanism.limits.speed * (1.0 + 1e-6)).all()
    np.testing.assert_allclose(v[0], 0.0, atol=1e-9)


def slow_slip(positions: np.ndarray, reach: float) -> list[float]:
    """One spring that slips: where its far end is dragged to."""
    end, forces = positions[0], []
    for s in positions:
        end = min(max(end, s - reach), s + reach)
        forces.append((s - end) / reach)
    return forces


@few
@given(seed=seeds)
def test_hysteresis_is_springs_that_slip_and_coulomb_far_from_reversals(part, seed: int) -> None:
    rng = np.random.default_rng(seed)
    s = np.cumsum(rng.normal(size=300)) * 0.01
    yields, shares = rng.uniform(0.005, 0.05, 3), rng.dirichlet(np.ones(3))
    term = part("friction").Hysteresis(direction=np.ones(1), effect="hysteresis", yields=yields, shares=shares)
    state = part("motions").State(s[:, None], np.zeros((300, 1)), np.zeros((300, 1)))
    expected = sum(share * np.array(slow_slip(s, reach)) for share, reach in zip(shares, yields, strict=True))
    np.testing.assert_allclose(term.shape(state), expected, atol=1e-9)
    away = np.linspace(0.0, 1.0, 300)[:, None]
    far = term.shape(part("motions").State(away, away, away))[100:]
    np.testing.assert_allclose(far, 1.0)


@few
@given(seed=st.integers(0, 300))
def test_true_columns_with_true_coefficients_are_the_truth(part, seed: int) -> None:
    mechanism = part("mechanisms").draw_mechanism(np.random.default_rng(seed))
    state = part("motions").State(*np.random.default_rng(seed).normal(size=(3, 50, mechanism.robot.nv)))
    truth = part("drives").draw_truth(np.random.default_rng(seed), mechanism, state)
    exact = np.concatenate([truth.parameters, [term.coefficient for term in truth.terms]])
    np.testing.assert_allclose(truth.regressor(state) @ exact, truth.torque(state), atol=1e-9)


def test_each_effect_takes_part_of_some_experiments_and_its_size_is_a_share_of_the_joints_torque(part) -> None:
    mechanism = part("mechanisms").draw_mechanism(np.random.default_rng(3))
    state = part("motions").State(*np.random.default_rng(0).normal(size=(3, 200, mechanism.robot.nv)))
    found = set()
    for seed in range(60):
        truth = part("drives").draw_truth(np.random.default_rng(seed), mechanism, state)
        found |= set(truth.effects)
        rigid = np.sqrt(np.mean(truth.bodies.torque(truth.parameters, *state) ** 2, axis=0))
        for term in truth.terms:
            if term.kind == "viscous" and term.effect == "viscous":
                (j,) = term.joints
                share = np.sqrt(np.mean((term.coefficient * state.v[:, j]) ** 2)) / max(rigid[j], 0.02 * rigid.max())
                assert 0.0199 < share < 0.401
    assert found == set(part("drives").EFFECTS)


@few
@given(seed=seeds, joints=st.integers(1, 8))
def test_logs_are_bounded_and_their_time_increases(part, seed: int, joints: int) -> None:
    sensors = part("sensors")
    sampling = sensors.draw_sampling(np.random.default_rng(seed), joints)
    assert (np.diff(sampling.stamps) > 0.0).all()
    assert (np.diff(sampling.actual) > 0.0).all()
    assert len(sampling.stamps) * joints**2 <= sensors.MOST_VALUES + joints**2
    assert len(sampling.stamps) <= sensors.MOST_ROWS + 1


def test_a_log_has_the_faults_it_names(part) -> None:
    sensors, rng = part("sensors"), np.random.default_rng(0)
    mechanism = part("mechanisms").draw_mechanism(np.random.default_rng(2))
    joints = mechanism.robot.nv
    motion = part("families").draw_family(rng, mechanism, mechanism.robot, "fourier").draw(rng, 5.0)
    sampling = sensors.even_sampling(5.0, 100.0)
    truth = part("drives").draw_truth(rng, mechanism, motion.at(sampling.actual))
    signs = np.where(np.arange(joints) == 0, -1.0, 1.0)
    faults = sensors.Faults(3.0, np.full(joints, 0.02), np.linspace(0.8, 1.2, joints), signs)
    assert faults.names == ("clock", "delay", "gains", "sign")
    logged = sensors.Logged(motion, sampling, sensors.white_noise_only(mechanism, 0.0), faults)
    recording = sensors.record(rng, mechanism.robot, truth, logged)
    np.testing.assert_allclose(recording.time, 3.0 * sampling.actual)
    expected = sensors.true_torque(truth, motion, sampling.actual - 0.02) * faults.scale
    np.testing.assert_allclose(recording.torque, expected)
    np.testing.assert_allclose(recording.position, motion.at(sampling.actual).q, atol=1e-5)


def test_an_experiment_follows_from_its_seed_alone(part) -> None:
    first, second, other = (part("experiments").draw_experiment(seed) for seed in (1, 1, 3))
    np.testing.assert_array_equal(first.recording.torque, second.recording.torque)
    np.testing.assert_array_equal(first.fresh_torque, second.fresh_torque)
    np.testing.assert_array_equal(first.file.inertial_parameters, second.file.inertial_parameters)
    assert first.recording.torque.shape != other.recording.torque.shape


def test_what_a_log_cannot_tell_grows_with_its_noise_and_is_endless_where_a_joint_never_moved(part) -> None:
    experiments, sensors = part("experiments"), part("sensors")
    experiment = experiments.draw_frictionless(0, 0.01)
    logged, joints = experiment.logged, experiment.mechanism.robot.nv
    one = experiments.expected_error(experiment.truth, logged, experiment.fresh)
    noisy = sensors.Logged(
        logged.motion, logged.sampling, sensors.white_noise_only(experiment.mechanism, 0.03), logged.faults
    )
    assert experiments.expected_error(experiment.truth, noisy, experiment.fresh) == pytest.approx(3.0 * one)
    still = part("motions").Resting(logged.motion, np.ones(joints, dtype=bool), ((),) * joints, 1.0)
    stuck = sensors.Logged(still, logged.sampling, logged.sensors, logged.faults)
    assert experiments.expected_error(experiment.truth, stuck, experiment.fresh) > 100.0 * one

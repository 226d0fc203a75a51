"""Torque scales that no bodies could have produced are found, relative to each other; honest torques are left alone."""

import numpy as np
import pytest

from casysid.accumulation import accumulate_moments
from casysid.dynamics import build_regressor
from casysid.errors import ParameterError
from casysid.identification.tuning.drive_gains import choose_drive_gains, scaled
from casysid.inertia import Consistency
from casysid.simulation import design_sinusoids
from tests.simulated import bundled_robot

GAINS = np.array([0.8, 0.8, 0.8, 0.8, 1.25, 1.25, 1.25, 1.25, 1.0, 1.0])


def arm_moments(seed, gains, noise=0.02, unrelated=()):
    """Moments of an arm whose bodies are up to 20 % off its file's, torque noise 2 %, torques logged with gains.

    Torques of some joints may have nothing to do with the motion.
    """
    robot, rng = bundled_robot("arm"), np.random.default_rng(seed)
    time = np.arange(0, 40.0, 0.02)
    motion = design_sinusoids(robot, duration=40.0, seed=seed, band=(0.1, 1.0)).sample(time)
    regressor = build_regressor(robot)
    truth = regressor.prior * np.append(
        np.repeat(rng.uniform(0.8, 1.2, len(robot.links)), 10),
        np.ones(len(regressor.names) - 10 * len(robot.links)),
    )
    tau = gains * regressor.predict(truth, motion.q, motion.v, motion.a)
    tau = tau + noise * tau.std(axis=0) * rng.normal(size=tau.shape)
    for joint in unrelated:
        phase = rng.uniform(0.0, 2.0 * np.pi, 8)
        tau[:, joint] = 5.0 * np.cos(time[:, None] * rng.uniform(1.0, 6.0, 8) + phase).sum(axis=1)
    return regressor, accumulate_moments(regressor, motion.q, motion.v, motion.a, tau, blocks=12)


def test_a_regressor_with_gains_has_its_rows_multiplied():
    robot, rng, gains = bundled_robot("two_link"), np.random.default_rng(0), GAINS[3:5]
    q, v, a = rng.normal(size=(3, 5, robot.nv))
    plain, bent = build_regressor(robot), build_regressor(robot, torque_gains=gains)
    assert bent.evaluate(q, v, a) == pytest.approx(gains[:, None] * plain.evaluate(q, v, a))
    assert bent.predict(plain.prior, q, v, a) == pytest.approx(gains * plain.predict(plain.prior, q, v, a))
    for wrong in ([1.0], [0.0] * robot.nv, [np.nan] * robot.nv):
        with pytest.raises(ParameterError, match="torque gains"):
            build_regressor(robot, torque_gains=wrong)


def test_scaled_moments_are_those_of_scaled_rows():
    robot, rng, gains = bundled_robot("two_link"), np.random.default_rng(1), GAINS[3:5]
    q, v, a = rng.normal(size=(3, 50, robot.nv))
    tau = rng.normal(size=(50, robot.nv))
    plain, bent = build_regressor(robot), build_regressor(robot, torque_gains=gains)
    ours = scaled(accumulate_moments(plain, q, v, a, tau, blocks=2), gains)
    assert ours.gram == pytest.approx(accumulate_moments(bent, q, v, a, tau, blocks=2).gram, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_honest_torques_are_left_alone(seed):
    regressor, moments = arm_moments(seed, np.ones(10))
    found = choose_drive_gains(moments, regressor.parameters, Consistency.FULL)
    assert not found.found
    assert (found.values == 1.0).all()


@pytest.mark.parametrize("seed", [1])
def test_gains_of_two_kinds_of_motors_are_found(seed):
    regressor, moments = arm_moments(seed, GAINS)
    found = choose_drive_gains(moments, regressor.parameters, Consistency.FULL)
    assert found.found
    near, far = np.log(found.values[:4]).mean(), np.log(found.values[4:7]).mean()
    assert far - near == pytest.approx(np.log(1.25 / 0.8), abs=0.15)
    assert np.log(found.values).mean() == pytest.approx(0.0, abs=1e-9)


def test_what_is_given_is_taken_and_nothing_is_fitted_where_nothing_binds_the_joints():
    regressor, moments = arm_moments(0, GAINS)
    given = choose_drive_gains(moments, regressor.parameters, Consistency.FULL, given=tuple(GAINS))
    assert given.values == pytest.approx(GAINS)
    assert not choose_drive_gains(moments, regressor.parameters, None).found


@pytest.mark.parametrize("seed", range(2))
def test_unrelated_torques_of_three_joints_leave_the_gains_of_the_others_alone(seed):
    regressor, moments = arm_moments(seed, np.ones(10), unrelated=(2, 5, 8))
    found = choose_drive_gains(moments, regressor.parameters, Consistency.FULL)
    others = np.delete(np.arange(10), (2, 5, 8))
    assert found.values[others] == pytest.approx(1.0)


def test_perfect_torques_get_no_gains():
    regressor, moments = arm_moments(0, np.ones(10), noise=0.0)
    found = choose_drive_gains(moments, regressor.parameters, Consistency.FULL)
    assert not found.found
    assert (found.values == 1.0).all()

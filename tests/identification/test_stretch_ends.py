"""Ends of a recording are left out where they hold more error than all else, and stay where they do not."""

import dataclasses

import numpy as np
import pytest

from casysid.dynamics import DEFAULT_FRICTION, Coulomb, build_regressor
from casysid.estimation import WeightedLeastSquares
from casysid.identification import Settings
from casysid.identification.problem import build_problem
from casysid.identification.stretch_ends import LEAST_EXCESS, choose_ends, end_excess
from casysid.recording import Recording
from casysid.simulation import design_sinusoids
from tests.simulated import bundled_robot

RATE, CUTOFF = 420.0, 6.0


def simulated(torque_noise, cut=0.0, seed=0):
    """A log of a motion, or of what is left of it ``cut`` seconds after its start and before its end."""
    robot = bundled_robot("two_link.urdf")
    sharp = tuple(dataclasses.replace(c, width=1e-3) if isinstance(c, Coulomb) else c for c in DEFAULT_FRICTION)
    regressor = build_regressor(robot, friction=sharp)
    time = np.arange(cut, 15.0 - cut, 1 / RATE)
    motion = design_sinusoids(robot, duration=15.0, seed=seed, band=(0.1, 2.0)).sample(time)
    tau = regressor.predict(regressor.prior, motion.q, motion.v, motion.a)
    rng = np.random.default_rng(seed)
    recording = Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=time,
        position=motion.channels + 1e-4 * rng.normal(size=motion.channels.shape),
        torque=tau + torque_noise * tau.std(axis=0) * rng.normal(size=tau.shape),
    )
    return robot, recording, regressor, motion, tau


@pytest.mark.parametrize("cut", [0.0, 4.0])
def test_where_friction_or_smoothing_fails_at_the_ends_parameters_are_better_without(cut):
    robot, recording, regressor, motion, tau = simulated(0.01, cut)
    assert not choose_ends(robot, [recording], Settings(threads=1))
    errors = []
    for ends in (True, False):
        problem = build_problem(robot, [recording], CUTOFF, Settings(ends=ends, threads=1))
        found = WeightedLeastSquares().estimate(problem.moments, problem.regressor.prior).parameters
        errors.append(np.linalg.norm(regressor.predict(found, motion.q, motion.v, motion.a) - tau))
    assert errors[1] < 0.7 * errors[0]


def test_where_the_torque_is_missed_everywhere_the_ends_stay():
    robot, recording, *_ = simulated(0.5)
    assert end_excess(robot, [recording], Settings(threads=1)) < LEAST_EXCESS
    assert choose_ends(robot, [recording], Settings(threads=1))


def test_what_the_settings_say_holds():
    robot, recording, *_ = simulated(0.01)
    assert choose_ends(robot, [recording], Settings(ends=True))


def test_samples_without_time_have_no_ends():
    robot, recording, _, motion, _ = simulated(0.01)
    unordered = dataclasses.replace(recording, time=None, velocity=motion.v, acceleration=motion.a)
    assert end_excess(robot, [unordered], Settings()) == 0.0

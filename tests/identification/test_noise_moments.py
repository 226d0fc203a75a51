"""What encoder noise adds to moments, against the sum of J P Jᵀ, and what taking it away gains."""

import dataclasses

import casadi as ca
import numpy as np
import pytest

from casysid.accumulation import accumulate_moments
from casysid.dynamics import Armature, build_regressor
from casysid.estimation import ErrorsInVariables, WeightedLeastSquares
from casysid.identification import Settings
from casysid.identification.problem import MOTION_TO_TORQUE_BAND, build_problem
from casysid.recording import Recording
from casysid.signals import BandAverage, build_smoother, position_noise
from casysid.simulation import design_sinusoids
from tests.simulated import bundled_robot

RATE, CUTOFF = 400.0, 12.0


def noisy_recording(sigma, seed=0, duration=20.0, name="two_link.urdf"):
    robot = bundled_robot(name)
    time = np.arange(0, duration, 1 / RATE)
    reference = design_sinusoids(robot, duration=duration, seed=seed, band=(0.1, 1.5)).sample(time)
    regressor = build_regressor(robot, friction=(Armature(),))
    tau = regressor.predict(regressor.prior, reference.q, reference.v, reference.a)
    rng = np.random.default_rng(seed)
    recording = Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=time,
        position=reference.channels + sigma * rng.normal(size=reference.channels.shape),
        torque=tau + 0.01 * tau.std(axis=0) * rng.normal(size=tau.shape),
    )
    return robot, recording, regressor, reference, tau


def test_noise_moments_of_an_acceleration_are_those_of_the_whole_linear_chain():
    """Armature's column is the acceleration: its noise is white noise through smoother, derivative and average."""
    sigma = 1e-3
    robot, recording, regressor, _, _ = noisy_recording(sigma, duration=4.0)
    settings = Settings(friction=(Armature(),), blocks=4)
    problem = build_problem(robot, [recording], CUTOFF, settings)
    smoother = build_smoother(recording.time, MOTION_TO_TORQUE_BAND * CUTOFF)
    chain = smoother.smooth(np.eye(len(recording)), 2)
    energy = 0.0
    for block in np.array_split(np.arange(len(recording)), 4):
        energy += np.sum((BandAverage(recording.time, CUTOFF).weights(block) @ chain[block]) ** 2)
    for joint in range(robot.nv):
        column = regressor.names.index(f"{robot.dofs[joint]}.armature")
        gained = problem.moments.noise[:, joint, column, column].sum()
        assert gained == pytest.approx(sigma**2 * energy, rel=0.4)


def test_noise_moments_are_the_sum_of_jacobians_where_nothing_is_averaged():
    """Without smoothing at work on the state, disturbing it twice gives Σ J P Jᵀ with J from CasADi."""
    robot, _, regressor, reference, tau = noisy_recording(1e-3)
    rng, nv = np.random.default_rng(0), robot.nv
    sigma = np.repeat([1e-4, 1e-3, 1e-2], nv)
    state = np.concatenate([reference.q, reference.v, reference.a], axis=1)
    error = sigma * rng.choice([-1.0, 1.0], size=state.shape)
    gram = [
        accumulate_moments(regressor, *np.split(state + sign * error, 3, axis=1), tau, blocks=1).gram[0]
        for sign in (1.0, -1.0, 0.0)
    ]
    gained = 0.5 * (gram[0] + gram[1]) - gram[2]
    symbol = ca.SX.sym("s", 3 * nv)
    Y = regressor.function(*ca.vertsplit(symbol, nv))
    for joint in range(nv):
        jacobian = ca.Function("J", [symbol], [ca.jacobian(ca.densify(Y[joint, :]), symbol)])
        slow = sum((J := np.array(jacobian(s)) * sigma) @ J.T for s in state)
        moved = np.diag(slow) > 0.05 * np.diag(slow).max()  # elsewhere the bias of the mean shows, which J lacks
        assert np.diag(gained[joint])[:-1][moved] == pytest.approx(np.diag(slow)[moved], rel=0.15)


@pytest.mark.parametrize("sigma", [3e-4, 3e-3])
def test_position_noise_is_found_in_the_data(sigma):
    _, recording, *_ = noisy_recording(sigma)
    assert position_noise(recording.time, recording.position) == pytest.approx(sigma, rel=0.1)


def test_a_cutoff_far_too_high_costs_little_once_noise_is_removed():
    ratios = []
    for seed in range(3):
        robot, recording, regressor, reference, tau = noisy_recording(3e-3, seed=seed)
        problem = build_problem(robot, [recording], CUTOFF, Settings(friction=(Armature(),)))
        errors = []
        for method in (WeightedLeastSquares(), ErrorsInVariables(WeightedLeastSquares())):
            found = method.estimate(problem.moments, np.zeros(len(regressor.names))).parameters
            predicted = regressor.predict(found, reference.q, reference.v, reference.a)
            errors.append(np.sum((predicted - tau) ** 2))
        ratios.append(errors[1] / errors[0])
    assert np.mean(ratios) < 0.2


def test_noise_is_left_out_of_quick_problems():
    robot, recording, *_ = noisy_recording(1e-3)
    problem = build_problem(robot, [recording], CUTOFF, dataclasses.replace(Settings(), blocks=4), quick=True)
    assert problem.moments.noise is None

"""What encoder noise adds to moments, against the sum of J P Jᵀ, and what taking it away gains."""

import dataclasses

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.accumulation import accumulate_moments
from casysid.dynamics import Armature, Viscous, build_regressor
from casysid.errors import ParameterError
from casysid.estimation import ErrorsInVariables, WeightedLeastSquares
from casysid.identification import Settings, prepare
from casysid.recording import Recording
from casysid.signals import BandAverage, NoiseLevels, build_smoother, position_noise
from casysid.simulation import design_sinusoids
from tests.simulated import bundled_robot, prepared

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
    problem = prepared(robot, recording, Settings(cutoff=CUTOFF, friction=(Armature(),), blocks=4))
    inner = np.flatnonzero(problem.motions[0].settled)
    chain = build_smoother(recording.time, problem.choices.band.smoothing).smooth(np.eye(len(recording)), 2)[inner]
    energy = 0.0
    for block in np.array_split(np.arange(len(inner)), 4):
        energy += np.sum((BandAverage(recording.time[inner], CUTOFF).weights(block) @ chain[block]) ** 2)
    for joint in range(robot.nv):
        column = regressor.names.index(f"{robot.dofs[joint]}.armature")
        rows = problem.moments.moving_rows == joint
        gained = problem.moments.dense_noise[:, rows, column, column].sum()
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


def unordered(levels, seed=0, duration=5.0):
    """A recording without time, whose positions, velocities and accelerations were measured with noise."""
    robot, recording, regressor, reference, tau = noisy_recording(0.0, seed=seed, duration=duration)
    rng = np.random.default_rng([seed, 1])
    fields = {"position": reference.channels, "velocity": reference.v, "acceleration": reference.a}
    measured = {name: values + getattr(levels, name) * rng.normal(size=values.shape) for name, values in fields.items()}
    return robot, dataclasses.replace(recording, time=None, **measured), regressor, reference, tau


def problem_of(robot, recording, levels, blocks=4):
    return prepared(robot, recording, Settings(friction=(Viscous(), Armature()), input_noise=levels, blocks=blocks))


@given(st.integers(0, 1000), st.floats(1e-6, 1e-2))
@settings(max_examples=8, deadline=None)
def test_noise_moments_of_unordered_samples_add_over_blocks(seed, sigma):
    levels = NoiseLevels(position=sigma, velocity=3.0 * sigma, acceleration=10.0 * sigma)
    robot, recording, *_ = unordered(levels, seed, duration=2.0)
    many, one = (problem_of(robot, recording, levels, blocks).moments for blocks in (8, 4))
    size = np.abs(one.gram).sum(axis=0).max(axis=(-2, -1), keepdims=True)
    assert np.abs(many.dense_noise.sum(axis=0) - one.dense_noise.sum(axis=0)).max() <= 1e-12 * size.max()


@pytest.mark.parametrize("timed", [True, False])
def test_no_noise_adds_nothing(timed):
    levels = NoiseLevels(position=0.0) if timed else NoiseLevels(position=0.0, velocity=0.0, acceleration=1e-300)
    robot, recording, *_ = unordered(NoiseLevels(position=0.0, velocity=0.0, acceleration=0.0))
    if timed:
        recording = dataclasses.replace(recording, time=np.arange(len(recording)) / RATE)
    moments = prepared(robot, recording, Settings(cutoff=CUTOFF, input_noise=levels, blocks=4)).moments
    assert np.abs(moments.dense_noise).max() <= 1e-12 * moments.gram.max()


def test_small_noise_of_unordered_samples_adds_the_sum_of_jacobians():
    levels = NoiseLevels(position=1e-3, velocity=1e-2, acceleration=0.3)
    robot, recording, *_ = unordered(levels)
    problem = problem_of(robot, recording, levels)
    regressor, nv = problem.regressor, robot.nv
    std = np.repeat([levels.position, levels.velocity, levels.acceleration], nv)
    state = np.concatenate([recording.position, recording.velocity, recording.acceleration], axis=1)
    step = 1e-5
    slow = np.zeros(problem.moments.gram.shape[1:])
    for k in range(3 * nv):  # central differences along every channel
        ahead, behind = (
            regressor.evaluate(*np.split(state + sign * step * np.eye(3 * nv)[k], 3, axis=1)) for sign in (1.0, -1.0)
        )
        column = std[k] * (ahead - behind) / (2.0 * step)  # (N, nv, p)
        slow[:, :-1, :-1] += np.einsum("njm,njp->jmp", column, column)
    found = problem.moments.dense_noise.sum(axis=0)
    for joint in range(nv):
        diagonal = np.diag(slow[joint])[:-1]
        moved = diagonal > 0.05 * diagonal.max()
        assert np.diag(found[joint])[:-1][moved] == pytest.approx(diagonal[moved], rel=0.1)


@pytest.mark.parametrize("share", [0.03, 0.1])
def test_given_noise_of_unordered_samples_is_removed(share):
    gains = []
    for seed in range(3):
        reference = noisy_recording(0.0, seed=seed, duration=15.0)[3]
        levels = NoiseLevels(
            position=1e-3,
            velocity=tuple(share * np.ptp(reference.v, axis=0)),
            acceleration=tuple(share * np.ptp(reference.a, axis=0)),
        )
        robot, recording, _, reference, tau = unordered(levels, seed, duration=15.0)
        problem = problem_of(robot, recording, levels)
        errors = []
        for method in (WeightedLeastSquares(), ErrorsInVariables(WeightedLeastSquares())):
            found = method.estimate(problem.moments, problem.regressor.prior).parameters
            predicted = problem.regressor.predict(found, reference.q, reference.v, reference.a)
            errors.append(np.sum((predicted - tau) ** 2))
        gains.append(errors[0] / errors[1])
    assert np.median(gains) > 10.0


def test_levels_that_do_not_fit_are_named():
    levels = NoiseLevels(position=(1e-3, 1e-3, 1e-3), velocity=0.1)
    robot, recording, *_ = unordered(NoiseLevels(position=0.0, velocity=0.0, acceleration=0.0))
    with pytest.raises(ParameterError, match="position noise: wanted one number or 2, one for each; got 3"):
        problem_of(robot, recording, levels)
    with pytest.raises(ParameterError, match="velocity noise must be finite and not negative"):
        NoiseLevels(velocity=-1.0)


@pytest.mark.parametrize("sigma", [3e-4, 3e-3])
def test_position_noise_is_found_in_the_data(sigma):
    _, recording, *_ = noisy_recording(sigma)
    assert position_noise(recording.time, recording.position) == pytest.approx(sigma, rel=0.1)


def test_a_cutoff_far_too_high_costs_little():
    """Positions are smoothed no higher than their noise allows, and what is left of it is taken out."""
    for seed in range(3):
        robot, recording, regressor, reference, tau = noisy_recording(3e-3, seed=seed)
        problem = prepared(robot, recording, Settings(cutoff=CUTOFF, friction=(Armature(),)))
        assert problem.choices.band.smoothing < CUTOFF
        for method, most in ((WeightedLeastSquares(), 2e-3), (ErrorsInVariables(WeightedLeastSquares()), 1e-3)):
            found = method.estimate(problem.moments, np.zeros(len(regressor.names))).parameters
            predicted = regressor.predict(found, reference.q, reference.v, reference.a)
            assert np.linalg.norm(predicted - tau) < most * np.linalg.norm(tau)


def test_noise_is_left_out_where_no_method_needs_it():
    robot, recording, *_ = noisy_recording(1e-3, duration=4.0)
    chosen = Settings(cutoff=CUTOFF, blocks=4, choose_friction=False, delay=0.0, time_scale=1.0)
    assert prepare(robot, recording, chosen).moments.noise is None
    known = dataclasses.replace(chosen, method=ErrorsInVariables())
    assert prepare(robot, recording, known).moments.noise is not None

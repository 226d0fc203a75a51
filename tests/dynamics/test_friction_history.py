"""Friction that remembers: what is computed along a motion, and how it enters the regressor."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.accumulation import accumulate_moments
from casysid.dynamics import (
    DEFAULT_FRICTION,
    Coupling,
    Direction,
    Drift,
    JointUse,
    MaxwellSlip,
    Play,
    Spring,
    Trend,
    Viscous,
    build_regressor,
    extend_regressor,
)
from casysid.dynamics.friction import joint_directions
from casysid.errors import ParameterError
from casysid.robot import JointKind
from casysid.signals import BandAverage
from tests.strategies import random_robot

ARM = random_robot(np.random.default_rng(3), (JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.CONTINUOUS))
TIME = np.arange(800) * 0.01
SLIP = MaxwellSlip({"joint_1": (0.3, 0.05), "joint_3": (0.2,)})


def motion(seed=0):
    """Positions along each joint, the last turning several times; and the robot's state."""
    rng = np.random.default_rng(seed)
    s = np.sin(np.outer(TIME, rng.uniform(0.5, 4.0, 3)) + rng.uniform(0.0, 6.0, 3)) * [1.0, 0.4, 9.0]
    v = np.gradient(s, TIME, axis=0)
    q = np.column_stack([s[:, :2], np.cos(s[:, 2]), np.sin(s[:, 2])])
    return s, (q, v, np.gradient(v, TIME, axis=0))


def slow_play(position, displacement):
    stretch = [0.0]
    for step in np.diff(position):
        stretch.append(min(max(stretch[-1] + step / displacement, -1.0), 1.0))
    return np.array(stretch)


positions = st.lists(st.sampled_from([0.0, 0.1, 0.15, -0.4, 2.0, -3.0]) | st.floats(-2.0, 2.0), min_size=1, max_size=60)


@given(positions, st.floats(0.05, 3.0))
def test_play_is_the_loop_over_all_samples(position, displacement):
    got = Play(displacement).values(np.arange(len(position)), np.array(position))
    np.testing.assert_allclose(got, slow_play(position, displacement), atol=1e-12)


@given(positions, st.floats(0.05, 3.0))
def test_an_element_gives_back_no_more_than_it_has_taken(position, displacement):
    stretch = Play(displacement).values(np.arange(len(position)), np.array(position))
    work, stored = stretch[1:] * np.diff(position), 0.5 * displacement * np.diff(stretch**2)
    assert (work - stored >= -1e-9).all()


@given(positions, st.floats(0.1, 3.0), st.integers(2, 4))
def test_play_does_not_depend_on_pace(position, displacement, times):
    fine = np.interp(np.arange((len(position) - 1) * times + 1) / times, np.arange(len(position)), position)
    coarse = Play(displacement).values(np.arange(len(position)), np.array(position))
    np.testing.assert_allclose(Play(displacement).values(np.arange(len(fine)), fine)[::times], coarse, atol=1e-9)


@given(st.lists(st.floats(0.0, 2.0), min_size=3, max_size=3), st.integers(0, 100))
@settings(max_examples=15)
def test_slip_times_its_parameters_is_its_torque(theta, seed):
    s, (q, v, a) = motion(seed)
    regressor = build_regressor(ARM, [SLIP])
    assert regressor.names[30:] == ("joint_1.maxwell_slip_1", "joint_1.maxwell_slip_2", "joint_3.maxwell_slip_1")
    got = regressor.predict([*np.zeros(30), *theta], q, v, a)
    wanted = np.zeros_like(v)
    wanted[:, 0] = theta[0] * slow_play(s[:, 0], 0.3) + theta[1] * slow_play(s[:, 0], 0.05)
    wanted[:, 2] = theta[2] * slow_play(s[:, 2], 0.2)
    np.testing.assert_allclose(got, wanted, atol=1e-9)
    np.testing.assert_allclose(regressor.evaluate(q, v, a)[:, :, 30:] @ theta, wanted, atol=1e-9)


def test_after_a_long_way_slip_is_coulomb_friction():
    s, (q, v, a) = motion()
    slip = build_regressor(ARM, [MaxwellSlip({"joint_1": (1e-6,)})]).evaluate(q, v, a)[:, 0, 30]
    np.testing.assert_allclose(slip[1:], np.sign(np.diff(s[:, 0])), atol=1e-12)


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
@settings(max_examples=10)
def test_drift_is_friction_times_a_trend(viscous, dry):
    _, (q, v, a) = motion()
    time = TIME + np.where(TIME > 3.0, 5.0, 0.0)  # a gap
    regressor = build_regressor(ARM, [Drift(0.1, ("joint_2",))])
    got = regressor.predict([*np.zeros(30), viscous, dry], q, v, a, time=time)
    trend = np.interp(time, time[[0, -1]], [-1.0, 1.0])
    np.testing.assert_allclose(got[:, 1], trend * (viscous * v[:, 1] + dry * np.tanh(v[:, 1] / 0.1)), atol=1e-9)
    assert not got[:, [0, 2]].any()
    assert not Drift.is_physical


def test_a_trend_of_no_time_is_zero():
    assert Trend().values(np.full(3, 2.0), np.zeros(3)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("average", [None, BandAverage(TIME, 5.0)])
def test_moments_hold_what_friction_remembers(average):
    _, (q, v, a) = motion()
    regressor = build_regressor(ARM, (*DEFAULT_FRICTION, SLIP, Drift()))
    theta = np.random.default_rng(0).normal(size=len(regressor.names))
    tau = regressor.predict(theta, q, v, a, time=TIME)
    moments = accumulate_moments(regressor, q, v, a, tau, average=average)
    assert (moments.residual_energy(theta) <= 1e-15 * np.trace(moments.gram.sum(axis=(0, 1)))).all()
    other = theta.copy()
    other[regressor.names.index("joint_3.maxwell_slip_1")] += 1.0
    assert moments.residual_energy(other).sum() > 1.0


def test_what_remembers_joins_what_remembers_already():
    _, (q, v, a) = motion()
    directions = joint_directions(ARM)
    more = [(MaxwellSlip({"joint_2": (0.1,)}), directions[1]), (Spring(), directions[0]), (Drift(), directions[2])]
    base = build_regressor(ARM, [Viscous(), SLIP])
    extended = extend_regressor(base, more)
    Y = extended.evaluate(q, v, a, time=TIME)
    p = len(base.names)
    np.testing.assert_allclose(Y[:, :, :p], base.evaluate(q, v, a), atol=1e-12)
    for (kind, direction), columns in zip(more, ([p], [p + 1], [p + 2, p + 3]), strict=True):
        alone = build_regressor(ARM, [kind])
        (own,) = [list(part.columns) for part in alone.parts if part.direction.name == direction.name]
        wanted = alone.evaluate(q, v, a, time=TIME)[:, :, own]
        np.testing.assert_allclose(Y[:, :, columns], wanted, atol=1e-9)


def test_a_coupling_remembers_its_own_way():
    s, (q, v, a) = motion()
    coupling = Coupling(("joint_1", "joint_3"), (1.0, -1.0))
    slip = MaxwellSlip({"joint_1-joint_3": (0.4,)})
    got = build_regressor(ARM, [slip], [coupling]).evaluate(q, v, a)[:, :, 30]
    np.testing.assert_allclose(got[:, 0], slow_play(s[:, 0] - s[:, 2], 0.4), atol=1e-9)
    np.testing.assert_allclose(got[:, 2], -got[:, 0])


def test_one_instant_takes_what_is_remembered_as_an_input():
    _, (q, v, a) = motion()
    regressor = build_regressor(ARM, [SLIP])
    (remembered,) = regressor.histories(q)
    k = 700
    wanted = regressor.evaluate(q, v, a)[k]
    np.testing.assert_allclose(regressor.function(q[k], v[k], a[k], remembered[k]).full(), wanted, atol=1e-12)
    theta = np.arange(len(regressor.names), dtype=float)
    tau = regressor.torque(q[k], v[k], a[k], theta, remembered[k]).full().ravel()
    np.testing.assert_allclose(tau, wanted @ theta, atol=1e-9)
    with pytest.raises(ParameterError, match=r"what remembers needs q of many samples, \(N, 4\); got \(4,\)"):
        regressor.histories(q[0])


def test_displacements_are_proposed_in_proportion_to_the_travel():
    direction = Direction("joint_1", np.eye(3)[0], linear=False)
    several = list(MaxwellSlip.candidates(JointUse(direction, 1.0, 0.02, travel=0.5)))
    assert [one.displacements["joint_1"] for one in several] == [(0.0005,), (0.0015,), (0.005,), (0.015,), (0.05,)]
    assert several[1].describe(direction) == "hysteresis (Maxwell slip over 0.0015 rad)"
    assert list(MaxwellSlip.candidates(JointUse(direction, 1.0, 0.02))) == []


@pytest.mark.parametrize(("displacements", "message"), [((0.0,), "must be positive"), ((0.1, 0.1), "must differ")])
def test_displacements_that_cannot_be_are_refused(displacements, message):
    with pytest.raises(ParameterError, match=message):
        MaxwellSlip({"joint_1": displacements})

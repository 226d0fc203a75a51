"""Friction and torque that repeat over position: waves, counterweights, and the search for wave numbers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from casysid.dynamics import (
    DEFAULT_FRICTION,
    Coulomb,
    CoulombRipple,
    Counterweight,
    Direction,
    JointUse,
    Ripple,
    build_regressor,
)
from casysid.dynamics.friction.wave_numbers import ripple_wave_numbers
from casysid.errors import ParameterError
from casysid.identification.friction_candidates import joint_uses, with_ripples
from casysid.robot import JointKind
from tests.strategies import random_motion, random_robot

ARM = random_robot(np.random.default_rng(3), (JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.CONTINUOUS))
q, v, a = random_motion(ARM, np.random.default_rng(4), 50)
S = np.column_stack([q[:, :2], np.arctan2(q[:, 3], q[:, 2])])
WAVES = {"joint_1": (7.5, 21.0), "joint_3": (14.0,)}


def slow_waves(rng, samples):
    """A joint that wanders over some radians, and coloured noise of unit variance."""
    time = 0.01 * np.arange(samples)
    angles = np.outer(time, rng.uniform(0.3, 3.0, 4)) + rng.uniform(0.0, 6.0, 4)
    noise = np.sqrt(1.0 - 0.9**2) * lfilter([1.0], [1.0, -0.9], rng.normal(size=samples))
    return np.sin(angles) @ rng.uniform(0.2, 0.6, 4), noise


@pytest.mark.parametrize(
    ("kind", "sign"), [(Ripple(WAVES), np.ones_like(v)), (CoulombRipple(WAVES, 0.2), np.tanh(v / 0.2))]
)
@given(st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6))
@settings(max_examples=10)
def test_waves_act_over_the_position_of_their_joints(kind, sign, theta):
    regressor = build_regressor(ARM, [kind])
    assert [one.removeprefix(f"joint_1.{kind.kind}_") for one in regressor.names[30:34]] == [
        "cos_7.5", "sin_7.5", "cos_21", "sin_21",
    ]  # fmt: skip
    got = regressor.predict([*np.zeros(30), *theta], q, v, a)
    wanted = np.zeros_like(v)
    for (joint, k), (c, s) in zip([(0, 7.5), (0, 21.0), (2, 14.0)], np.reshape(theta, (3, 2)), strict=True):
        wanted[:, joint] += (c * np.cos(k * S[:, joint]) + s * np.sin(k * S[:, joint])) * sign[:, joint]
    np.testing.assert_allclose(got, wanted, atol=1e-12)


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
@settings(max_examples=10)
def test_a_counterweight_goes_with_the_angle_of_its_joint_and_none_with_a_length(c, s):
    regressor = build_regressor(ARM, [Counterweight(("joint_1", "joint_2"))])
    assert regressor.names[30:] == ("joint_1.counterweight_cos", "joint_1.counterweight_sin")
    got = regressor.predict([*np.zeros(30), c, s], q, v, a)
    np.testing.assert_allclose(got[:, 0], c * np.cos(q[:, 0]) + s * np.sin(q[:, 0]), atol=1e-12)
    assert not got[:, 1:].any()


@given(st.integers(1, 3), st.integers(0, 10_000))
@settings(max_examples=30)
def test_friction_over_position_that_keeps_its_laws_never_drives(waves, seed):
    rng = np.random.default_rng(seed)
    numbers = tuple(sorted(rng.choice(np.arange(1, 40), waves, replace=False).tolist()))
    regressor = build_regressor(ARM, [Coulomb(), CoulombRipple({"joint_1": numbers})])
    own = rng.normal(size=2 * waves)
    values = dict(zip(regressor.names[33:], own, strict=True))
    laws = regressor.friction_laws
    needed = max(-sum(values.get(name, 0.0) * one for name, one in law.coefficients.items()) for law in laws)
    dry = np.linspace(-np.pi, np.pi, 20_001)
    waved = sum(
        c * np.cos(k * dry) + s * np.sin(k * dry) for k, (c, s) in zip(numbers, own.reshape(-1, 2), strict=True)
    )
    amplitudes = np.hypot(*own.reshape(-1, 2).T).sum()
    assert needed + waved.min() >= 0.0  # Coulomb's friction at its smallest brakes everywhere
    assert amplitudes <= needed <= (1.002, 1.09, 1.42)[waves - 1] * amplitudes
    assert len(laws) <= 64


def test_without_coulomb_friction_there_is_no_room_for_waves_of_it():
    (*laws,) = build_regressor(ARM, [CoulombRipple({"joint_1": (5.0,)})]).friction_laws
    assert all(
        law.coefficients.keys() == {"joint_1.coulomb_ripple_cos_5", "joint_1.coulomb_ripple_sin_5"} for law in laws
    )
    assert max(-law.coefficients["joint_1.coulomb_ripple_sin_5"] for law in laws) > 1.0


@given(st.integers(0, 10_000), st.floats(15.0, 150.0))
@settings(max_examples=15)
def test_a_wave_in_a_residual_is_found(seed, k):
    rng = np.random.default_rng(seed)
    s, noise = slow_waves(rng, 4000)
    found = ripple_wave_numbers(s, noise + 1.0 * np.cos(k * s + 1.0), 200.0)
    assert found[0] == pytest.approx(k, abs=1.0 / np.ptp(s))


def test_two_waves_are_found_the_larger_first():
    rng = np.random.default_rng(2)
    s, noise = slow_waves(rng, 6000)
    found = ripple_wave_numbers(s, 0.2 * noise + 0.3 * np.sin(33.0 * s) + 0.6 * np.cos(80.0 * s), 150.0)
    assert found == pytest.approx((80.0, 33.0), abs=0.1)


def test_noise_has_no_waves():
    cases = [slow_waves(np.random.default_rng(seed), 2000) for seed in range(300)]
    assert sum(bool(ripple_wave_numbers(s, noise, 200.0)) for s, noise in cases) <= 9  # 3 on average
    assert ripple_wave_numbers(np.zeros(100), np.ones(100), 200.0) == ()


def test_a_joint_without_end_has_whole_wave_numbers():
    rng = np.random.default_rng(1)
    s = np.cumsum(rng.uniform(0.0, 0.1, 5000))
    wrapped = np.angle(np.exp(1j * s))
    assert ripple_wave_numbers(wrapped, np.cos(12.0 * s) + rng.normal(size=5000), 20.0, unlimited=True) == (12.0,)
    with pytest.raises(ParameterError, match="'joint_3' turns without end, so wave_numbers must be whole"):
        build_regressor(ARM, [Ripple({"joint_3": (2.5,)})])


def test_a_first_models_residual_says_where_waves_are():
    rng = np.random.default_rng(5)
    time = 0.01 * np.arange(5000)
    position = np.column_stack([slow_waves(rng, 5000)[0] for _ in range(3)])
    velocity = np.gradient(position, time, axis=0)
    residual = 0.1 * rng.normal(size=(5000, 3))
    residual[:, 0] += 0.1 * np.cos(30.0 * position[:, 0])
    residual[:, 1] += 0.1 * np.sin(20.0 * position[:, 1]) * np.sign(velocity[:, 1])
    speed = np.sqrt(np.mean(velocity**2, axis=0))
    uses = with_ripples(joint_uses(ARM, speed, 0.01 * speed), position, velocity, residual, 10.0)
    assert uses[0].ripple == pytest.approx((30.0,), abs=0.1)
    assert uses[1].friction_ripple == pytest.approx((20.0,), abs=0.1)
    assert [uses[0].friction_ripple, uses[1].ripple, uses[2].ripple, uses[2].friction_ripple] == [()] * 4


def test_what_the_residual_shows_is_proposed():
    direction = Direction("joint_1", np.eye(3)[0], linear=False)
    use = JointUse(direction, 1.0, 0.02, ripple=(7.0, 3.0), friction_ripple=(9.0, 8.0, 7.0, 6.0))
    (ripple,), (dry,), (weight,) = (list(kind.candidates(use)) for kind in (Ripple, CoulombRipple, Counterweight))
    assert ripple.describe(direction) == "torque ripple over position (wave numbers 7, 3)"
    assert dry.wave_numbers == {"joint_1": (9.0, 8.0, 7.0)}
    assert weight == Counterweight(("joint_1",))
    nothing = JointUse(Direction("joint_2", np.eye(3)[1], linear=True), 1.0, 0.02)
    assert [one for kind in (Ripple, CoulombRipple, Counterweight) for one in kind.candidates(nothing)] == []


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Ripple({"joint_1": (0.0,)}), "wave_numbers at joint_1 must be positive and finite"),
        (lambda: Ripple({"joint_1": (2.0, 2.0)}), "wave_numbers at joint_1 must differ"),
        (lambda: CoulombRipple({"joint_1": (1.0, 2.0, 3.0, 4.0)}), "at most 3 wave_numbers a joint"),
        (lambda: CoulombRipple({}, width=0.0), "width must be positive"),
        (lambda: ripple_wave_numbers(np.zeros(5), np.zeros(5), 1.0), "N of at least 20"),
    ],
)
def test_what_cannot_be_is_refused(make, message):
    with pytest.raises(ParameterError, match=message):
        make()


def test_waves_join_ordinary_friction():
    names = build_regressor(ARM, (*DEFAULT_FRICTION, Ripple({"joint_2": (100.0,)}))).names
    assert names[-2:] == ("joint_2.ripple_cos_100", "joint_2.ripple_sin_100")

"""The simplest hypothesis within one standard error of the best is taken; joints that none explains have no vote."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.identification.tuning.log_score import PRACTICAL_GAIN, HeldOutScore, simplest_within_one_error

STRETCHES, ROWS = 5, 100.0
LAW = settings(max_examples=50, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def score(error, joints=3, target=10.0, scatter=0.0, seed=0, variance=None):
    """A hypothesis whose errors have a root mean square, with some scatter from stretch to stretch."""
    rng = np.random.default_rng(seed)
    size = np.broadcast_to(np.asarray(error, dtype=float), (STRETCHES, joints))
    energy = ROWS * (size * np.exp(scatter * rng.normal(size=size.shape))) ** 2
    shape = np.ones((STRETCHES, joints))
    own = size**2 if variance is None else variance * shape
    return HeldOutScore(energy, ROWS * np.asarray(target) ** 2 * shape, ROWS * shape, own)


def test_of_equals_the_simplest_is_taken():
    assert simplest_within_one_error([score(1.0)] * 4) == 0


@LAW
@given(st.floats(0.1, 0.9), st.integers(1, 5))
def test_a_clear_gain_is_taken_whatever_its_place(factor, place):
    scores = [score(1.0)] * place + [score(factor)] + [score(1.0)]
    assert simplest_within_one_error(scores) == place


def test_of_two_clear_gains_the_simpler_is_taken_unless_the_other_is_clearly_better():
    assert simplest_within_one_error([score(1.0), score(0.5), score(0.5 * (1.0 - 0.5 * PRACTICAL_GAIN))]) == 1
    assert simplest_within_one_error([score(1.0), score(0.5), score(0.3)]) == 2


@LAW
@given(st.floats(0.0, 0.99))
def test_a_gain_below_practical_size_is_none_however_sure(share):
    assert simplest_within_one_error([score(1.0), score(1.0 - share * PRACTICAL_GAIN)]) == 0
    assert simplest_within_one_error([score(1.0), score(1.0 - 1.01 * PRACTICAL_GAIN)]) == 1
    assert simplest_within_one_error([score(1.0), score(0.8)], least_gain=0.3) == 0


@LAW
@given(seeds)
def test_a_gain_in_one_stretch_alone_is_within_its_error(seed):
    rng = np.random.default_rng(seed)
    plain = score(1.0, scatter=0.01, seed=seed)
    energy = 1.01 * plain.energy
    energy[rng.integers(STRETCHES)] *= 0.2
    lucky = HeldOutScore(energy, plain.target, plain.count, plain.variance)
    assert simplest_within_one_error([plain, lucky]) == 0


@LAW
@given(seeds, st.floats(1e-6, 1e6))
def test_joints_that_nothing_explains_have_no_vote(seed, unit):
    """However much better or worse it is explained: half of the torque's energy is the least that counts."""
    rng = np.random.default_rng(seed)
    joint = rng.integers(3)
    errors, targets = np.ones((2, 3)), np.full(3, 10.0)
    errors[1] = 0.5
    errors[:, joint], targets[joint] = unit * np.array([1.0, 1e3]), unit
    assert simplest_within_one_error([score(error, target=targets) for error in errors]) == 1
    errors[:, joint] = unit * np.array([1e3, 0.8])
    errors[1] = np.where(np.arange(3) == joint, errors[1], 1.0)
    assert simplest_within_one_error([score(error, target=targets) for error in errors]) == 0


def test_where_no_joint_is_explained_the_simplest_is_taken():
    assert simplest_within_one_error([score(11.0), score(9.0)]) == 0


@LAW
@given(seeds)
def test_the_units_of_a_joints_torque_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    units = 10.0 ** rng.uniform(-6, 6, 3)
    raw = [score(rng.uniform(0.5, 1.5, 3), scatter=0.2, seed=seed + k) for k in range(3)]
    scaled = [HeldOutScore(s.energy * units**2, s.target * units**2, s.count, s.variance * units**2) for s in raw]
    assert simplest_within_one_error(raw) == simplest_within_one_error(scaled)


def test_figures_of_a_score():
    one = score([1.0, 2.0, 5.0], variance=4.0)
    assert one.explained == pytest.approx([0.99, 0.96, 0.75])
    everyone = np.ones(3, dtype=bool)
    assert one.size(everyone) == pytest.approx((500.0 * np.array([1.0, 4.0, 25.0])).prod() ** (1.0 / 6.0))
    proved = np.array([4.0, 4.0, 25.0])
    wanted = -0.5 * np.mean(np.array([1.0, 4.0, 25.0]) / proved + np.log(proved))
    assert one.by_stretch(everyone) == pytest.approx(wanted)


@LAW
@given(st.floats(0.1, 0.5), st.floats(1.0, 100.0))
def test_a_fit_that_is_too_sure_of_itself_does_not_lose_by_it(factor, overconfidence):
    """The better hypothesis fits the rest far better than it predicts, as with many parameters and little data."""
    plain, better = score(1.0, variance=0.5), score(factor, variance=0.5 * factor**2 / overconfidence)
    assert simplest_within_one_error([plain, better]) == 1

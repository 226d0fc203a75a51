"""The one pass against its slow and obvious form."""

import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.accumulation import accumulate_moments
from casysid.dynamics import Coupling, build_regressor, bulk, template
from casysid.errors import ParameterError
from casysid.moments import Moments
from casysid.robot import JointKind
from casysid.signals import BandAverage
from tests.strategies import generators, random_motion, random_robot, robots

ROBOT = random_robot(np.random.default_rng(0), [JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.REVOLUTE])
REGRESSOR = build_regressor(ROBOT, couplings=[Coupling(("joint_1", "joint_3"), (1.0, 1.0))])


def log(robot, samples, rng):
    motion = random_motion(robot, rng, samples)
    return (*motion, rng.normal(size=(samples, robot.nv)))


def slowly(regressor, q, v, a, tau, blocks):
    """Every row written out, every outer product summed."""
    Y = np.array([regressor.function(*state).full() for state in zip(q, v, a, strict=True)])
    rows = np.concatenate([Y, tau[:, :, None]], axis=2)
    parts = np.array_split(rows, blocks)
    gram = np.array([[part[:, j].T @ part[:, j] for j in range(regressor.robot.nv)] for part in parts])
    count = np.array([[len(part)] * regressor.robot.nv for part in parts], dtype=float)
    return Moments.from_dense(gram, count, regressor.names, regressor.robot.dofs)


def assert_same(got, wanted, relative=1e-12):
    scale = np.abs(wanted.gram).max(axis=(2, 3), keepdims=True)
    np.testing.assert_allclose(got.gram / scale, wanted.gram / scale, rtol=0, atol=relative)
    np.testing.assert_array_equal(got.count, wanted.count)
    assert (got.columns, got.joints) == (wanted.columns, wanted.joints)


@settings(max_examples=20, deadline=None)
@given(robots(max_joints=3), generators(), st.integers(1, 5))
def test_moments_are_the_sums_of_outer_products(robot, rng, blocks):
    regressor = build_regressor(robot)
    samples = log(robot, 12, rng)
    assert_same(accumulate_moments(regressor, *samples, blocks=blocks), slowly(regressor, *samples, blocks))


def test_couplings_are_summed_too():
    samples = log(ROBOT, 30, np.random.default_rng(1))
    assert_same(accumulate_moments(REGRESSOR, *samples, blocks=3), slowly(REGRESSOR, *samples, 3))


def test_the_sums_do_not_depend_on_threads_or_chunks(monkeypatch):
    samples = log(ROBOT, 20_000, np.random.default_rng(2))
    once = accumulate_moments(REGRESSOR, *samples, blocks=3, threads=1)
    np.testing.assert_array_equal(accumulate_moments(REGRESSOR, *samples, blocks=3, threads=3).gram, once.gram)
    monkeypatch.setattr(bulk, "SAMPLES", 700)
    assert_same(accumulate_moments(REGRESSOR, *samples, blocks=3), once)


def test_averages_do_not_depend_on_threads_or_chunks(monkeypatch):
    samples, average = log(ROBOT, 5000, np.random.default_rng(12)), BandAverage(np.arange(5000) * 0.01, 1.0)
    valid = np.random.default_rng(13).random((5000, 3)) > 1e-3
    once, own = (accumulate_moments(REGRESSOR, *samples, average=average, valid=x, blocks=3) for x in (None, valid))
    monkeypatch.setattr(bulk, "SAMPLES", 130)
    for mask, wanted in ((None, once), (valid, own)):
        got = accumulate_moments(REGRESSOR, *samples, average=average, valid=mask, blocks=3, threads=3)
        assert_same(got, wanted)
    assert (own.count < once.count).any()


@pytest.mark.skipif(shutil.which("gcc") is None and shutil.which("cc") is None, reason="needs a compiler")
@pytest.mark.parametrize("average", [None, BandAverage(np.arange(3000) * 0.01, 1.0)], ids=["samples", "averages"])
def test_both_routes_give_the_same_sums_to_the_bit(average, tmp_path, monkeypatch):
    samples = log(ROBOT, 3000, np.random.default_rng(3))
    template._kept.cache_clear()
    replayed = accumulate_moments(build_regressor(ROBOT), *samples, average=average, blocks=2)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(bulk, "FIND_FROM", 0)
    monkeypatch.setattr(bulk, "COMPILE_FROM", 0)
    for kernel in ("compiled", "found"):
        template._kept.cache_clear()
        regressor = build_regressor(ROBOT)
        both = accumulate_moments(regressor, *samples, average=average, blocks=2)
        assert regressor.equations.route == "compiled", kernel
        assert both.gram.tobytes() == replayed.gram.tobytes(), kernel
    template._kept.cache_clear()


def test_parts_of_a_log_add_up_to_the_whole():
    samples = log(ROBOT, 400, np.random.default_rng(4))
    whole = accumulate_moments(REGRESSOR, *samples, blocks=4)
    halves = [
        accumulate_moments(REGRESSOR, *(x[part] for x in samples), blocks=2) for part in (slice(200), slice(200, None))
    ]
    assert_same(halves[0] + halves[1], whole)


def test_samples_that_are_not_valid_are_as_if_never_logged():
    samples = log(ROBOT, 90, np.random.default_rng(5))
    valid = np.arange(90) % 3 != 0
    samples[3][~valid] = np.nan
    left = accumulate_moments(REGRESSOR, *(x[valid] for x in samples), blocks=4)
    assert_same(accumulate_moments(REGRESSOR, *samples, valid=valid, blocks=4), left)


def test_each_joint_sums_its_own_valid_samples():
    samples = log(ROBOT, 90, np.random.default_rng(9))
    valid = np.random.default_rng(10).random((90, 3)) > 0.3
    together = accumulate_moments(REGRESSOR, *samples, valid=valid, blocks=1)
    for joint in range(3):
        alone = accumulate_moments(REGRESSOR, *samples, valid=valid[:, joint], blocks=1)
        scale = np.abs(alone.gram[0, joint]).max()
        np.testing.assert_allclose(together.gram[0, joint], alone.gram[0, joint], rtol=0, atol=1e-12 * scale)
        assert together.count[0, joint] == valid[:, joint].sum()


def test_averages_over_samples_that_are_not_valid_for_a_joint_leave_the_other_joints_alone():
    samples, time = log(ROBOT, 400, np.random.default_rng(11)), np.arange(400) * 0.01
    valid = np.ones((400, 3), dtype=bool)
    valid[100:200, 1] = False
    spoilt = samples[3].copy()
    spoilt[105:195, 1] = 1e6
    average = BandAverage(time, 5.0)
    whole, part = (
        accumulate_moments(REGRESSOR, *samples[:3], tau, average=average, valid=mask, blocks=1)
        for tau, mask in ((samples[3], None), (spoilt, valid))
    )
    np.testing.assert_array_equal(part.gram[0, [0, 2]], whole.gram[0, [0, 2]])
    assert 0 < part.count[0, 1] < whole.count[0, 1]
    assert part.gram[0, 1, -1, -1] < whole.gram[0, 1, -1, -1]


def test_there_are_never_more_blocks_than_samples():
    samples = log(ROBOT, 3, np.random.default_rng(6))
    moments = accumulate_moments(REGRESSOR, *samples, blocks=20)
    assert moments.blocks == 3
    assert (moments.count == 1).all()


def test_progress_reaches_the_end():
    told = []
    accumulate_moments(REGRESSOR, *log(ROBOT, 9000, np.random.default_rng(7)), progress=lambda *x: told.append(x))
    assert told[-1] == (9000, 9000)
    assert told == sorted(told)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tau": np.zeros((10, 2))}, r"wants q \(N, 3\).*tau \(N, 3\); got"),
        ({"tau": np.zeros(3)}, r"must be \(N, n\)"),
        ({"a": np.full((10, 3), np.inf)}, "a must be finite; 10 samples are not, the first is number 0"),
        ({"valid": np.zeros(10, dtype=bool)}, "no sample to sum, 10 given and 10 left out"),
        ({"valid": np.zeros(10)}, "valid must be boolean"),
        ({"valid": np.ones((10, 2), dtype=bool)}, r"shape \(10,\) or \(10, 3\); got bool with shape \(10, 2\)"),
        ({"valid": np.zeros((10, 3), dtype=bool)}, "no sample to sum, 10 given and 10 left out"),
        ({"blocks": 0}, "blocks must be at least 1; got 0"),
    ],
)
def test_a_log_that_cannot_be_summed_is_refused(change, message):
    arguments = dict(zip("q v a tau".split(), log(ROBOT, 10, np.random.default_rng(8)), strict=True)) | change
    with pytest.raises(ParameterError, match=message):
        accumulate_moments(REGRESSOR, **arguments)

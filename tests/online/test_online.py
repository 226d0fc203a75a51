"""On-line identification against what is known: the offline smoothing, dense rows, a load of known mass."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import casysid
from casysid.dynamics import build_regressor
from casysid.errors import ParameterError, RecordingError
from casysid.inertia import inertial_parameters
from casysid.moments import Moments
from casysid.online.forgetting import Block, FadingMoments, with_payload
from casysid.online.stream import MotionStream, Samples
from casysid.signals import motion_from_recording
from casysid.signals.motion import MotionScales

ROBOT = casysid.Robot.from_file(casysid.find_model("two_link"))
REGRESSOR = build_regressor(ROBOT)
MASS, RATE = 1.0, 200.0
BODY = inertial_parameters(MASS, [0.05, -0.03, 0.0], np.diag([2e-3, 3e-3, 4e-3]))


def log(seed: int, duration: float, holding: slice = slice(0, 0)):
    """Time, positions and torques along sums of sines, with friction and noise; samples that hold the body."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration, 1.0 / RATE)
    w, phase = rng.uniform(0.5, 5.0, (4, 2)), rng.uniform(0.0, 6.0, (4, 2))
    angle = w * t[:, None, None] + phase
    q, v, a = (0.4 * x.sum(axis=1) for x in (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle)))
    theta = REGRESSOR.prior.copy()
    for k, name in enumerate(REGRESSOR.names):
        theta[k] = {"viscous": 0.3, "coulomb": 0.4}.get(name.rsplit(".", 1)[-1], theta[k])
    tau = REGRESSOR.predict(theta, q, v, a)
    loaded = theta.copy()
    links = ROBOT.inertial_parameters.size
    loaded[links - 10 : links] += BODY
    tau[holding] = REGRESSOR.predict(loaded, q[holding], v[holding], a[holding])
    return t, q + 1e-5 * rng.normal(size=q.shape), tau + 0.05 * rng.normal(size=tau.shape)


@pytest.fixture(scope="module")
def start():
    t, q, tau = log(0, 20.0)
    recording = casysid.Recording(
        channels=ROBOT.channels, dofs=ROBOT.dofs, time=t, position=q, torque=tau, sources=("made",)
    )
    return casysid.identify(ROBOT, recording, casysid.Settings(choose_friction=False))


def fed(online, t, q, tau, step):
    return [
        event
        for k in range(0, len(t), step)
        for event in online.add(t[k : k + step], q[k : k + step], tau[k : k + step])
    ]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_load_is_noticed_and_weighed_and_its_end_too(start, seed):
    picked, gone = int(20 * RATE), int(32 * RATE)
    t, q, tau = log(seed, 42.0, slice(picked, gone))
    online = casysid.Online(ROBOT, start)
    events = fed(online, t[:gone], q[:gone], tau[:gone], 40)
    assert [event.kind for event in events] == ["payload"]
    assert 0.0 < events[0].noticed - t[picked] < 2.0
    assert abs(events[0].since - t[picked]) < online.lag
    held = online.held
    assert abs(held.mass - MASS) < 5.0 * held.mass_std < 0.5
    assert_allclose(held.center_of_mass[:2], [0.05, -0.03], atol=0.02)
    assert online.verdict.accepted
    after = fed(online, t[gone:], q[gone:], tau[gone:], 40)
    assert [event.kind for event in after] == ["put down"]
    assert online.held is None


@pytest.mark.slow
def test_nothing_is_said_where_nothing_happens_and_single_samples_are_batches(start):
    t, q, tau = log(5, 25.0)
    together, single = casysid.Online(ROBOT, start), casysid.Online(ROBOT, start)
    assert fed(together, t, q, tau, 200) == []
    for row in zip(t, q, tau, strict=True):
        assert single.add(*row) == ()
    assert_allclose(together.model.parameters, single.model.parameters, rtol=1e-9, atol=1e-12)
    assert together.verdict.accepted
    _, error = together.model.torque(q[0], q[0], q[0], std=True)
    assert (error > 0.0).all()
    assert np.isfinite(error).all()


@pytest.mark.slow
def test_friction_that_changes_is_told_with_its_joint(start):
    t, q, tau = log(6, 40.0)
    later = t > 20.0
    speed = np.gradient(q[:, 1], t)
    tau[later, 1] += 0.4 * np.tanh(speed[later] / 0.02)
    events = fed(casysid.Online(ROBOT, start), t, q, tau, 100)
    assert {(event.kind, event.joint) for event in events} == {("friction", ROBOT.dofs[1])}
    assert_allclose(events[0].size, 0.4, atol=5.0 * events[0].std)
    assert 0.0 < events[0].noticed - 20.0 < 2.0
    assert len(events) <= 2


def test_it_learns_first(start):
    online = casysid.Online(ROBOT, learn=8.0)
    t, q, tau = log(7, 9.0)
    assert online.add(t[:1000], q[:1000], tau[:1000]) == ()
    assert not online.ready
    with pytest.raises(ParameterError, match="no model yet"):
        _ = online.model
    online.add(t[1000:], q[1000:], tau[1000:])
    assert online.ready
    assert online.lag > 0.0


def test_what_is_no_sample_is_left_out_or_refused():
    samples = Samples(ROBOT)
    samples.add([0.0, 0.1, 0.1, 0.05, 0.2], np.zeros((5, 2)), np.zeros((5, 2)))
    samples.add(0.3, [np.nan, 0.0], [0.0, 0.0])
    samples.add(0.15, [0.0, 0.0], [0.0, 0.0])
    assert samples.dropped == 4
    assert_allclose(samples.recording().time, [0.0, 0.1, 0.2])
    with pytest.raises(RecordingError, match="wanted time"):
        samples.add(0.4, [0.0], [0.0, 0.0])
    with pytest.raises(ParameterError, match="positive number of seconds"):
        casysid.Online(ROBOT, forget=0.0)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000), st.floats(2.0, 8.0))
def test_streamed_motion_is_that_of_the_whole(seed, cutoff):
    t, q, tau = log(seed, 8.0)
    recording = casysid.Recording(channels=ROBOT.channels, dofs=ROBOT.dofs, time=t, position=q, torque=tau)
    whole = motion_from_recording(ROBOT, recording, cutoff)
    scales = MotionScales(np.full(2, 1e-5), np.ones(2))
    stream = MotionStream(ROBOT, smoothing=cutoff, cutoff=cutoff, delays=np.zeros(2), scales=scales, stride=1)
    samples, parts = Samples(ROBOT), []
    for k in range(0, len(t), 37):
        samples.add(t[k : k + 37], q[k : k + 37], tau[k : k + 37])
        parts += stream.batches(samples)
    time = np.concatenate([part.time for part in parts])
    assert_allclose(time, t[: len(time)])
    assert t[-1] - time[-1] <= stream.lag + 1e-9
    inside = time > stream.overlap
    for name in ("q", "v", "a"):
        got, wanted = np.concatenate([getattr(part, name) for part in parts]), getattr(whole, name)[: len(time)]
        assert np.abs(got - wanted)[inside].max() < 0.02 * np.abs(wanted).max()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_a_payload_has_columns_of_its_own(seed):
    rng = np.random.default_rng(seed)
    p, link, first = 24, np.arange(10, 20), 20
    rows = [rng.normal(size=(7, p + 1)) for _ in range(3)]
    held = np.array([False, True, False])
    names = [f"x{k}" for k in range(p)]
    moments = Moments.from_dense(np.stack([[x.T @ x] for x in rows]), np.full((3, 1), 7.0), names, ["y"])
    wide = []
    for x, holds in zip(rows, held, strict=True):
        extra = x[:, link] * holds
        wide.append(np.hstack([x[:, :first], extra, x[:, first:]]))
    assert_allclose(with_payload(moments, held, link, first).gram[:, 0], [x.T @ x for x in wide], atol=1e-9)


def test_blocks_fade_and_stay_few():
    one = Moments.from_dense(np.ones((1, 1, 2, 2)), np.ones((1, 1)), ["x"], ["y"])
    fading = FadingMoments(one, 0.0, 10.0)
    for k in range(500):
        fading.add(Block(one, k + 0.5, 1.0, False))
    moments, held = fading.weighted(500.0)
    assert moments.blocks <= 40
    assert not held.any()
    ages = 500.0 - np.arange(470, 500) - 0.5
    assert_allclose(moments.count.sum(), np.exp(-ages / 10.0).sum(), rtol=0.1)

"""How late the torque is: found, taken out, and left alone where there is nothing to find."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.dynamics import DEFAULT_FRICTION, Coulomb, build_regressor
from casysid.errors import ParameterError, RecordingError
from casysid.identification import Settings, identify
from casysid.identification.passes import Passes
from casysid.identification.tuning.band import choose_band
from casysid.identification.tuning.candidates import usual_friction
from casysid.identification.tuning.delay import choose_delay
from casysid.identification.tuning.delayed_moments import node_delays, sum_delayed_moments
from casysid.recording import Recording, read_recording
from casysid.robot import Robot
from casysid.simulation import design_sinusoids
from tests.simulated import bundled_robot

RATE, CUTOFF = 420.0, 6.0
REAL = Path(__file__).parents[4] / "shared" / "data"


def late_recording(name, delays, seed=0, duration=15.0, position_noise=1e-4, torque_noise=0.03):
    """A simulated log whose torques are ``delays`` late, shape (nv,) [s]; with its regressor and true motion."""
    robot = bundled_robot(name)
    delays = np.broadcast_to(delays, robot.nv)
    sinusoids = design_sinusoids(robot, duration=duration, seed=seed, band=(0.1, 2.0))
    time = np.arange(0.0, duration, 1 / RATE)
    reference = sinusoids.sample(time)
    sharp = tuple(dataclasses.replace(c, width=1e-3) if isinstance(c, Coulomb) else c for c in DEFAULT_FRICTION)
    regressor = build_regressor(robot, friction=sharp)

    def torque(at):
        sample = sinusoids.sample(at)
        return regressor.predict(regressor.prior, sample.q, sample.v, sample.a)

    tau = np.stack([torque(time - late)[:, k] for k, late in enumerate(delays)], axis=1)
    rng = np.random.default_rng(seed)
    recording = Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=time,
        position=reference.channels + position_noise * rng.normal(size=reference.channels.shape),
        torque=tau + torque_noise * tau.std(axis=0) * rng.normal(size=tau.shape),
    )
    return robot, recording, regressor, reference, torque(time)


def usual(robot, recording, cutoff=CUTOFF):
    """Passes over a recording, and the regressor of the usual model."""
    passes = Passes(robot, [recording], choose_band([recording], cutoff))
    return passes, build_regressor(robot, friction=usual_friction(passes, Settings()))


def found(robot, recording, cutoff=CUTOFF):
    return choose_delay(*usual(robot, recording, cutoff))


@pytest.fixture(scope="module")
def at_nodes():
    """Moments of one log by how many nodes lie between the same first and last one."""
    robot, recording, *_ = late_recording("two_link.urdf", 0.0, duration=8.0)
    passes, regressor = usual(robot, recording)
    first, *_, last = node_delays(0.0, CUTOFF)

    def summed(count):
        nodes = np.linspace(first, last, count)
        return sum_delayed_moments(regressor, passes.sparse_motions, passes.motions, nodes, CUTOFF, blocks=4)

    return {count: summed(count) for count in (13, 25)}


@settings(max_examples=10, deadline=None)
@given(st.integers(4, 20), st.integers(4, 20))
def test_between_the_nodes_moments_are_those_of_a_pass_with_a_node_there(at_nodes, first, second):
    coarse, fine = at_nodes[13], at_nodes[25]
    delays = fine.nodes[[first, second]]
    for joint, node in enumerate((first, second)):
        own, between = coarse.at(delays).of_joint(joint)
        places = np.append(np.arange(len(own)), len(own) + node)
        wanted = fine.squares[joint][:, places[:, None], places]
        size = np.sqrt(np.einsum("bm,bn->bmn", *(2 * [np.einsum("bmm->bm", wanted)])))
        assert np.abs(between - wanted).max() < 1e-3 * size.max()
        assert (np.abs(between - wanted) <= 1e-3 * size + 1e-9).all()


@settings(max_examples=10, deadline=None)
@given(st.floats(-0.05, 0.05), st.integers(0, 1))
def test_the_column_of_a_delay_is_minus_the_slope_of_the_torque(at_nodes, delay, joint):
    moments, step = at_nodes[13], 1e-5
    delays, group = np.full(2, delay), np.eye(2)[[joint]]
    column = moments.at(delays, group).gram[:, joint, -2, :-2]
    later, earlier = (moments.at(delays + sign * step).gram[:, joint, -1, :-1] for sign in (1, -1))
    np.testing.assert_allclose(column, (earlier - later) / (2 * step), atol=1e-6 * np.abs(column).max())


@pytest.mark.parametrize(
    ("name", "delay"),
    [
        (name, delay)
        for name in ("two_link.urdf", "scara.urdf")
        for delay in (0.0, 0.3 / RATE, 2.4 / RATE, 0.005, -0.004)
    ]
    + [("head.urdf", 0.005)],
)
def test_a_delay_is_found_to_a_tenth_of_a_sample_and_taken_out(name, delay):
    robot, recording, *_ = late_recording(name, delay)
    choice = found(robot, recording)
    assert choice.is_common
    assert np.abs(choice.estimate - delay).max() < 0.1 / RATE
    assert choice.is_none == (delay == 0.0)
    assert np.abs(choice.estimate - delay).max() < 5.0 * choice.std.max() < 0.5 / RATE


def test_a_delay_far_beyond_the_first_nodes_is_found():
    robot, recording, *_ = late_recording("two_link.urdf", 0.08)
    assert np.abs(found(robot, recording).seconds - 0.08).max() < 0.2 / RATE


def test_joints_that_are_late_by_different_times_get_their_own_delays():
    delays = np.array([0.002, 0.012])
    robot, recording, *_ = late_recording("two_link.urdf", delays)
    choice = found(robot, recording)
    assert not choice.is_common
    assert np.abs(choice.seconds - delays).max() < 0.1 / RATE


def test_finding_the_delay_costs_little_against_knowing_it():
    errors = []
    for seed in range(6):
        robot, recording, _, reference, tau = late_recording("two_link.urdf", 0.005, seed)
        for delay in (0.005, None, *([0.0] if seed == 0 else [])):
            result = identify(robot, recording, Settings(cutoff=CUTOFF, delay=delay))
            predicted = result.regressor.predict(result.parameters, reference.q, reference.v, reference.a)
            errors.append((delay, np.linalg.norm(predicted - tau) / np.linalg.norm(tau)))
    known, found_by_itself, ignored = (
        np.sqrt(np.mean([error**2 for delay, error in errors if delay == wanted])) for wanted in (0.005, None, 0.0)
    )
    assert found_by_itself < 1.05 * known
    assert ignored > 2.0 * known


def test_held_out_recordings_are_aligned_alike():
    robot, recording, *_ = late_recording("two_link.urdf", 0.01)
    train, test = recording.split(0.6)
    late, blind = (
        identify(robot, train, Settings(cutoff=CUTOFF, delay=delay), held_out=[test]) for delay in (None, 0.0)
    )
    assert late.held_out.relative < 0.5 * blind.held_out.relative


def test_a_given_delay_is_taken_as_it_is():
    robot, recording, *_ = late_recording("two_link.urdf", 0.0, duration=4.0)
    choice = choose_delay(*usual(robot, recording), 0.003)
    np.testing.assert_array_equal(choice.seconds, 0.003)
    assert choice.reason == "3 ms, given"


def test_samples_without_time_have_no_delay():
    robot, recording, *_ = late_recording("two_link.urdf", 0.0, duration=4.0)
    zeros = np.zeros_like(recording.torque)
    unordered = dataclasses.replace(recording, time=None, velocity=zeros, acceleration=zeros)
    assert choose_delay(*usual(robot, unordered)).is_none
    with pytest.raises(RecordingError, match="without time have none"):
        choose_delay(*usual(robot, unordered), 0.01)


def test_a_delay_that_is_no_number_is_refused():
    with pytest.raises(ParameterError, match="delay must be a finite number of seconds; got nan"):
        Settings(delay=np.nan)


@pytest.mark.skipif(not REAL.is_dir(), reason="the real robots' logs are not there")
@pytest.mark.parametrize(("folder", "urdf", "log", "late"), [
    ("airbot_play", "airbot_play.urdf", "chirp", True),
    ("emps", "emps.urdf", "estimation", False),
])  # fmt: skip
def test_real_logs_are_late_or_not(folder, urdf, log, late):
    robot = Robot.from_file(REAL / folder / urdf)
    choice = found(robot, read_recording(REAL / folder / f"{log}.csv.gz", robot), cutoff=6.0)
    assert (np.abs(choice.estimate) > 4.0 * choice.std).all() == late
    assert choice.is_none  # neither costs a twentieth of the torque error

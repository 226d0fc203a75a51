"""Recordings are smoothed and summed a few times only, and equations near rest are the same equations."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.accumulation import LARGEST_INVALID_SHARE, accumulate_moments
from casysid.dynamics import build_regressor
from casysid.identification import Settings, choose_band, identify, prepare
from casysid.identification.passes import NEAR_REST as WIDTHS
from casysid.identification.passes import Passes
from casysid.moments import NEAR_REST
from casysid.recording import Recording
from casysid.signals import BandAverage
from casysid.simulation import PlantSettings, design_sinusoids
from tests.simulated import bundled_robot, simulated_run

RATE = 200.0


def late(recording, seconds):
    """The same with its torque logged later."""
    torque = np.column_stack([np.interp(recording.time - seconds, recording.time, own) for own in recording.torque.T])
    return dataclasses.replace(recording, torque=torque)


@pytest.mark.parametrize("name", ["two_link.urdf", "scara.urdf"])
@pytest.mark.parametrize("delay", [0.0, 0.012])
def test_a_default_run_smooths_at_most_three_times_and_passes_at_most_four_times(name, delay):
    recordings = [late(simulated_run(name, seed, PlantSettings()).recording, delay) for seed in (0, 1)]
    choices = prepare(bundled_robot(name), recordings, Settings()).choices
    assert choices.delay.is_none == (delay == 0.0)
    assert 1 <= choices.smoothings <= 3
    assert 1 <= choices.passes <= 4


def test_what_is_counted_is_what_is_done(monkeypatch):
    smoothed, summed = [], []
    modules = "casysid.identification.passes"
    motion, moments = (
        __import__(modules, fromlist=[name]).__dict__[name] for name in ("motion_from_recording", "moments_of_known")
    )
    monkeypatch.setattr(f"{modules}.motion_from_recording", lambda *a, **k: smoothed.append(1) or motion(*a, **k))
    monkeypatch.setattr(f"{modules}.moments_of_known", lambda *a, **k: summed.append(1) or moments(*a, **k))
    recording = simulated_run("two_link.urdf", 0, PlantSettings()).recording
    choices = prepare(bundled_robot("two_link.urdf"), recording, Settings(delay=0.0)).choices
    assert len(smoothed) == choices.smoothings
    assert len(summed) == choices.passes


def test_motions_are_smoothed_once_however_often_they_are_asked_for():
    recording = simulated_run("two_link.urdf", 0).recording
    passes = Passes(bundled_robot("two_link.urdf"), [recording], choose_band([recording]))
    assert (passes.smoothings, passes.passes) == (0, 0)
    regressor = build_regressor(passes.robot)
    first, second = passes.moments(regressor), passes.moments(regressor)
    assert passes.sparse_motions is passes.sparse_motions
    assert (passes.smoothings, passes.passes) == (1, 2)
    np.testing.assert_array_equal(first.gram, second.gram)


def test_a_joint_is_near_rest_when_it_stands_or_is_slower_than_some_widths():
    recording = simulated_run("two_link.urdf", 0).recording
    passes = Passes(bundled_robot("two_link.urdf"), [recording], choose_band([recording]))
    (mask,), (motion,) = passes.near_rest, passes.sparse_motions
    assert passes.width == pytest.approx(0.02 * np.sqrt(np.mean(motion.v**2, axis=0)))
    np.testing.assert_array_equal(mask, motion.standing | (np.abs(motion.v) < WIDTHS * passes.width))
    assert 0.0 < mask.mean() < 0.5


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.integers(1, 6))
def test_rows_near_rest_add_up_to_all_rows(seed, share, blocks):
    """Against windows whose weight is looked at one by one."""
    robot, rng = bundled_robot("two_link.urdf"), np.random.default_rng(seed)
    time = np.arange(0.0, 8.0, 1.0 / RATE)
    motion = design_sinusoids(robot, duration=8.0, seed=seed % 1000, band=(0.1, 1.0)).sample(time)
    regressor, tau = build_regressor(robot), rng.normal(size=motion.v.shape)
    slow = np.abs(motion.v) < np.quantile(np.abs(motion.v), share, axis=0)
    average = BandAverage(time, 5.0)
    given = (regressor, motion.q, motion.v, motion.a, tau)
    whole = accumulate_moments(*given, average=average, blocks=blocks)
    split = accumulate_moments(*given, average=average, near_rest=slow, blocks=blocks)
    assert split.joints == (*robot.dofs, *(f"{dof}{NEAR_REST}" for dof in robot.dofs))
    assert split.moving_rows.tolist() == [0, 1, 0, 1]
    nv, size = robot.nv, np.abs(whole.gram).max()
    np.testing.assert_allclose(split.gram[:, :nv] + split.gram[:, nv:], whole.gram, atol=1e-12 * size)
    np.testing.assert_array_equal(split.count[:, :nv] + split.count[:, nv:], whole.count)
    at_rest = [
        ((average.weights(block) @ slow[block]) > LARGEST_INVALID_SHARE).sum(axis=0)
        for block in np.array_split(np.arange(len(time)), blocks)
    ]
    np.testing.assert_array_equal(split.count[:, nv:], at_rest)
    together = split.away_from_rest()
    assert together.joints == robot.dofs
    np.testing.assert_array_equal(together.gram, split.gram[:, :nv])


def test_joints_that_never_come_to_rest_have_no_rows_near_it():
    robot = bundled_robot("two_link.urdf")
    time = np.arange(0.0, 10.0, 1.0 / RATE)
    position = np.column_stack([2.0 * time, np.sin(2.0 * time)])
    recording = Recording(
        channels=robot.channels, dofs=robot.dofs, time=time, position=position, torque=np.ones_like(position)
    )
    passes = Passes(robot, [recording], choose_band([recording], 4.0))
    moments = passes.moments(build_regressor(robot))
    assert moments.joints == (*robot.dofs, f"{robot.dofs[1]}{NEAR_REST}")


def test_predicted_torque_is_the_regressors_with_what_friction_remembers():
    robot = bundled_robot("two_link.urdf")
    run = simulated_run("two_link.urdf", 0, PlantSettings())
    result = identify(robot, run.recording, Settings(delay=0.0))
    (motion,) = result.train_motions
    state = motion.q, motion.v, motion.a
    assert result.regressor.history_count > 0
    ours = result.predict_torque(*state)
    np.testing.assert_array_equal(ours, result.regressor.predict(result.parameters, *state))
    slow = result.regressor.evaluate(*state) @ result.parameters
    np.testing.assert_allclose(ours, slow, atol=1e-9 * np.abs(slow).max())
    inner = np.flatnonzero(motion.settled)
    seen = BandAverage(motion.time, result.cutoff.errors).weights(inner) @ ours[inner]
    np.testing.assert_allclose(result.train.predictions[0], seen, atol=1e-9 * np.abs(seen).max())

"""The band comes of the motion: noise, jumps, gaps and joints at rest do not move it."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.identification import Settings, choose_band, identify
from casysid.identification.tuning.band import (
    EQUATIONS_IN_MOTION,
    HIGHEST_SHARE_OF_RATE,
    SMOOTHING_IN_EQUATIONS,
    motion_band,
)
from casysid.recording import Recording
from tests.simulated import bundled_robot, simulated_run

RATE, DURATION = 250.0, 20.0
LAW = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def motion(seed, joints=3, highest=None):
    """Random sums of sinusoids below a highest frequency [Hz], amplitudes falling with it; that frequency too."""
    rng = np.random.default_rng(seed)
    highest = rng.uniform(0.5, 3.0) if highest is None else highest
    time = np.arange(0.0, DURATION, 1.0 / RATE)
    frequency = rng.uniform(0.1, highest, (5, joints))
    frequency[0] = highest
    amplitude = rng.uniform(0.1, 1.0, (5, joints)) / (1.0 + frequency)
    phase = rng.uniform(0.0, 2.0 * np.pi, (5, joints))
    waves = amplitude * np.sin(2.0 * np.pi * frequency * time[:, None, None] + phase)
    return recorded(time, waves.sum(axis=1)), highest


def recorded(time, position):
    names = tuple(f"j{k}" for k in range(position.shape[1]))
    return Recording(channels=names, dofs=names, time=time, position=position, torque=np.ones_like(position))


def band(recording):
    return choose_band([recording]).motion_band


@LAW
@given(seeds)
def test_it_holds_the_motion_and_hardly_more(seed):
    recording, highest = motion(seed)
    assert 0.1 < band(recording) <= highest + 0.3  # Hann's window spreads a line by two bins of 1 / 20 s
    choice = choose_band([recording])
    assert choice.cutoff == pytest.approx(EQUATIONS_IN_MOTION * choice.motion_band)
    assert choice.smoothing == pytest.approx(SMOOTHING_IN_EQUATIONS * choice.cutoff)
    assert choice.errors == choice.cutoff


@LAW
@given(seeds, st.floats(1e-6, 3e-3))
def test_noise_does_not_move_it(seed, sigma):
    clean, _ = motion(seed)
    noise = sigma * np.random.default_rng([seed, 1]).normal(size=clean.position.shape)
    assert band(dataclasses.replace(clean, position=clean.position + noise)) == pytest.approx(band(clean), rel=0.1)


@LAW
@given(seeds, st.floats(1e-3, 0.05), st.integers(1, 4))
def test_jumps_of_one_sample_do_not_move_it(seed, height, count):
    clean, _ = motion(seed)
    rng = np.random.default_rng([seed, 2])
    position = clean.position.copy()
    position[rng.integers(0, len(position), count), rng.integers(0, 3, count)] += height * rng.choice([-1, 1], count)
    assert band(dataclasses.replace(clean, position=position)) == pytest.approx(band(clean), rel=0.1)


@LAW
@given(seeds, st.floats(1e-6, 1e-3))
def test_a_joint_that_stands_does_not_move_it(seed, sigma):
    clean, _ = motion(seed)
    still = 0.7 + sigma * np.random.default_rng([seed, 3]).normal(size=(len(clean), 1))
    assert band(recorded(clean.time, np.hstack([clean.position, still]))) == pytest.approx(band(clean), rel=0.1)


@LAW
@given(seeds, st.floats(0.02, 0.15), st.floats(0.2, 0.8))
def test_a_gap_does_not_move_it(seed, seconds, place):
    """It is bridged by a line, up to half a period of the quickest motion here."""
    clean, _ = motion(seed)
    hole = (clean.time > place * DURATION) & (clean.time < place * DURATION + seconds)
    parts = {name: getattr(clean, name)[~hole] for name in ("time", "position", "torque")}
    assert band(dataclasses.replace(clean, **parts)) == pytest.approx(band(clean), rel=0.25, abs=0.1)


@LAW
@given(seeds, st.floats(0.2, 5.0))
def test_it_follows_the_clock(seed, scale):
    recording, _ = motion(seed, highest=1.0)
    slow = recording.with_time_scaled(scale)
    assert band(slow) == pytest.approx(band(recording) / scale, rel=1e-9)


@LAW
@given(seeds, st.floats(1e-3, 1e3))
def test_it_does_not_depend_on_the_torque_or_on_units(seed, unit):
    clean, _ = motion(seed)
    torque = np.random.default_rng([seed, 4]).normal(size=clean.torque.shape)
    other = dataclasses.replace(clean, position=unit * clean.position, torque=torque)
    assert band(other) == pytest.approx(band(clean), rel=1e-9)


def test_of_several_recordings_it_is_the_median():
    several = [motion(seed, highest=highest)[0] for seed, highest in enumerate((0.5, 1.0, 3.0))]
    bands = [motion_band(one.spectrum) for one in several]
    assert choose_band(several).motion_band == pytest.approx(np.median(bands))


def test_rate_and_duration_bound_it():
    quick = motion(0, highest=3.0)[0]
    coarse = recorded(quick.time[::20], quick.position[::20])
    choice = choose_band([coarse])
    assert choice.cutoff == pytest.approx(HIGHEST_SHARE_OF_RATE * RATE / 20)
    assert "nearest that rate and duration allow" in choice.reason
    still = recorded(quick.time, np.zeros_like(quick.position))
    assert choose_band([still]).motion_band == 0.0
    assert choose_band([still]).cutoff == pytest.approx(4.0 / still.duration)


def test_a_given_cut_off_is_the_equations_and_errors_keep_the_motions():
    recording, _ = motion(0)
    choice, given = choose_band([recording]), choose_band([recording], 3.0)
    assert (given.cutoff, given.reason, given.smoothing) == (3.0, "given", SMOOTHING_IN_EQUATIONS * 3.0)
    assert given.errors == choice.errors == choice.cutoff


def test_samples_without_time_have_no_band():
    recording, _ = motion(0)
    logged = dataclasses.replace(
        recording, time=None, velocity=np.zeros_like(recording.position), acceleration=np.zeros_like(recording.position)
    )
    choice = choose_band([logged])
    assert (choice.cutoff, choice.smoothing, choice.errors) == (None, None, None)


def test_torque_is_judged_in_the_same_band_whatever_the_cut_off():
    recording = simulated_run("two_link.urdf", 0).recording
    fixed = Settings(choose_friction=False, delay=0.0)
    results = [
        identify(bundled_robot("two_link.urdf"), recording, dataclasses.replace(fixed, cutoff=cutoff))
        for cutoff in (None, 8.0)
    ]
    own, given = (result.cutoff.errors for result in results)
    assert own == given
    measured = [result.train.measured[0] for result in results]
    assert len(measured[0]) == pytest.approx(len(measured[1]), rel=0.05)
    assert results[0].file.relative == pytest.approx(results[1].file.relative, rel=0.02)

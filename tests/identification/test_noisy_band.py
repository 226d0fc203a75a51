"""Noise of the positions lowers the band where much of it would pass, and nowhere else."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.dynamics import MaxwellSlip
from casysid.identification import Settings, choose_band
from casysid.identification.passes import Passes
from casysid.identification.tuning.candidates import CLEAR_OF_NOISE, DISPLACEMENTS, usual_friction
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import cutoff_of
from casysid.signals.noise import smoothed_noise

RATE = 200.0


def recording(noise: float, frequency: float, seed: int = 0) -> Recording:
    """One joint along a sinusoid."""
    time = np.arange(4000) / RATE
    position = np.sin(2.0 * np.pi * frequency * time)[:, None]
    position = position + noise * np.random.default_rng(seed).normal(size=position.shape)
    return Recording(channels=("a",), dofs=("a",), time=time, position=position, torque=position)


@settings(max_examples=20, deadline=None)
@given(st.floats(1.0, 5.0), st.integers(0, 100))
def test_light_noise_has_no_say(frequency, seed):
    clean, noisy = (choose_band([recording(noise, frequency, seed)]) for noise in (0.0, 1e-5))
    assert noisy.noise_limit == np.inf
    assert noisy.cutoff == pytest.approx(clean.cutoff, rel=0.1)
    assert noisy.smoothing == pytest.approx(2.0 * noisy.cutoff)


@settings(max_examples=20, deadline=None)
@given(st.floats(1.0, 5.0), st.integers(0, 100))
def test_heavier_noise_never_widens_the_band_but_leaves_the_motion(frequency, seed):
    bands = [choose_band([recording(noise, frequency, seed)]) for noise in (1e-4, 1e-3, 1e-2, 3e-2)]
    assert all(wide.cutoff >= 0.9 * narrow.cutoff for wide, narrow in pairwise(bands))
    assert bands[-1].cutoff < 0.7 * bands[0].cutoff
    assert all(band.smoothing <= 2.0 * band.cutoff and band.cutoff > 1.2 * frequency for band in bands)


def test_a_given_cut_off_stays_and_positions_are_smoothed_below_their_noise():
    noisy = recording(1e-2, 3.0)
    band = choose_band([noisy], 30.0)
    assert band.cutoff == 30.0
    assert band.smoothing == pytest.approx(cutoff_of(noisy.spectrum, 60.0))
    assert band.smoothing < 30.0


def test_one_noisy_recording_among_three_has_no_majority():
    quiet, loud = recording(1e-5, 3.0), recording(1e-2, 3.0)
    assert choose_band([quiet, loud, quiet]).noise_limit == np.inf
    assert choose_band([loud, quiet, loud]).noise_limit < np.inf


@pytest.mark.parametrize(("noise", "kept"), [(1e-6, len(DISPLACEMENTS)), (1e-2, 4), (0.1, 2)])
def test_elements_of_friction_before_sliding_that_are_narrower_than_the_noise_are_left_out(noise, kept):
    robot = Robot.from_file(find_model("two_link.urdf"))
    time = np.arange(2000) / RATE
    position = np.sin(2.0 * np.pi * np.array([0.5, 0.7]) * time[:, None])
    position = position + noise * np.random.default_rng(0).normal(size=position.shape)
    log = Recording(channels=robot.channels, dofs=robot.dofs, time=time, position=position, torque=position)
    passes = Passes(robot, [log], choose_band([log]))
    left = smoothed_noise(passes.band.smoothing, RATE, 0)
    assert passes.noise == pytest.approx(left * noise, rel=0.2)
    (slip,) = (kind for kind in usual_friction(passes, Settings()) if kind.kind == MaxwellSlip.kind)
    for dof, name in enumerate(robot.dofs):
        assert min(slip.displacements[name]) > CLEAR_OF_NOISE * passes.noise[dof]
        assert len(slip.displacements[name]) == kept

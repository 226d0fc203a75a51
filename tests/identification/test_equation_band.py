"""Equations reach higher than the cut-off where parameters scatter less then, and only where noise is taken out."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from casysid.dynamics import DEFAULT_FRICTION, Coulomb, build_regressor
from casysid.estimation import ErrorsInVariables, Ridge
from casysid.identification import CutoffChoice, Settings, identify
from casysid.identification.equation_band import choose_equation_band
from casysid.identification.problem import USUAL_WIDTH
from casysid.recording import Recording
from casysid.simulation import Mechanics, design_sinusoids
from casysid.validation import hidden_truth
from tests.simulated import bundled_robot

RATE = 420.0
CHOICE = CutoffChoice(6.0, np.array([6.0]), np.array([0.1]), 1.9, "least error")
EIV = Settings(method=ErrorsInVariables(), ends=False, threads=1)


def simulated(torque_noise):
    """A log whose torque has the given noise, shape (N, nv), in units of its standard deviation."""
    robot = bundled_robot("two_link.urdf")
    sharp = tuple(dataclasses.replace(c, width=1e-3) if isinstance(c, Coulomb) else c for c in DEFAULT_FRICTION)
    regressor = build_regressor(robot, friction=sharp)
    time = np.arange(0.0, 20.0, 1 / RATE)
    motion = design_sinusoids(robot, duration=20.0, seed=0, band=(0.1, 2.0)).sample(time)
    tau = regressor.predict(hidden_truth(robot, Mechanics(), 0), motion.q, motion.v, motion.a)
    rng = np.random.default_rng(0)
    recording = Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=time,
        position=motion.channels + 1e-5 * rng.normal(size=motion.channels.shape),
        torque=tau + tau.std(axis=0) * torque_noise(rng.normal(size=tau.shape)),
    )
    return robot, recording


def white(noise):
    return 0.03 * noise


def vibration(noise):
    """Far more of it above 20 Hz than below."""
    return white(noise) + 10.0 * sosfiltfilt(butter(4, 20.0, "high", fs=RATE, output="sos"), noise, axis=0)


@pytest.mark.parametrize(("noise", "wider"), [(white, True), (vibration, False)])
def test_white_noise_of_the_torque_widens_the_band_and_vibrations_do_not(noise, wider):
    robot, recording = simulated(noise)
    chosen = choose_equation_band(robot, [recording], CHOICE, EIV, USUAL_WIDTH, False)
    assert chosen.cutoff == CHOICE.cutoff
    assert (chosen.fitted > 6.0 * CHOICE.cutoff) is wider


@pytest.mark.parametrize("settings", [dataclasses.replace(EIV, cutoff=6.0), Settings(method=Ridge(), ends=False)])
def test_given_cut_offs_and_other_methods_keep_theirs(settings):
    robot, recording = simulated(white)
    assert choose_equation_band(robot, [recording], CHOICE, settings, USUAL_WIDTH, False) is CHOICE


def test_torque_is_judged_below_the_cut_off_whatever_the_equations_band():
    robot, recording = simulated(white)
    result = identify(robot, recording, dataclasses.replace(EIV, choose_friction=False))
    assert result.cutoff.fitted > result.cutoff.cutoff
    assert result.train.relative < 0.5 * result.train.relative_unfiltered
    assert "scatter least" in result.cutoff.reason

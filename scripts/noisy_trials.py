"""Simulated recordings with noisy encoders and torque sensors, whose truth is known.

The machine is not what its file says (:func:`casysid.validation.hidden_truth`). It moves along random sinusoids; its
torques are those of its own parameters at the true motion, plus noise. A second motion is held out, without noise.
"""

from __future__ import annotations

import dataclasses
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.bundled import find_model
from casysid.dynamics import DEFAULT_FRICTION, Coulomb, Regressor, build_regressor, with_width
from casysid.estimation import WeightedLeastSquares
from casysid.identification import IdentificationResult, Settings, choose_band
from casysid.identification.noise_moments import with_noise
from casysid.identification.passes import Passes
from casysid.moments import Moments
from casysid.projection import build_projection, constrained_least_squares
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import BandAverage, NoiseLevels, motion_from_recording
from casysid.simulation import Mechanics, Reference, design_sinusoids
from casysid.validation.perturbation import hidden_truth

RATE = 420.0
TORQUE_NOISE = 0.03
TRUE_WIDTH = 1e-3
"""Of the true Coulomb friction's change of sign [rad/s]."""
RIVAL_RATIOS = 1.25 * 1.35 ** np.arange(9)
"""Cut-offs of the rival over the highest frequency of the motion: 1.25 to 13.8."""
HIGHEST_SHARE = 0.45
"""Highest cut-off of the rival's smoothing over the rate."""
RIVAL_WIDTH = 3e-4
RIVAL_WIDTH_IN_NOISE = 2.0
"""The rival's Coulomb friction changes sign within so many standard deviations of its velocities' noise, or within the
share above of their root mean square where that is more."""
RIVAL_SMOOTHING = 2.0
"""Cut-off of the rival's positions over its equations'."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A noisy recording, and a motion never fitted.

    Attributes:
        robot: With the file's parameters.
        truth: The machine's, shape (p,).
        regressor: Of the true torques.
        recording: What is logged.
        clean: The motion of ``recording`` without noise.
        unseen: The held-out motion.
        torque: Its true torque, shape (N, nv).
    """

    robot: Robot
    truth: Array
    regressor: Regressor
    recording: Recording
    clean: Reference
    unseen: Reference
    torque: Array

    def error(self, parameters: Array, regressor: Regressor | None = None) -> float:
        """Torque error of parameters on the held-out motion, against the truth, over the size of its changes."""
        predicted = (regressor or self.regressor).predict(parameters, self.unseen.q, self.unseen.v, self.unseen.a)
        return float(np.linalg.norm(predicted - self.torque) / np.linalg.norm(self.torque - self.torque.mean(axis=0)))

    def error_of(self, result: IdentificationResult) -> float:
        """The same of an identification; friction of the true kinds is judged with the true change of sign."""
        found = result.regressor
        if result.friction.chosen:
            return self.error(result.parameters, found)
        regressor = build_regressor(
            found.robot,
            friction=with_width(found.friction, TRUE_WIDTH),
            couplings=found.couplings,
            quasi_static=result.choices.clock.quasi_static,
            torque_gains=result.choices.settings.torque_gains,
        )
        return self.error(result.parameters, regressor)


def load_robot(name: str) -> Robot:
    """A bundled model by name, else a file."""
    return Robot.from_file(Path(name) if "/" in name else find_model(name))


def make_trial(
    name: str, seed: int, noise: float, highest: float, *, duration: float = 20.0, delay: float = 0.0
) -> Trial:
    """A trial.

    Args:
        name: Bundled model, or path of a file.
        seed: Of machine, motions and noise.
        noise: Standard deviation of the encoders' [rad, m].
        highest: Frequency of the motion [Hz].
        duration: [s].
        delay: By how much the torques are logged late [s].
    """
    robot = load_robot(name)
    regressor = build_regressor(robot, friction=with_width(DEFAULT_FRICTION, TRUE_WIDTH))
    truth = hidden_truth(robot, Mechanics(), seed)
    time = np.arange(int(duration * RATE)) / RATE
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # weight beyond effort limits does not matter here
        fitted, other = (
            design_sinusoids(robot, duration=duration, seed=2 * seed + k, band=(0.1, highest)) for k in range(2)
        )
    clean, earlier, unseen = fitted.sample(time), fitted.sample(time - delay), other.sample(time)
    torque, true_torque = (regressor.predict(truth, motion.q, motion.v, motion.a) for motion in (earlier, unseen))
    rng = np.random.default_rng([seed, 1])
    recording = Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=time,
        position=clean.channels + noise * rng.normal(size=clean.channels.shape),
        torque=torque + TORQUE_NOISE * torque.std(axis=0) * rng.normal(size=torque.shape),
    )
    return Trial(robot, truth, regressor, recording, clean, unseen, true_torque)


def unordered_trial(
    name: str, seed: int, noise: float, share: float, *, samples: int = 40_000
) -> tuple[Trial, NoiseLevels]:
    """A trial whose positions, velocities and accelerations were all logged with noise, in random order.

    Args:
        name: Bundled model, or path of a file.
        seed: Of machine, motions, noise and order.
        noise: Standard deviation of the positions' [rad, m].
        share: Standard deviation of velocities' and accelerations', as a share of each joint's range of them.
        samples: How many.

    Returns:
        The trial, and the noise levels.
    """
    trial = make_trial(name, seed, 0.0, 2.0, duration=samples / RATE)
    rng, clean = np.random.default_rng([seed, 2]), trial.clean
    levels = NoiseLevels(
        position=noise,
        velocity=tuple((share * np.ptp(clean.v, axis=0)).tolist()),
        acceleration=tuple((share * np.ptp(clean.a, axis=0)).tolist()),
    )
    order = rng.permutation(len(clean.v))
    measured = {
        field: (values + std * rng.normal(size=values.shape))[order]
        for field, values, std in (
            ("position", clean.channels, levels.position),
            ("velocity", clean.v, levels.velocity),
            ("acceleration", clean.a, levels.acceleration),
        )
    }
    recording = dataclasses.replace(trial.recording, time=None, torque=trial.recording.torque[order], **measured)
    return dataclasses.replace(trial, recording=recording), levels


def denoised_problem(trial: Trial, cutoff: float | None, settings: Settings) -> tuple[Regressor, Moments]:
    """The usual model and its moments as `identify` takes them, with what noise has added to them.

    Args:
        trial: Whose recording is summed.
        cutoff: Of the equations [Hz]; None where samples have no time.
        settings: What is known of the noise, blocks and threads.
    """
    band = choose_band([trial.recording], cutoff)
    passes = Passes(trial.robot, [trial.recording], band, blocks=settings.blocks, threads=settings.threads)
    friction = with_width(DEFAULT_FRICTION, tuple(passes.width.tolist()))
    regressor = build_regressor(trial.robot, friction=friction)
    moments, _ = with_noise(passes.moments(regressor), regressor, passes, settings.input_noise)
    return regressor, moments


def rival_moments(trial: Trial, cutoff: float) -> tuple[Regressor, Moments]:
    """The recording smoothed at a cut-off [Hz], its ends and stands left out, without knowledge of the noise."""
    motion = motion_from_recording(trial.robot, trial.recording, RIVAL_SMOOTHING * cutoff)
    speed = np.sqrt(np.mean(motion.v**2, axis=0))
    width = np.maximum(RIVAL_WIDTH_IN_NOISE * motion.velocity_noise, RIVAL_WIDTH * speed)
    motion = motion.without_ends()
    moving = ~motion.standing | motion.standing.all(axis=0)  # noise that hides all motion is no stand
    friction = tuple(
        Coulomb(tuple(width.tolist())) if isinstance(column, Coulomb) else column for column in DEFAULT_FRICTION
    )
    regressor = build_regressor(trial.robot, friction=friction)
    state = motion.q, motion.v, motion.a, motion.tau
    average = BandAverage(motion.time, cutoff)
    return regressor, accumulate_moments(regressor, *state, average=average, valid=moving, threads=1)


def consistent_least_squares(regressor: Regressor, moments: Moments) -> Array:
    """Re-weighted least squares, made physically consistent."""
    weights = WeightedLeastSquares().estimate(moments, regressor.prior).noise_std ** -2.0
    problem = build_projection(regressor.parameters)
    return constrained_least_squares(problem, moments.pooled(weights), regressor.prior).parameters


def best_rival(trial: Trial, highest: float) -> tuple[float, float]:
    """Smallest error of consistent least squares over the cut-offs, and that cut-off [Hz]."""
    found = []
    for cutoff in highest * RIVAL_RATIOS:
        if RIVAL_SMOOTHING * cutoff < HIGHEST_SHARE * RATE:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found.append((trial.error(consistent_least_squares(*rival_moments(trial, cutoff))), float(cutoff)))
    return min(found)

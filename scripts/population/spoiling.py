"""Experiments whose log is spoilt as logs are: what is fitted to them is useless, and must not be accepted.

Kinds (:data:`KINDS`): columns of positions and torques permuted; columns of torques permuted; a third of the torques
replaced by noise of the same spectrum; all of them; gravity taken out of the torques; the file's gravity along another
direction; torques in other units, each by its own factor, log-uniform 0.02-50.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from casysid.dynamics import build_regressor
from casysid.recording import Recording
from casysid.robot import Robot
from population.drawing import log_uniform
from population.experiments import Experiment

KINDS = ("permuted", "torques permuted", "some random", "all random", "compensated", "tilted", "current")
EARTH = 9.81


def spoilt(experiment: Experiment, kind: str) -> tuple[Robot, Recording]:
    """The file and the log, spoilt."""
    rng, log, file = np.random.default_rng([experiment.seed, 77]), experiment.recording, experiment.file
    position, torque, joints = log.position.copy(), log.torque.copy(), log.torque.shape[1]
    match kind:
        case "permuted" | "torques permuted":
            order = _derangement(rng, joints)
            torque = torque[:, order]
            position = position[:, order] if kind == "permuted" else position
        case "some random" | "all random":
            count = joints if kind == "all random" else max(1, joints // 3)
            for joint in rng.choice(joints, count, replace=False):
                torque[:, joint] = noise_like(rng, torque[:, joint])
        case "compensated":
            torque = torque - _gravity(experiment) * experiment.faults.scale
        case "tilted":
            direction = rng.normal(size=3)
            file = file.with_gravity(EARTH * direction / np.linalg.norm(direction))
        case "current":
            torque = torque * log_uniform(rng, 0.02, 50.0, joints)
    return file, dataclasses.replace(log, position=position, torque=torque)


def noise_like(rng: np.random.Generator, signal: np.ndarray) -> np.ndarray:
    """Noise of a signal's mean and spectrum, shape (N,)."""
    spectrum = np.abs(np.fft.rfft(signal))
    phase = rng.uniform(0.0, 2.0 * np.pi, len(spectrum))
    phase[0] = 0.0 if signal.mean() >= 0.0 else np.pi
    return np.fft.irfft(spectrum * np.exp(1j * phase), len(signal))


def _derangement(rng: np.random.Generator, joints: int) -> np.ndarray:
    order = np.arange(joints)
    while joints > 1 and (order == np.arange(joints)).all():
        order = rng.permutation(joints)
    return order


def _gravity(experiment: Experiment) -> np.ndarray:
    """What holds the true bodies, shape (N, nv)."""
    q = experiment.logged.motion.at(experiment.sampling.actual).q
    regressor = build_regressor(experiment.mechanism.robot, ())
    return regressor.predict(regressor.prior, q, np.zeros_like(q), np.zeros_like(q))

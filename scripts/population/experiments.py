"""One random experiment: a machine, its log, the file that describes it, and a fresh motion to be judged by.

Motion, sampling, drives and sensors are drawn again, up to :data:`ATTEMPTS` times, while the log says too little: where
least squares with the true columns at the true motion would expect to miss the fresh torque by more than 10 % because
of the torque's noise alone. What such a log cannot show, nobody can be judged by.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from casysid.recording import Recording
from casysid.robot import Robot
from population.drawing import chance
from population.drives import Truth, draw_truth
from population.families import Family, draw_family
from population.files import draw_file, with_friction
from population.mechanisms import Mechanism, draw_mechanism
from population.motions import Motion, State
from population.sensors import (
    Faults,
    Logged,
    Sampling,
    draw_faults,
    draw_sampling,
    draw_sensors,
    even_sampling,
    no_faults,
    record,
    true_torque,
    white_noise_only,
)

FRESH_RATE, FRESH_DURATION = 250.0, (10.0, 20.0)
"""Of the motion that is judged [Hz], [s]."""
ATTEMPTS, POOREST = 12, 0.1
ROWS, UNSEEN = 1500, 1e-11
"""Rows by which logs are judged; share of the largest eigenvalue below which the log says nothing."""
FRICTIONLESS_DURATION, FRICTIONLESS_RATE = 10.0, 100.0


@dataclass(frozen=True, eq=False)
class Experiment:
    """All that is known of one seed.

    Attributes:
        seed: From which all of it follows.
        mechanism: With true inertial parameters.
        file: The robot as its file has it.
        file_error: Kind of error in the file.
        truth: The machine.
        family: Of the motions.
        logged: How the log came about.
        recording: The log.
        fresh: A motion that is not fitted, every 4 ms.
        fresh_torque: Its torque without noise or delay, in the log's units, gains and signs, shape (N, nv).
    """

    seed: int
    mechanism: Mechanism
    file: Robot
    file_error: str
    truth: Truth
    family: Family
    logged: Logged
    recording: Recording
    fresh: State
    fresh_torque: np.ndarray

    @property
    def sampling(self) -> Sampling:
        """Of the log."""
        return self.logged.sampling

    @property
    def faults(self) -> Faults:
        """Of the log."""
        return self.logged.faults


def draw_experiment(seed: int) -> Experiment:
    """The experiment of a seed; distributions are in the modules' texts."""
    mechanism = draw_mechanism(_stream(seed, 0))
    file, error = draw_file(_stream(seed, 1), mechanism.robot)
    faults = draw_faults(_stream(seed, 9), mechanism.robot.nv)
    for attempt in range(ATTEMPTS):
        stream = partial(_stream, seed, attempt=attempt)
        sampling = draw_sampling(stream(2), mechanism.robot.nv)
        family = draw_family(stream(3), mechanism, file)
        motion = family.draw(stream(4), sampling.duration)
        truth = draw_truth(stream(5), mechanism, motion.at(sampling.actual))
        sensors = draw_sensors(stream(8), mechanism)
        logged = Logged(motion, sampling, sensors, faults)
        time, unseen = _fresh(seed, family, sampling)
        if expected_error(truth, logged, unseen.at(time)) < POOREST:
            break
    if error != "placeholder" and chance(_stream(seed, 6), 0.5):
        file = with_friction(_stream(seed, 7), file, truth)
    return _experiment(seed, mechanism, (file, error), truth, family, logged)


def draw_frictionless(seed: int, noise: float) -> Experiment:
    """Fourier motion of a robot without friction or rotors, 10 s at 100 Hz, with white torque noise and 20 bits."""
    mechanism = draw_mechanism(_stream(seed, 0))
    robot = mechanism.robot.with_parameters(armature=np.zeros(mechanism.robot.nv))
    mechanism = Mechanism(robot, mechanism.limits, mechanism.shape)
    file = draw_file(_stream(seed, 1), robot, "perturbed")
    family = draw_family(_stream(seed, 3), mechanism, file[0], "fourier")
    sampling = even_sampling(FRICTIONLESS_DURATION, FRICTIONLESS_RATE)
    motion = family.draw(_stream(seed, 4), sampling.duration)
    truth = draw_truth(_stream(seed, 5), mechanism, motion.at(sampling.actual), friction=False)
    logged = Logged(motion, sampling, white_noise_only(mechanism, noise), no_faults(robot.nv))
    return _experiment(seed, mechanism, file, truth, family, logged)


def expected_error(truth: Truth, logged: Logged, fresh: State) -> float:
    """Relative torque error on a fresh motion of least squares at the true motion, by the torque's noise alone."""
    every = max(len(logged.sampling.actual) // ROWS, 1)
    state = logged.motion.at(logged.sampling.actual[::every])
    A, torque = truth.regressor(state), truth.torque(state)
    noise = logged.sensors.effective_noise(logged.sampling) * np.maximum(np.sqrt(np.mean(torque**2, axis=0)), 1e-9)
    few = State(*(part[:: max(len(fresh.q) // ROWS, 1)] for part in fresh))
    F = truth.regressor(few)
    size = np.sqrt(np.mean(A**2, axis=(0, 1)) + np.mean(F**2, axis=(0, 1)))
    A, F = A / np.where(size > 0.0, size, 1.0) / noise[:, None], F / np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(np.einsum("njp,njq->pq", A, A, optimize=True) * every)
    along = F @ vectors / np.sqrt(np.maximum(values, UNSEEN * values[-1]))
    return float(np.linalg.norm(along) / np.linalg.norm(truth.torque(few)))


def _fresh(seed: int, family: Family, sampling: Sampling) -> tuple[np.ndarray, Motion]:
    """Times and a motion that is not fitted."""
    length = float(np.clip(sampling.duration, *FRESH_DURATION))
    return np.arange(int(length * FRESH_RATE)) / FRESH_RATE, family.draw_fresh(_stream(seed, 11), length)


def _experiment(
    seed: int, mechanism: Mechanism, file: tuple[Robot, str], truth: Truth, family: Family, logged: Logged
) -> Experiment:
    recording = record(_stream(seed, 10), mechanism.robot, truth, logged)
    time, unseen = _fresh(seed, family, logged.sampling)
    torque = true_torque(truth, unseen, time) * logged.faults.scale
    return Experiment(
        seed=seed,
        mechanism=mechanism,
        file=file[0],
        file_error=file[1],
        truth=truth,
        family=family,
        logged=logged,
        recording=recording,
        fresh=unseen.at(time),
        fresh_torque=torque,
    )


def _stream(seed: int, part: int, *, attempt: int = 0) -> np.random.Generator:
    return np.random.default_rng([seed, part, attempt])

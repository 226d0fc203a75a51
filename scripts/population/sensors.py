"""How a motion and its torques are logged.

Sampling: log-uniform 30-2000 Hz; 4 in 10 with jitter of log-uniform 1-20 % of a period (seven in ten of the samples
themselves, stamps being right; three in ten of the stamps alone); a quarter with 1-3 gaps of log-uniform 0.01-2 s; 15 %
with 0.5-10 % of the rows repeating the one before. Duration log-uniform 5-120 s.

Sensors: encoders of 12-20 bits a turn, or of steps log-uniform 1-100 µm for prismatic joints; torque noise white,
log-uniform 0.1-10 % of the joint's torque rms, and for half of the logs coloured as well, log-uniform 0.1-5 %, with a
memory of log-uniform 0.02-1 s.

Faults, one in ten each, independent: stamps that run slow or fast by log-uniform 1.5-20; torques logged 1-30 ms late
(seven in ten all joints alike, otherwise each by its own); gains of 0.7-1.4 by joint; one joint's torque negated.

Rows are bounded, for the sake of CPU: rows × joints² at most :data:`MOST_VALUES` and at most :data:`MOST_ROWS` rows.
Where more were drawn, the duration is cut, but not below 10 s and 4 s a joint; then the rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from casysid.recording import Recording
from casysid.robot import Robot
from population.drawing import chance, log_uniform
from population.drives import Truth
from population.mechanisms import Mechanism
from population.motions import Motion

MOST_VALUES, MOST_ROWS, SHORTEST, SHORTEST_BY_JOINT = 4e5, 4e4, 10.0, 4.0
FINEST = 4e-3
"""Friction with memory is followed in steps of at most this [s]."""
CLOSEST = 0.4
"""Jitter moves a stamp by less than this share of a period, so that time increases."""
FAULT = 0.1


@dataclass(frozen=True, eq=False)
class Sampling:
    """When rows are logged.

    Attributes:
        duration: [s].
        rate: [Hz].
        actual: Times at which the rows were measured, shape (N,), [s].
        stamps: What the log says, of a right clock, shape (N,), [s].
        repeated: Rows that hold what the row before does, shape (N,).
        traits: Of jitter, gaps, repeats, those that are there.
    """

    duration: float
    rate: float
    actual: np.ndarray
    stamps: np.ndarray
    repeated: np.ndarray
    traits: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Faults:
    """What is wrong with a log as a whole.

    Attributes:
        clock: Stamps over true time.
        delay: By how much torques are logged late, shape (nv,), [s].
        gains: Logged over true torque, positive, shape (nv,).
        signs: -1 where the torque is negated, shape (nv,).
    """

    clock: float
    delay: np.ndarray
    gains: np.ndarray
    signs: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """Those that are there."""
        there = {
            "clock": self.clock != 1.0,
            "delay": self.delay.any(),
            "gains": (self.gains != 1.0).any(),
            "sign": (self.signs < 0.0).any(),
        }
        return tuple(name for name, found in there.items() if found)

    @property
    def scale(self) -> np.ndarray:
        """Logged over true torque, shape (nv,)."""
        return self.gains * self.signs


@dataclass(frozen=True, eq=False)
class Sensors:
    """Resolution of positions and size of torque noise, shape (nv,) each; noise as shares of the torque's rms."""

    resolution: np.ndarray
    white: np.ndarray
    coloured: np.ndarray
    memory: float

    def effective_noise(self, sampling: Sampling) -> np.ndarray:
        """Share of the torque's rms that white noise would need to hide as much, shape (nv,)."""
        samples = 2.0 * self.memory * sampling.rate
        return np.sqrt(self.white**2 + self.coloured**2 * np.clip(samples, 1.0, len(sampling.actual)))


@dataclass(frozen=True, eq=False)
class Logged:
    """How a log comes about.

    Attributes:
        motion: That is logged.
        sampling: When.
        sensors: By what.
        faults: And what went wrong.
    """

    motion: Motion
    sampling: Sampling
    sensors: Sensors
    faults: Faults


def bounded(duration: float, rate: float, joints: int) -> tuple[float, float]:
    """Duration [s] and rate [Hz] that keep the bound on rows."""
    rows = min(MOST_VALUES / joints**2, MOST_ROWS)
    duration = min(duration, max(rows / rate, SHORTEST + SHORTEST_BY_JOINT * joints))
    return duration, min(rate, rows / duration)


def draw_sampling(rng: np.random.Generator, joints: int) -> Sampling:
    """See the module's text."""
    drawn = float(log_uniform(rng, 5.0, 120.0)), float(log_uniform(rng, 30.0, 2000.0))
    duration, rate = bounded(*drawn, joints)
    time = np.arange(int(duration * rate)) / rate
    actual, stamps, traits = time.copy(), time.copy(), []
    if chance(rng, 0.4):
        traits.append("jitter")
        shift = log_uniform(rng, 0.01, 0.2) * rng.standard_normal(len(time))
        shifted = time + np.clip(shift, -CLOSEST, CLOSEST) / rate
        stamps = shifted
        actual = shifted if chance(rng, 0.7) else time
    keep = np.ones(len(time), dtype=bool)
    if chance(rng, 0.25):
        traits.append("gaps")
        for _ in range(rng.integers(1, 4)):
            begin, length = rng.uniform(0.1, 0.9) * duration, float(log_uniform(rng, 0.01, 2.0))
            keep &= (time < begin) | (time > begin + length)
    repeated = np.zeros(len(time), dtype=bool)
    if chance(rng, 0.15):
        traits.append("repeats")
        repeated = rng.random(len(time)) < log_uniform(rng, 0.005, 0.1)
    repeated = repeated[keep]
    repeated[0] = False
    return Sampling(duration, rate, actual[keep], stamps[keep], repeated, tuple(traits))


def draw_sensors(rng: np.random.Generator, mechanism: Mechanism) -> Sensors:
    """See the module's text."""
    joints, sliding = mechanism.robot.nv, mechanism.sliding
    turn = 2.0 * np.pi / 2.0 ** rng.integers(12, 21, joints)
    white = log_uniform(rng, 1e-3, 0.1) * log_uniform(rng, 0.7, 1.4, joints)
    coloured = log_uniform(rng, 1e-3, 0.05) * np.ones(joints) if chance(rng, 0.5) else np.zeros(joints)
    return Sensors(
        np.where(sliding, log_uniform(rng, 1e-6, 1e-4, joints), turn),
        white,
        coloured,
        float(log_uniform(rng, 0.02, 1.0)),
    )


def even_sampling(duration: float, rate: float) -> Sampling:
    """Without jitter, gaps and repeats."""
    time = np.arange(int(duration * rate)) / rate
    return Sampling(duration, rate, time, time, np.zeros(len(time), dtype=bool), ())


def white_noise_only(mechanism: Mechanism, share: float) -> Sensors:
    """Encoders of 20 bits or 1 µm, and white torque noise of a share of the torque's rms."""
    one = np.ones(mechanism.robot.nv)
    return Sensors(np.where(mechanism.sliding, 1e-6, 2.0 * np.pi / 2**20), share * one, 0.0 * one, 1.0)


def draw_faults(rng: np.random.Generator, joints: int) -> Faults:
    """See the module's text."""
    clock, delay, gains, sign = (chance(rng, FAULT) for _ in range(4))
    factor = float(log_uniform(rng, 1.5, 20.0)) ** float(rng.choice([-1.0, 1.0]))
    late = rng.uniform(1e-3, 30e-3, joints)
    late = np.full(joints, late[0]) if chance(rng, 0.7) else late
    by_joint, negated = rng.uniform(0.7, 1.4, joints), int(rng.integers(joints))
    return Faults(
        factor if clock else 1.0,
        late if delay else np.zeros(joints),
        by_joint if gains else np.ones(joints),
        np.where((np.arange(joints) == negated) & sign, -1.0, 1.0),
    )


def no_faults(joints: int) -> Faults:
    """A log that is right."""
    return Faults(1.0, np.zeros(joints), np.ones(joints), np.ones(joints))


def true_torque(truth: Truth, motion: Motion, time: np.ndarray) -> np.ndarray:
    """The machine's torque at increasing times (N,), shape (N, nv); memory is followed in between where needed."""
    finer = 1
    if len(time) > 1 and any(term.kind == "hysteresis" for term in truth.terms):
        finer = int(np.ceil(np.median(np.diff(time)) / FINEST))
    places = np.arange((len(time) - 1) * finer + 1) / finer
    return truth.torque(motion.at(np.interp(places, np.arange(len(time)), time)))[::finer]


def record(rng: np.random.Generator, robot: Robot, truth: Truth, logged: Logged) -> Recording:
    """The log of a motion."""
    motion, sampling, sensors, faults = logged.motion, logged.sampling, logged.sensors, logged.faults
    time, torque = sampling.actual, np.empty((len(sampling.actual), robot.nv))
    for delay in np.unique(faults.delay):
        late = faults.delay == delay
        torque[:, late] = true_torque(truth, motion, time - delay)[:, late]
    rms = np.sqrt(np.mean(torque**2, axis=0))
    rms = np.maximum(rms, 1e-3 * rms.max())
    noise = sensors.white * rng.standard_normal(torque.shape)
    noise += sensors.coloured * coloured_noise(rng, torque.shape, sampling.rate * sensors.memory)
    position = np.round(motion.at(time).q / sensors.resolution) * sensors.resolution
    source = np.maximum.accumulate(np.where(sampling.repeated, 0, np.arange(len(time))))
    return Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=sampling.stamps * faults.clock,
        position=position[source],
        torque=((torque + rms * noise) * faults.scale)[source],
    )


def coloured_noise(rng: np.random.Generator, shape: tuple[int, ...], memory: float) -> np.ndarray:
    """Stationary noise of variance one that forgets within ``memory`` samples, shape (N, joints)."""
    keep = np.exp(-1.0 / memory)
    drive = np.sqrt(1.0 - keep**2) * rng.standard_normal(shape)
    drive[0] /= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))

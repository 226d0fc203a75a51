"""What the sensors say of what happens: late, at uncertain instants, noisy, in steps.

The controller gets its readings while the simulation runs; torques are read when it is over. Each source of noise has a
random stream of its own, so that switching one off leaves the others as they were.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.simulation.coordinates import Coordinates
from casysid.simulation.settings import Sensing


@dataclass(frozen=True, eq=False)
class History:
    """What has happened so far: arrays that the simulation fills row by row, in the plant's coordinates.

    Attributes:
        channels: Shape (N, channels).
        rates: Shape (N, nv).
        change: Derivative of the rates, shape (N, nv).
    """

    channels: Array
    rates: Array
    change: Array

    @classmethod
    def empty(cls, samples: int, coordinates: Coordinates) -> History:
        """Room for so many samples."""
        robot = coordinates.robot
        return cls(np.empty((samples, len(robot.channels))), *np.empty((2, samples, robot.nv)))


class StateSensors:
    """Positions, and velocities derived from them, of a run at a fixed period. Readings must be taken in order."""

    def __init__(
        self, coordinates: Coordinates, sensing: Sensing, history: History, period: float, seed: np.random.SeedSequence
    ) -> None:
        """Draw all the noise of the run; ``period`` in seconds."""
        samples, nv = history.rates.shape
        jitter, noise = (np.random.default_rng(child) for child in seed.spawn(2))
        self._coordinates, self._sensing, self._history, self._period = coordinates, sensing, history, period
        self._late = np.asarray(sensing.position_delay - sensing.sample_jitter * jitter.standard_normal(samples))
        self._noise = np.asarray(sensing.position_noise * noise.standard_normal((samples, nv)))
        self._exact = not (self._late.any() or self._noise.any() or sensing.position_resolution)
        cutoff = sensing.velocity_cutoff
        self._gain = 0.0 if cutoff is None else 1.0 - math.exp(-2.0 * math.pi * cutoff * period)
        self._rates = history.rates[0].copy()
        self.channels = np.empty_like(history.channels)
        self.rates = np.empty_like(history.rates)

    @property
    def instants(self) -> Array:
        """How much later than logged each sample was really taken, shape (N,), [s]: jitter less delay."""
        return -self._late

    def read(self, k: int) -> tuple[Array, Array]:
        """Channels (channels,) and rates (nv,) at tick ``k``, when the history is filled up to and with ``k``."""
        self.channels[k] = channels = self._history.channels[k] if self._exact else self._position(k)
        if self._sensing.velocity_cutoff is None:
            self.rates[k] = self._history.rates[k]
        else:
            if k:
                difference = self._coordinates.displacement(self.channels[k - 1], channels) / self._period
                self._rates += self._gain * (difference - self._rates)
            self.rates[k] = self._rates
        return channels, self.rates[k]

    def _position(self, k: int) -> Array:
        """The true position at the instant of reading, by a Taylor step from the tick before; then noise and steps."""
        history, late, period = self._history, self._late[k], self._period
        origin = max(k - max(math.ceil(late / period), 0), 0)
        u = (k - origin) * period - late
        if origin == k:  # taken a little after the tick, or before the start
            step = history.rates[k] * max(u, 0.0)
        else:  # the third derivative is what the velocity at the next tick leaves over
            change = history.change[origin]
            jerk = ((history.rates[origin + 1] - history.rates[origin]) / period - change) * (2.0 / period)
            step = u * (history.rates[origin] + u / 2.0 * (change + u / 3.0 * jerk))
        channels = self._coordinates.moved(history.channels[origin], step + self._noise[k])
        resolution, at = self._sensing.position_resolution, self._coordinates.additive[0]
        if resolution:
            channels[at] = np.round(channels[at] / resolution) * resolution
        return channels


def read_torques(
    torque: Array, instants: Array, scale: Array, sensing: Sensing, period: float, seed: np.random.SeedSequence
) -> Array:
    """The logged torques, shape (N, nv).

    Args:
        torque: What the actuators did, or were asked for, at every tick, shape (N, nv).
        instants: Jitter of the samples, shape (N,), [s].
        scale: Torque scale, shape (nv,).
        sensing: Delay, noise, resolution.
        period: [s].
        seed: For the noise.
    """
    samples = len(torque)
    if sensing.torque_delay or instants.any():
        ticks = np.arange(samples)
        at = np.clip(ticks + (instants - sensing.torque_delay) / period, 0, samples - 1)
        before = np.minimum(at.astype(int), samples - 2) if samples > 1 else np.zeros(1, dtype=int)
        share = (at - before)[:, None]
        torque = (1.0 - share) * torque[before] + share * torque[np.minimum(before + 1, samples - 1)]
    reading = torque + sensing.torque_noise * scale * np.random.default_rng(seed).standard_normal(torque.shape)
    if sensing.torque_resolution:
        step = sensing.torque_resolution * scale
        reading = np.round(reading / step) * step
    return np.asarray(reading)

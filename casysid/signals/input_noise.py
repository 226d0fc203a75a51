"""Noise of the measured motion: how much there is by channel, and a recording disturbed by as much again."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.recording import Recording, Source
from casysid.signals.noise import noise_level_error, noise_of
from casysid.threads import single_threaded

BLOCK = 1 << 12
"""Rows whose noise is drawn from one seed."""
GIVEN, SPECTRUM = "given", "spectrum of the positions"

Disturbed = TypeVar("Disturbed", bound=Source)


@dataclass(frozen=True, kw_only=True)
class NoiseLevels:
    """What the user knows of the sensors: standard deviations, one for all or one for each.

    Attributes:
        position: By channel [rad, m]; None finds it in the data where there is time.
        velocity: Of logged velocities by degree of freedom [rad/s, m/s]; used where they are taken as logged.
        acceleration: Of logged accelerations likewise [rad/s², m/s²].
    """

    position: float | tuple[float, ...] | None = None
    velocity: float | tuple[float, ...] | None = None
    acceleration: float | tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            values = getattr(self, field.name)
            if values is not None and not (np.isfinite(values).all() and (np.asarray(values) >= 0.0).all()):
                raise ParameterError(f"{field.name} noise must be finite and not negative; got {values}")


@dataclass(frozen=True, eq=False, kw_only=True)
class InputNoise:
    """Standard deviations of the noise in a recording's motion.

    Attributes:
        position: By channel, shape (channels,), [rad, m].
        velocity: Of logged velocities, shape (nv,); zeros where they are not used.
        acceleration: Of logged accelerations, shape (nv,); zeros where they are not used.
        resolution: Quantisation step of the positions by channel, shape (channels,); 0 where there is none.
        relative_error: Standard error of the variances, as a fraction of them.
        source: How they were found.
    """

    position: Array
    velocity: Array
    acceleration: Array
    resolution: Array
    relative_error: float
    source: str

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "acceleration", "resolution"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def disturb(self, recording: Disturbed, scale: float, seed: int) -> Disturbed:
        """The recording with ``scale`` times this noise added, drawn anew from the seed."""
        return recording.mapped(Disturbance(self, scale, seed))


@dataclass(frozen=True, eq=False)
class Disturbance:
    """Adds noise to consecutive parts of a recording: to a row the same, however the recording is cut into parts.

    Attributes:
        noise: Its standard deviations.
        scale: Times which it is added.
        seed: Of the draws.
    """

    noise: InputNoise
    scale: float
    seed: int

    def __call__(self, recording: Recording, row: int) -> Recording:
        """The part whose first row is number ``row`` of the recording, noisier."""
        changed = {}
        for k, name in enumerate(("position", "velocity", "acceleration")):
            values, std = getattr(recording, name), getattr(self.noise, name)
            if values is not None and std.any():
                changed[name] = values + self.scale * std * self._draws(k, row, values.shape)
        return dataclasses.replace(recording, **changed)

    def _draws(self, quantity: int, row: int, shape: tuple[int, int]) -> Array:
        """Standard normal draws for some rows; those of a block of rows come from one seed of their own."""
        first, last = row // BLOCK, -(-(row + shape[0]) // BLOCK)
        blocks = [
            np.random.default_rng((self.seed, quantity, block)).normal(size=(BLOCK, shape[1]))
            for block in range(first, last)
        ]
        return np.concatenate(blocks)[row - first * BLOCK :][: shape[0]]


@single_threaded()
def find_input_noise(recording: Source, levels: NoiseLevels, *, as_logged: bool) -> InputNoise | None:
    """The noise of a recording's motion as far as given, else as found in its positions; None if neither is possible.

    Args:
        recording: The recording.
        levels: What is given.
        as_logged: Whether positions, velocities and accelerations are taken as they are, instead of differentiating
            smoothed positions.

    Raises:
        ParameterError: As many levels as there are channels or degrees of freedom are wanted, and there are others.
    """
    channels, dofs = len(recording.channels), len(recording.dofs)
    resolution = recording.spectrum.resolution if recording.has_time else np.zeros(channels)
    if as_logged:
        given = (levels.position, levels.velocity, levels.acceleration)
        if not any(np.any(level) for level in given if level is not None):
            return None
        return InputNoise(
            position=_spread(levels.position, channels, "position"),
            velocity=_spread(levels.velocity, dofs, "velocity"),
            acceleration=_spread(levels.acceleration, dofs, "acceleration"),
            resolution=resolution,
            relative_error=0.0,
            source=GIVEN,
        )
    found = levels.position is None
    return InputNoise(
        position=noise_of(recording.spectrum) if found else _spread(levels.position, channels, "position"),
        velocity=np.zeros(dofs),
        acceleration=np.zeros(dofs),
        resolution=resolution,
        relative_error=noise_level_error(len(recording)) if found else 0.0,
        source=SPECTRUM if found else GIVEN,
    )


def _spread(level: float | tuple[float, ...] | None, count: int, name: str) -> Array:
    values = np.zeros(count) if level is None else np.asarray(level, dtype=np.float64)
    if values.ndim and values.shape != (count,):
        raise ParameterError(f"{name} noise: wanted one number or {count}, one for each; got {values.size}")
    return np.broadcast_to(values, count)


def mean_input_noise(parts: tuple[InputNoise | None, ...]) -> InputNoise | None:
    """Root mean square over recordings; None if it is unknown in one."""
    known = [part for part in parts if part is not None]
    if not known or len(known) < len(parts):
        return None
    if len(known) == 1:
        return known[0]
    rms = {
        name: np.sqrt(np.mean([getattr(part, name) ** 2 for part in known], axis=0))
        for name in ("position", "velocity", "acceleration")
    }
    return InputNoise(
        **rms,
        resolution=np.max([part.resolution for part in known], axis=0),
        relative_error=float(np.sqrt(np.mean([part.relative_error**2 for part in known]) / len(known))),
        source=known[0].source,
    )

"""A recording: named, timed samples of a robot, checked once and never changed.

Positions are kept as they were logged, by *channel* (a continuous joint is one angle, a free-flyer seven numbers);
velocities, accelerations and torques by *degree of freedom*. Without time stamps the rows are unordered samples, and
then velocities and accelerations must be there, since nothing can be differentiated.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import CasysidWarning, ParameterError, RecordingError

if TYPE_CHECKING:
    from casysid.robot import Robot

GAP = 5.0
"""A step of time longer than this many median steps is a gap."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Recording:
    """Samples of positions and torques, and whatever of velocity, acceleration and time was logged; read-only.

    Attributes:
        channels: Names of the position channels (``robot.channels``).
        dofs: Names of the degrees of freedom (``robot.dofs``).
        position: Shape (N, channels), [rad, m; quaternions x y z w].
        torque: Shape (N, dofs), [N m, N].
        time: Strictly increasing, shape (N,), [s]; None for unordered samples.
        velocity: As logged, shape (N, dofs), [rad/s, m/s]; None when not logged.
        acceleration: As logged, shape (N, dofs), [rad/s², m/s²]; None when not logged.
        torque_delay: By how much the torque's time stamps are late against the positions' [s]; motion is taken so much
            earlier (:func:`casysid.signals.motion_from_recording`). Not written to files.
        sources: Files it came from.
        unused_columns: Columns of those files that were left aside.

    Raises:
        RecordingError: On wrong shapes, values that are not finite, time that does not increase, or unordered samples
            without velocity or acceleration.
    """

    channels: tuple[str, ...]
    dofs: tuple[str, ...]
    position: Array = field(repr=False)
    torque: Array = field(repr=False)
    time: Array | None = field(default=None, repr=False)
    velocity: Array | None = field(default=None, repr=False)
    acceleration: Array | None = field(default=None, repr=False)
    torque_delay: float = 0.0
    sources: tuple[str, ...] = ()
    unused_columns: tuple[str, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        samples = next(iter(np.shape(self.position)), 0)
        widths = {"position": (len(self.channels),), "torque": (len(self.dofs),), "time": ()}
        widths |= {"velocity": (len(self.dofs),), "acceleration": (len(self.dofs),)}
        for name, width in widths.items():
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, self._checked(name, frozen(values), (samples, *width)))
        if self.time is None and (self.velocity is None or self.acceleration is None):
            raise RecordingError(
                f"{self.label}: without time the samples are unordered and nothing can be differentiated; "
                "give time, or velocity and acceleration"
            )
        if self.time is not None and (np.diff(self.time) <= 0.0).any():
            raise RecordingError(
                f"{self.label}: time must increase from each sample to the next; sort the samples by time"
            )

    def _checked(self, name: str, values: Array, shape: tuple[int, ...]) -> Array:
        if values.shape != shape:
            raise RecordingError(f"{self.label}: {name} must have shape {shape}; got {values.shape}")
        if not np.isfinite(values).all():
            first = np.argwhere(~np.isfinite(values))[0]
            raise RecordingError(
                f"{self.label}: {name} must be finite; got {values[tuple(first)]} in sample {first[0]}"
            )
        return values

    def __len__(self) -> int:
        return len(self.position)

    @property
    def label(self) -> str:
        """What to call it in a message."""
        return ", ".join(self.sources) or "recording"

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]; nan without time."""
        return float(self.time[-1] - self.time[0]) if self.time is not None and len(self) else float("nan")

    @cached_property
    def rate(self) -> float:
        """Samples per second, gaps left out [Hz]; nan without time."""
        steps = self._steps[~self._gaps]
        return float(1.0 / steps.mean()) if len(steps) else float("nan")

    @cached_property
    def segments(self) -> tuple[slice, ...]:
        """Runs of samples between the gaps in time, each to be smoothed by itself; empty without time.

        A gap is a step longer than five median steps.
        """
        if self.time is None:
            return ()
        edges = [0, *(np.flatnonzero(self._gaps) + 1).tolist(), len(self)]
        return tuple(slice(start, stop) for start, stop in pairwise(edges))

    @property
    def _steps(self) -> Array:
        return np.diff(self.time) if self.time is not None else np.empty(0)

    @property
    def _gaps(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        steps = self._steps
        return steps > GAP * np.median(steps) if len(steps) else np.zeros(0, dtype=np.bool_)

    def selected(self, rows: slice | npt.NDArray[np.intp]) -> Recording:
        """Some samples only, in the order of time."""
        return dataclasses.replace(
            self,
            position=self.position[rows],
            torque=self.torque[rows],
            time=None if self.time is None else self.time[rows],
            velocity=None if self.velocity is None else self.velocity[rows],
            acceleration=None if self.acceleration is None else self.acceleration[rows],
        )

    def split(self, fraction: float) -> tuple[Recording, Recording]:
        """The first ``fraction`` of the time and the rest; of the rows in their order when there is no time.

        Raises:
            ParameterError: If ``fraction`` is not between 0 and 1, or leaves one side empty.
        """
        if not 0.0 < fraction < 1.0:
            raise ParameterError(f"split: fraction must lie between 0 and 1, both excluded; got {fraction}")
        cut = int(fraction * len(self))
        if self.time is not None and len(self):
            cut = int(np.searchsorted(self.time, self.time[0] + fraction * self.duration))
        if cut in (0, len(self)):
            raise ParameterError(f"split: fraction {fraction} of {len(self)} samples leaves one side empty")
        return self.selected(slice(None, cut)), self.selected(slice(cut, None))

    def trimmed(self, start: float | None = None, stop: float | None = None) -> Recording:
        """The samples with ``start <= time < stop`` [s], in the recording's own clock; None leaves that end open.

        Raises:
            RecordingError: If there is no time, or no sample in that interval.
        """
        if self.time is None:
            raise RecordingError(f"{self.label}: samples without time cannot be trimmed by time")
        first = 0 if start is None else int(np.searchsorted(self.time, start))
        last = len(self) if stop is None else int(np.searchsorted(self.time, stop))
        if first >= last:
            raise RecordingError(
                f"{self.label}: no samples from {start} s to {stop} s; "
                f"the recording runs from {self.time[0]:.6g} s to {self.time[-1]:.6g} s"
            )
        return self.selected(slice(first, last))

    def with_time_scaled(self, scale: float) -> Recording:
        """The recording with its time stamps multiplied; velocities and accelerations stay as logged."""
        if self.time is None:
            return self
        return dataclasses.replace(self, time=self.time * scale, torque_delay=self.torque_delay * scale)

    def flipped(self, columns: Sequence[str]) -> Recording:
        """The recording with the signs of some columns turned.

        Args:
            columns: ``tau_<joint>``; ``q_<joint>``, its velocity and acceleration with it; ``<joint>`` for both, as
                where its axis points the other way; ``tau`` for the torques of all joints.

        Raises:
            ParameterError: A column that is none of these, or of a joint that moves in several ways.
        """
        single = [name for name in self.channels if name in self.dofs]
        known = ["tau", *(f"tau_{name}" for name in self.dofs), *(f"q_{name}" for name in single), *single]
        unknown = [column for column in columns if column not in known]
        if unknown:
            raise ParameterError(f"flip: no column {', '.join(unknown)} to turn; known are {', '.join(known)}")
        motion, torque = np.ones(len(self.dofs)), np.ones(len(self.dofs))
        for column in columns:
            for k, name in enumerate(self.dofs):
                motion[k] *= -1.0 if column in (name, f"q_{name}") else 1.0
                torque[k] *= -1.0 if column in (name, f"tau_{name}", "tau") else 1.0
        signs = dict(zip(self.dofs, motion, strict=True))
        return dataclasses.replace(
            self,
            position=self.position * [signs[name] if name in single else 1.0 for name in self.channels],
            velocity=None if self.velocity is None else self.velocity * motion,
            acceleration=None if self.acceleration is None else self.acceleration * motion,
            torque=self.torque * torque,
        )

    def decimated(self, factor: int) -> Recording:
        """Every ``factor``-th sample, plainly picked.

        What is faster than half the new rate folds back (aliases), unless a low-pass has removed it before.

        Raises:
            ParameterError: If ``factor`` is not a positive whole number.
        """
        if factor != int(factor) or factor < 1:
            raise ParameterError(f"decimated: factor must be a positive whole number; got {factor}")
        return self.selected(slice(None, None, int(factor)))

    def summary(self) -> RecordingSummary:
        """What there is, in figures."""
        return RecordingSummary(
            sources=self.sources,
            samples=len(self),
            duration=self.duration,
            rate=self.rate,
            segments=len(self.segments),
            logged=("q", *(n for n, a in (("v", self.velocity), ("a", self.acceleration)) if a is not None), "tau"),
            position_range={
                c: (float(x.min()), float(x.max())) for c, x in zip(self.channels, self.position.T, strict=True)
            },
            torque_rms={d: float(np.sqrt(np.mean(x**2))) for d, x in zip(self.dofs, self.torque.T, strict=True)},
            torque_peak={d: float(np.abs(x).max()) for d, x in zip(self.dofs, self.torque.T, strict=True)},
            unused_columns=self.unused_columns,
        )

    def write(self, path: str | Path) -> Path:
        """Write by suffix (.csv, .csv.gz, .tsv, .parquet, .npz), columns by name; read back, the numbers are the same.

        Returns:
            The path. A file that was there is replaced, and only once the new one is complete.

        Raises:
            RecordingError: If the suffix is none of these.
        """
        from casysid.readers.writing import columns_of, write_columns

        return write_columns(Path(path), columns_of(self))


@dataclass(frozen=True, kw_only=True)
class RecordingSummary:
    """A recording in figures; ``str()`` gives them as lines of text.

    Attributes:
        sources: Files.
        samples: Number of rows.
        duration: [s], nan without time.
        rate: [Hz], nan without time.
        segments: Runs between gaps in time, 0 without time.
        logged: Which of q, v, a, tau are there.
        position_range: Smallest and largest position by channel [rad, m].
        torque_rms: Root mean square torque by degree of freedom [N m, N].
        torque_peak: Largest absolute torque by degree of freedom [N m, N].
        unused_columns: Columns left aside.
    """

    sources: tuple[str, ...]
    samples: int
    duration: float
    rate: float
    segments: int
    logged: tuple[str, ...]
    position_range: dict[str, tuple[float, float]]
    torque_rms: dict[str, float]
    torque_peak: dict[str, float]
    unused_columns: tuple[str, ...]

    def __str__(self) -> str:
        timing = (
            f"{self.duration:.6g} s at {self.rate:.6g} Hz, {self.segments} segment(s)" if self.segments else "unordered"
        )
        lines = [
            ", ".join(self.sources) or "recording",
            f"{self.samples} samples, {timing}; logged: {', '.join(self.logged)}",
        ]
        lines += [f"q   {name}: {low:.6g} to {high:.6g}" for name, (low, high) in self.position_range.items()]
        lines += [
            f"tau {name}: rms {rms:.6g}, peak {self.torque_peak[name]:.6g}" for name, rms in self.torque_rms.items()
        ]
        if self.unused_columns:
            lines.append(f"not used: {', '.join(self.unused_columns)}")
        return "\n".join(lines)


def read_recording(path: str | Path, robot: Robot) -> Recording:
    """The recording in a CSV (plain or gzipped), Parquet or NPZ file.

    Columns are ``time`` [s], then by joint name ``q_<joint>, v_<joint>, a_<joint>, tau_<joint>``, or numbered
    ``q1, dq1, ddq1, tau1`` in the model's order; :mod:`casysid.readers.columns` has the other spellings. SI units.
    Only q and tau are needed beside time; without time the rows are unordered samples, and need all four. Other columns
    are left aside.

    Warns:
        CasysidWarning: For everything doubtful that leaves the recording usable.

    Raises:
        RecordingError: If it cannot be used: file, column and line, and what to do.
    """
    from casysid.readers.loading import load_recording

    recording, weaknesses = load_recording(Path(path), robot)
    for weakness in weaknesses:
        warnings.warn(f"{path}: {weakness}", CasysidWarning, stacklevel=2)
    return recording


def read_recordings(paths: Sequence[str | Path], robot: Robot) -> tuple[Recording, ...]:
    """The recordings in several files, in their order; see :func:`read_recording`.

    Raises:
        RecordingError: If one cannot be used, or a file is given twice.
    """
    from casysid.readers.loading import load_recording

    if isinstance(paths, (str, Path)):
        raise RecordingError(f"read_recordings: wanted a list of files; got one path, {paths}: put it in a list")
    files = [Path(path).resolve() for path in paths]
    twice = [str(path) for path, file in zip(paths, files, strict=True) if files.count(file) > 1]
    if twice:
        raise RecordingError(
            f"{twice[0]}: given {len(twice)} times; its samples would count as often. Give each file once"
        )
    loaded = [load_recording(Path(path), robot) for path in paths]
    for path, (_, weaknesses) in zip(paths, loaded, strict=True):
        for weakness in weaknesses:
            warnings.warn(f"{path}: {weakness}", CasysidWarning, stacklevel=2)
    return tuple(recording for recording, _ in loaded)

"""The one place where recordings are smoothed and their equations summed; both are counted.

Short recordings are smoothed once and kept. Long ones are smoothed anew in every pass, piece by piece, each with so
many samples beside it that the smoothing has forgotten where it ends; only sums are kept, so memory does not grow with
the length. What is chosen from the data is then chosen by excerpts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property, partial
from itertools import repeat
from typing import Any

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Regressor, continued_positions
from casysid.identification.prediction import ErrorSums, TorqueError, error_sums, torque_errors
from casysid.identification.tuning.band import BandChoice
from casysid.identification.unknown_forces import moments_of_known
from casysid.moments import Moments
from casysid.recording import Source
from casysid.robot import Robot
from casysid.signals import BandAverage, Motion, motion_from_recording, motion_pieces, noise_of
from casysid.signals.noise import smoothed_noise

SAMPLES_PER_PERIOD = 100
"""Of the equations' cut-off: a boxcar of so many samples a period has a gain of ``1 - 1.6e-4`` there."""
RELATIVE_WIDTH = 0.02
"""Width of Coulomb's smooth sign in root mean square velocities: how sharply friction turns is invisible through a
low-pass, and a wrong sharp turn costs more than a blunt one (``scripts/benchmark_population.py``)."""
NEAR_REST = 2.5
"""A joint slower than so many widths is near rest: beyond, the smooth sign is within 1.4 % of one."""
MINIMUM_BLOCKS = 4
"""Of every recording: the fewest of which folds and scores tell anything."""
EXCERPTS, EXCERPT_ROWS = 8, 1 << 14
"""Of a long recording: a quarter of a minute each at 1 kHz. A motion of seven joints then takes some 30 MB."""

SHORTEST_EXCERPT = 1 << 12
"""Rows of an excerpt at least, where recordings have as many: a few seconds at 1 kHz, some periods of any motion."""

Mask = npt.NDArray[np.bool_]
Mapped = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
"""Does one thing to each recording, in their order: ``map``, or other processes and machines."""


def is_long(recordings: Sequence[Source]) -> bool:
    """Whether recordings together have more samples than are kept smoothed."""
    return sum(map(len, recordings)) > EXCERPTS * EXCERPT_ROWS and all(one.has_time for one in recordings)


def excerpts(recordings: Sequence[Source], mapped: Mapped = map) -> tuple[Source, ...]:
    """The recordings themselves, or of long ones excerpts, evenly over each; of very many, evenly over some.

    Args:
        recordings: At least one.
        mapped: Cuts them.
    """
    if not is_long(recordings):
        return tuple(recordings)
    rows = min(SHORTEST_EXCERPT, max(map(len, recordings)))
    most = max(EXCERPT_ROWS * EXCERPTS // rows, 1)
    if len(recordings) > most:
        recordings = [recordings[k] for k in np.linspace(0, len(recordings) - 1, most).round().astype(int).tolist()]
    share = EXCERPT_ROWS * EXCERPTS // len(recordings)
    count = max(1, min(EXCERPTS, share // SHORTEST_EXCERPT))
    cut = partial(_excerpts_of, count=count, rows=max(share // count, 1))
    return tuple(part for parts in mapped(cut, recordings) for part in parts)


def _excerpts_of(recording: Source, count: int, rows: int) -> tuple[Source, ...]:
    return recording.excerpts(count, rows)


class Passes:
    """Recordings smoothed, and summed as often as asked.

    Attributes:
        robot: The robot.
        recordings: What is smoothed.
        band: Cut-offs.
        smoothings: How often each recording was smoothed.
        passes: How often the equations of each recording were evaluated.
        blocks: Blocks of each recording in the moments that were summed last.
    """

    def __init__(
        self,
        robot: Robot,
        recordings: Sequence[Source],
        band: BandChoice,
        *,
        delays: Array | None = None,
        blocks: int = 20,
        threads: int = 2,
        mapped: Mapped = map,
    ) -> None:
        """Nothing is done yet.

        Args:
            robot: The robot.
            recordings: At least one.
            band: Cut-offs.
            delays: By which each degree of freedom's torque is late, shape (nv,), [s].
            blocks: Blocks of time in all.
            threads: Of the regressor's evaluation.
            mapped: Sums long recordings, one by one.
        """
        self.robot, self.recordings, self.band = robot, tuple(recordings), band
        self.smoothings = self.passes = 0
        self.blocks: tuple[int, ...] = ()
        self._delays, self._blocks, self._threads, self._mapped = delays, blocks, threads, mapped

    @cached_property
    def motions(self) -> tuple[Motion, ...]:
        """The recordings smoothed, at all their samples; not to be asked of long ones."""
        self.smoothings += 1
        return tuple(
            motion_from_recording(self.robot, one, self.band.smoothing, delays=self._delays) for one in self.recordings
        )

    @cached_property
    def sparse_motions(self) -> tuple[Motion, ...]:
        """The same at as many samples as the equations need, their torque averaged, without what ends spoil."""
        return tuple(
            _sparse(motion, self._stride(one)) for motion, one in zip(self.motions, self.recordings, strict=True)
        )

    @cached_property
    def speed(self) -> Array:
        """Root mean square velocity of each degree of freedom, shape (nv,)."""
        return np.asarray(np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in self.sparse_motions], axis=0)))

    @cached_property
    def travel(self) -> Array:
        """Standard deviation of the position of each degree of freedom within a recording, shape (nv,)."""
        spread = [np.var(continued_positions(self.robot, motion.q), axis=0) for motion in self.sparse_motions]
        return np.asarray(np.sqrt(np.mean(spread, axis=0)))

    @cached_property
    def noise(self) -> Array:
        """Standard deviation of what smoothing leaves of the positions' noise, shape (nv,).

        Of joints with one channel, zero for others and without time.
        """
        found, cutoff = np.zeros(self.robot.nv), self.band.smoothing
        if cutoff is None:
            return found
        left = [smoothed_noise(cutoff, one.rate, 0) * noise_of(one.spectrum) for one in self.recordings]
        levels = np.sqrt(np.mean(np.square(left), axis=0))
        for joint in self.robot.joints:
            if joint.v.stop - joint.v.start == joint.channels.stop - joint.channels.start == 1:
                found[joint.v] = levels[joint.channels]
        return found

    @cached_property
    def width(self) -> Array:
        """Within which smooth signs turn, shape (nv,)."""
        return np.maximum(RELATIVE_WIDTH * self.speed, np.finfo(np.float64).eps)

    @cached_property
    def near_rest(self) -> tuple[Mask, ...] | None:
        """When each joint stands or turns round, in the sparse motions, shape (N, nv) each; None without time."""
        if self.band.cutoff is None:
            return None
        return tuple(self._near_rest(motion) for motion in self.sparse_motions)

    def blocks_of_each(self) -> int:
        """Blocks of time of every recording."""
        return max(MINIMUM_BLOCKS, -(-self._blocks // len(self.recordings)))

    def moments(self, regressor: Regressor) -> Moments:
        """One pass: moments of all recordings, their blocks one after the other, equations near rest apart."""
        self.passes += 1
        parts = self._long_moments(regressor) if is_long(self.recordings) else self._short_moments(regressor)
        self.blocks = tuple(part.blocks for part in parts)
        return added(parts).with_rows_only()

    def _long_moments(self, regressor: Regressor) -> list[Moments]:
        self.smoothings += 1
        return list(self._mapped(partial(_long_moments, self._alone(), regressor), self.recordings))

    def _short_moments(self, regressor: Regressor) -> list[Moments]:
        return [
            sum_moments(
                regressor,
                [motion],
                self.band.cutoff,
                near_rest=mask,
                blocks=self.blocks_of_each(),
                threads=self._threads,
                only_rows=False,
            )
            for motion, mask in zip(self.sparse_motions, self._masks(), strict=True)
        ]

    def _masks(self) -> list[list[Mask] | None]:
        return [None] * len(self.recordings) if self.near_rest is None else [[mask] for mask in self.near_rest]

    def errors(
        self, regressor: Regressor, parameters: Sequence[Array], cutoff: float | None
    ) -> tuple[TorqueError, ...]:
        """One pass: the torque errors of several parameter vectors over all recordings.

        Of long ones, curves are kept of the first piece only.
        """
        if not is_long(self.recordings):
            return torque_errors(regressor, parameters, self.all_motions(), cutoff)
        self.passes += 1
        self.smoothings += 1
        work = partial(_error_sums, self._alone(), regressor, parameters, cutoff)
        total = [ErrorSums() for _ in parameters]
        for found in self._mapped(work, [(one, k == 0) for k, one in enumerate(self.recordings)]):
            for sums, more in zip(total, found, strict=True):
                sums.join(more)
        return tuple(sums.error() for sums in total)

    def _alone(self) -> Passes:
        """What the pass over one of these long recordings has to know, without any of them."""
        alone = Passes(
            self.robot, (), self.band, delays=self._delays, blocks=self.blocks_of_each(), threads=self._threads
        )
        return alone.like(self) if "width" in self.__dict__ else alone

    def all_motions(self) -> Iterator[Motion]:
        """One pass over the motions at all their samples, of long recordings piece by piece."""
        self.passes += 1
        if not is_long(self.recordings):
            yield from self.motions
            return
        self.smoothings += 1
        for recording in self.recordings:
            yield from self.pieces(recording)

    def pieces(self, recording: Source) -> Iterator[Motion]:
        """The motion of a long recording at all its samples, piece by piece."""
        for piece in motion_pieces(self.robot, recording, self.band.smoothing, delays=self._delays):
            yield piece.motion.rows(piece.core)

    def like(self, other: Passes) -> Passes:
        """These, with the widths of other passes over the same motions."""
        self.__dict__["width"] = other.width
        return self

    def disturbed(self, recordings: Sequence[Source]) -> Passes:
        """Passes over the same recordings with other noise: the same equations are near rest."""
        other = Passes(
            self.robot,
            recordings,
            self.band,
            delays=self._delays,
            blocks=self._blocks,
            threads=self._threads,
            mapped=self._mapped,
        )
        if not is_long(self.recordings):
            other.__dict__["near_rest"] = self.near_rest
        return other.like(self)

    def long_moments(self, regressor: Regressor, recording: Source) -> Moments:
        """Of one recording in as many blocks as were asked for, piece by piece; windows end with their piece."""
        blocks, groups = self._blocks, dict[int, Moments]()
        for piece in motion_pieces(
            self.robot, recording, self.band.smoothing, delays=self._delays, multiple=self._stride(recording)
        ):
            motion = _sparse(piece.motion.rows(piece.core), self._stride(recording))
            if not len(motion):
                continue
            found = sum_moments(
                regressor,
                [motion],
                self.band.cutoff,
                near_rest=[self._near_rest(motion)],
                blocks=1,
                threads=self._threads,
                only_rows=False,
            )
            share = (motion.time[0] - recording.start) / max(recording.duration, np.finfo(np.float64).tiny)
            place = min(int(blocks * share), blocks - 1)
            groups[place] = (groups[place] + found).merged_blocks([[0, 1]]) if place in groups else found
        return added([groups[place] for place in sorted(groups)])

    def _near_rest(self, motion: Motion) -> Mask:
        return np.asarray(motion.standing | (np.abs(motion.v) < NEAR_REST * self.width))

    def _stride(self, recording: Source) -> int:
        """Samples that are averaged into one, an odd number."""
        if self.band.cutoff is None:
            return 1
        stride = max(int(recording.rate / (SAMPLES_PER_PERIOD * self.band.cutoff)), 1)
        return stride - 1 + stride % 2


def _long_moments(alone: Passes, regressor: Regressor, recording: Source) -> Moments:
    return alone.long_moments(regressor, recording)


def _error_sums(
    alone: Passes, regressor: Regressor, parameters: Sequence[Array], cutoff: float | None, item: tuple[Source, bool]
) -> list[ErrorSums]:
    recording, shown = item
    return error_sums(regressor, parameters, alone.pieces(recording), cutoff, curves=int(shown))


def sum_moments(
    regressor: Regressor,
    motions: Sequence[Motion],
    cutoff: float | None,
    *,
    near_rest: Sequence[Mask] | None = None,
    blocks: int = MINIMUM_BLOCKS,
    threads: int = 2,
    only_rows: bool = True,
) -> Moments:
    """Moments of motions, the blocks of each after those of the one before.

    Args:
        regressor: Gives the columns.
        motions: At least one.
        cutoff: Of the equations' average [Hz]; None sums them as they are.
        near_rest: When a joint's equations are rows of their own, shape (N, nv) by motion; None keeps them together.
        blocks: Of each motion.
        threads: Of the evaluation.
        only_rows: Whether joints near rest that have no row are left out.
    """
    parts = [
        moments_of_known(
            regressor,
            motion,
            None if cutoff is None else BandAverage(motion.time, cutoff),
            near_rest=mask,
            blocks=blocks,
            threads=threads,
        )
        for motion, mask in zip(motions, near_rest or repeat(None), strict=False)
    ]
    total = added(parts)
    return total.with_rows_only() if only_rows else total


def added(parts: Sequence[Moments]) -> Moments:
    """The blocks of all, one after the other; in pairs, so that of many parts none is copied often."""
    while len(parts) > 1:
        parts = [sum(parts[k + 1 : k + 2], parts[k]) for k in range(0, len(parts), 2)]
    return parts[0]


def _sparse(motion: Motion, stride: int) -> Motion:
    return motion.decimated(stride).without_ends()

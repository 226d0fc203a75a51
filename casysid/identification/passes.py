"""The one place where recordings are smoothed and their equations summed; both are counted."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.dynamics import Regressor, continued_positions
from casysid.identification.tuning.band import BandChoice
from casysid.moments import Moments
from casysid.recording import Source
from casysid.robot import Robot
from casysid.signals import BandAverage, Motion, motion_from_recording

SAMPLES_PER_PERIOD = 100
"""Of the equations' cut-off: a boxcar of so many samples a period has a gain of ``1 - 1.6e-4`` there."""
RELATIVE_WIDTH = 0.02
"""Width of Coulomb's smooth sign in root mean square velocities: how sharply friction turns is invisible through a
low-pass, and a wrong sharp turn costs more than a blunt one (``scripts/benchmark_population.py``)."""
NEAR_REST = 2.5
"""A joint slower than so many widths is near rest: beyond, the smooth sign is within 1.4 % of one."""
MINIMUM_BLOCKS = 4


class Passes:
    """Recordings smoothed once, and summed as often as asked.

    Attributes:
        robot: The robot.
        recordings: What is smoothed.
        band: Cut-offs.
        smoothings: How often each recording was smoothed.
        passes: How often the equations of each recording were evaluated.
    """

    def __init__(
        self, robot: Robot, recordings: Sequence[Source], band: BandChoice, *, blocks: int = 20, threads: int = 2
    ) -> None:
        """Nothing is done yet.

        Args:
            robot: The robot.
            recordings: At least one.
            band: Cut-offs.
            blocks: Blocks of time in all.
            threads: Of the regressor's evaluation.
        """
        self.robot, self.recordings, self.band = robot, tuple(recordings), band
        self.smoothings = self.passes = 0
        self._blocks, self._threads = blocks, threads

    @cached_property
    def motions(self) -> tuple[Motion, ...]:
        """The recordings smoothed, at all their samples."""
        self.smoothings += 1
        return tuple(motion_from_recording(self.robot, one, self.band.smoothing) for one in self.recordings)

    @cached_property
    def sparse_motions(self) -> tuple[Motion, ...]:
        """The same at as many samples as the equations need, their torque averaged, without what ends spoil."""
        if self.band.cutoff is None:
            return self.motions
        return tuple(
            motion.decimated(int(one.rate / (SAMPLES_PER_PERIOD * self.band.cutoff))).without_ends()
            for motion, one in zip(self.motions, self.recordings, strict=True)
        )

    @cached_property
    def speed(self) -> Array:
        """Root mean square velocity of each degree of freedom, shape (nv,)."""
        return np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in self.sparse_motions], axis=0))

    @cached_property
    def travel(self) -> Array:
        """Standard deviation of the position of each degree of freedom within a recording, shape (nv,)."""
        spread = [np.var(continued_positions(self.robot, motion.q), axis=0) for motion in self.sparse_motions]
        return np.sqrt(np.mean(spread, axis=0))

    @cached_property
    def width(self) -> Array:
        """Within which smooth signs turn, shape (nv,)."""
        return np.maximum(RELATIVE_WIDTH * self.speed, np.finfo(np.float64).eps)

    def blocks_of_each(self) -> int:
        """Blocks of time of every recording."""
        return max(MINIMUM_BLOCKS, -(-self._blocks // len(self.recordings)))

    def moments(self, regressor: Regressor, *, near_rest_apart: bool = True) -> Moments:
        """One pass: moments of all recordings, their blocks one after the other.

        Args:
            regressor: Gives the columns.
            near_rest_apart: Whether equations of a joint near rest are rows of their own.
        """
        self.passes += 1
        return sum_moments(
            regressor,
            self.sparse_motions,
            self.band.cutoff,
            near_rest=NEAR_REST * self.width if near_rest_apart else None,
            blocks=self.blocks_of_each(),
            threads=self._threads,
        )

    def visit(self, look: Callable[[Motion], None]) -> None:
        """One pass over the motions at all their samples."""
        self.passes += 1
        for motion in self.motions:
            look(motion)

    def disturbed(self, recordings: Sequence[Source]) -> Passes:
        """Passes over other recordings of the same robot in the same band, with the same stands."""
        other = Passes(self.robot, recordings, self.band, blocks=self._blocks, threads=self._threads)
        other.__dict__["motions"] = tuple(
            dataclasses.replace(motion, standing=mine.standing)
            for motion, mine in zip(other.motions, self.motions, strict=True)
        )
        other.__dict__["width"] = self.width
        return other


def sum_moments(
    regressor: Regressor,
    motions: Sequence[Motion],
    cutoff: float | None,
    *,
    near_rest: Array | None = None,
    blocks: int = MINIMUM_BLOCKS,
    threads: int = 2,
) -> Moments:
    """Moments of motions, the blocks of each after those of the one before.

    Args:
        regressor: Gives the columns.
        motions: At least one.
        cutoff: Of the equations' average [Hz]; None sums them as they are.
        near_rest: Velocity below which a joint's equations are rows of their own, shape (nv,); None keeps them together.
        blocks: Of each motion.
        threads: Of the evaluation.
    """
    parts = [
        accumulate_moments(
            regressor,
            motion.q,
            motion.v,
            motion.a,
            motion.tau,
            average=None if cutoff is None else BandAverage(motion.time, cutoff),
            near_rest=None if near_rest is None or cutoff is None else motion.standing | (np.abs(motion.v) < near_rest),
            blocks=blocks,
            threads=threads,
        )
        for motion in motions
    ]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total.with_rows_only()

"""The one place where recordings are smoothed and their equations summed; both are counted."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import repeat

import numpy as np
import numpy.typing as npt

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.dynamics import Regressor, continued_positions
from casysid.identification.tuning.band import BandChoice
from casysid.moments import Moments
from casysid.recording import Source
from casysid.robot import Robot
from casysid.signals import BandAverage, Motion, motion_from_recording, noise_of

SAMPLES_PER_PERIOD = 100
"""Of the equations' cut-off: a boxcar of so many samples a period has a gain of ``1 - 1.6e-4`` there."""
RELATIVE_WIDTH = 0.02
"""Width of Coulomb's smooth sign in root mean square velocities: how sharply friction turns is invisible through a
low-pass, and a wrong sharp turn costs more than a blunt one (``scripts/benchmark_population.py``)."""
NEAR_REST = 2.5
"""A joint slower than so many widths is near rest: beyond, the smooth sign is within 1.4 % of one."""
MINIMUM_BLOCKS = 4
"""Of every recording: the fewest of which folds and scores tell anything."""

Mask = npt.NDArray[np.bool_]


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
        self,
        robot: Robot,
        recordings: Sequence[Source],
        band: BandChoice,
        *,
        delays: Array | None = None,
        blocks: int = 20,
        threads: int = 2,
    ) -> None:
        """Nothing is done yet.

        Args:
            robot: The robot.
            recordings: At least one.
            band: Cut-offs.
            delays: By which each degree of freedom's torque is late, shape (nv,), [s].
            blocks: Blocks of time in all.
            threads: Of the regressor's evaluation.
        """
        self.robot, self.recordings, self.band = robot, tuple(recordings), band
        self.smoothings = self.passes = 0
        self._delays, self._blocks, self._threads = delays, blocks, threads

    @cached_property
    def motions(self) -> tuple[Motion, ...]:
        """The recordings smoothed, at all their samples."""
        self.smoothings += 1
        return tuple(
            motion_from_recording(self.robot, one, self.band.smoothing, delays=self._delays) for one in self.recordings
        )

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
        return np.asarray(np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in self.sparse_motions], axis=0)))

    @cached_property
    def travel(self) -> Array:
        """Standard deviation of the position of each degree of freedom within a recording, shape (nv,)."""
        spread = [np.var(continued_positions(self.robot, motion.q), axis=0) for motion in self.sparse_motions]
        return np.asarray(np.sqrt(np.mean(spread, axis=0)))

    @cached_property
    def noise(self) -> Array:
        """Standard deviation of the positions' noise of joints with one channel, zero for others, shape (nv,)."""
        levels = np.sqrt(np.mean([noise_of(one.spectrum) ** 2 for one in self.recordings], axis=0))
        found = np.zeros(self.robot.nv)
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
        slow = NEAR_REST * self.width
        return tuple(motion.standing | (np.abs(motion.v) < slow) for motion in self.sparse_motions)

    def blocks_of_each(self) -> int:
        """Blocks of time of every recording."""
        return max(MINIMUM_BLOCKS, -(-self._blocks // len(self.recordings)))

    def moments(self, regressor: Regressor) -> Moments:
        """One pass: moments of all recordings, their blocks one after the other, equations near rest apart."""
        self.passes += 1
        return sum_moments(
            regressor,
            self.sparse_motions,
            self.band.cutoff,
            near_rest=self.near_rest,
            blocks=self.blocks_of_each(),
            threads=self._threads,
        )

    def disturbed(self, recordings: Sequence[Source]) -> Passes:
        """Passes over the same recordings with other noise: the same equations are near rest."""
        other = Passes(
            self.robot, recordings, self.band, delays=self._delays, blocks=self._blocks, threads=self._threads
        )
        other.__dict__["near_rest"] = self.near_rest
        return other


def sum_moments(
    regressor: Regressor,
    motions: Sequence[Motion],
    cutoff: float | None,
    *,
    near_rest: Sequence[Mask] | None = None,
    blocks: int = MINIMUM_BLOCKS,
    threads: int = 2,
) -> Moments:
    """Moments of motions, the blocks of each after those of the one before.

    Args:
        regressor: Gives the columns.
        motions: At least one.
        cutoff: Of the equations' average [Hz]; None sums them as they are.
        near_rest: When a joint's equations are rows of their own, shape (N, nv) by motion; None keeps them together.
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
            near_rest=mask,
            blocks=blocks,
            threads=threads,
        )
        for motion, mask in zip(motions, near_rest or repeat(None), strict=False)
    ]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total.with_rows_only()

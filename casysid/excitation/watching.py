"""Which constraints an optimiser looks at, and when: all now and then, or often where a motion is near its limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.excitation.blocks import Block, JointBlock, TorqueBlock
from casysid.excitation.problem import BETWEEN, REFINEMENT, ExcitationProblem

BUSY = 0.4
"""Torque is looked at of joints where some motion takes more than this share of the limit."""
NEAR = 0.15
"""What comes nearer to its limit than this share of its scale is looked at often."""
OFTEN = 2
"""At every so many instants of the grid of the check; at all of them where a limit is violated."""
SELDOM = 20
"""At every so many of its instants everything is looked at."""


class Watched(NamedTuple):
    """A constraint, and the instants of one period at which it is looked at, shape (N,), [s]."""

    block: Block
    time: Array


def on_grid(problem: ExcitationProblem, stride: int = 1, blocks: Sequence[Block] | None = None) -> list[Watched]:
    """Constraints, None for all, at every so many instants of the design grid; dense ones twice as often as it."""
    time, dense = problem.series.grid(problem.samples)[::stride], problem.series.grid(2 * problem.samples)
    return [Watched(one, dense if one.dense else time) for one in (problem.blocks if blocks is None else blocks)]


def busy_blocks(problem: ExcitationProblem, motions: Sequence[Array]) -> list[Block]:
    """All constraints but the torque of joints that stay far from their limits on some motions' variables."""
    blocks: list[Block | None] = []
    for block in problem.blocks:
        if isinstance(block, TorqueBlock):
            grid = problem.series.grid(problem.samples)
            peak = [np.abs(block.measure(problem.trajectory(x).motion(grid))).max(axis=0) for x in motions]
            blocks.append(block.watching(np.max(peak, axis=0) > BUSY * block.limit))
        else:
            blocks.append(block)
    return [block for block in blocks if block is not None]


@dataclass(eq=False)
class NearLimits:
    """Instants at which motions came near to limits; grows with every motion it sees.

    Attributes:
        problem: Whose limits.
        blocks: The constraints to look at, those of joints one by one.
    """

    problem: ExcitationProblem
    blocks: Sequence[Block]
    _often: list[npt.NDArray[np.bool_]] = field(init=False)

    def __post_init__(self) -> None:
        self.blocks = [part for block in self.blocks for part in _parts(block)]
        self._often = [self._every(SELDOM)] * len(self.blocks)

    def see(self, x: Array) -> list[Watched]:
        """What to look at after a motion, of which the variables are given, and all before it."""
        time = self.problem.series.grid(REFINEMENT * self.problem.samples)
        motion, often = self.problem.trajectory(x).motion(time), self._every(OFTEN)
        for k, block in enumerate(self.blocks):
            room = (block.slack(motion) / block.scale).min(axis=1, initial=np.inf)
            self._often[k] = self._often[k] | (often & (room < NEAR)) | (room < BETWEEN)
        return [Watched(block, time[chosen]) for block, chosen in zip(self.blocks, self._often, strict=True)]

    def _every(self, step: int) -> npt.NDArray[np.bool_]:
        return np.asarray(np.arange(REFINEMENT * self.problem.samples) % step == 0)


def _parts(block: Block) -> list[Block]:
    if isinstance(block, JointBlock):
        return [block.of_joint(k) for k in range(len(block.joints))]
    return [block]

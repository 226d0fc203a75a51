"""Moments that fade: blocks of time, each with the weight of its age, some of them with something held."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.inertia import KINDS
from casysid.moments import Moments

MOST_BLOCKS = 20
"""Blocks that are kept of samples on line: as many as an identification has."""
LONGEST_AGE = 3.0
"""In time constants; then a block has a weight of a twentieth and is dropped."""
Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Block:
    """Sums over a stretch of time.

    Attributes:
        moments: Of one block.
        time: Its middle [s].
        length: Of it [s].
        held: Whether something was held.
    """

    moments: Moments
    time: float
    length: float
    held: bool


class FadingMoments:
    """Blocks of the last while, old ones merged by pairs so that there are never many."""

    def __init__(self, start: Moments, time: float, forget: float) -> None:
        """The moments of an identification to start from.

        Args:
            start: Its moments; all of them fade from now on.
            time: Now [s].
            forget: Time constant [s].
        """
        self._forget = forget
        groups = np.array_split(np.arange(start.blocks), max(start.blocks // 2, 1))
        self._blocks = [Block(start.merged_blocks([group]), time, forget, False) for group in groups]

    def add(self, block: Block) -> None:
        """The newest block."""
        last = self._blocks[-1]
        span = self._forget * LONGEST_AGE / MOST_BLOCKS
        if last.held == block.held and last.length + block.length <= span:
            length = last.length + block.length
            middle = (last.time * last.length + block.time * block.length) / length
            both = (last.moments + block.moments).merged_blocks([[0, 1]])
            self._blocks[-1] = Block(both, middle, length, block.held)
        else:
            self._blocks.append(block)
        oldest = block.time - LONGEST_AGE * self._forget
        kept = [one for one in self._blocks if one.time >= oldest]
        self._blocks = kept[-2 * MOST_BLOCKS :]

    def changed(self, columns: Indices, change: Array) -> None:
        """Some parameters are others by so much: what is older is as if they had always been so."""
        shift = np.zeros(len(self._blocks[0].moments.columns))
        shift[columns] = -change
        self._blocks = [replace(one, moments=one.moments.shifted(shift)) for one in self._blocks]

    def put_down(self, columns: Indices, payload: Array) -> None:
        """What was held is known, ten parameters, and gone: its torque leaves the blocks that have it."""
        shift = np.zeros(len(self._blocks[0].moments.columns))
        shift[columns] = payload
        self._blocks = [
            replace(one, moments=one.moments.shifted(shift), held=False) if one.held else one for one in self._blocks
        ]

    def weighted(self, now: float) -> tuple[Moments, npt.NDArray[np.bool_]]:
        """All blocks with the weights of their ages, and which of them have something held."""
        weights = np.exp([(min(one.time - now, 0.0)) / self._forget for one in self._blocks])
        first = self._blocks[0].moments
        squares = tuple(
            np.stack([w * one.moments.squares[joint][0] for w, one in zip(weights, self._blocks, strict=True)])
            for joint in range(len(first.joints))
        )
        count = np.stack([w * one.moments.count[0] for w, one in zip(weights, self._blocks, strict=True)])
        moments = Moments(squares, first.row_columns, count, first.columns, first.joints)
        return moments, np.array([one.held for one in self._blocks])


def with_payload(moments: Moments, held: npt.NDArray[np.bool_], link: Indices, first: int) -> Moments:
    """The moments with ten columns more, those of a payload, at place ``first``, which only some blocks have.

    Args:
        moments: Of all blocks.
        held: In which blocks it was held, shape (blocks,).
        link: The columns of the link that held it, shape (10,).
        first: Place of the first new column: behind all links.
    """
    rows, squares = [], []
    for own, sums in zip(moments.row_columns, moments.squares, strict=True):
        moved = np.where(own >= first, own + 10, own)
        carries = np.isin(link, own)
        if not carries.any():
            rows.append(moved)
            squares.append(sums)
            continue
        source = np.searchsorted(own, link[carries])
        new = first + np.flatnonzero(carries)
        order = np.argsort(np.concatenate([moved, new]), kind="stable")
        taken = np.append(np.concatenate([np.arange(len(own)), source])[order], len(own))
        payload = np.append(np.concatenate([np.zeros(len(own)), np.ones(len(new))])[order], 0.0).astype(bool)
        wide = sums[:, taken[:, None], taken].copy()
        wide[np.ix_(~held, payload)] = 0.0
        wide[np.ix_(~held, np.ones(len(taken), dtype=bool), payload)] = 0.0
        rows.append(np.concatenate([moved, new])[order])
        squares.append(wide)
    names = (*moments.columns[:first], *(f"payload.{kind}" for kind in KINDS), *moments.columns[first:])
    return Moments(tuple(squares), tuple(rows), moments.count, names, moments.joints)

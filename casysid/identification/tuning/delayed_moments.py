"""Moments with the torque at several delays at once: one pass over the data serves every delay in between.

The averaged equations ``F x(t) θ = F tau(t + δ)`` have the same left side whatever the delay ``δ`` of the torque. Its
right side is averaged at a few delays, the nodes, by windows moved against the torque's own time stamps, so nothing is
interpolated between samples. What it is in between follows by Lagrange's polynomial, because averages vary slowly; and
so do all second moments, and their slopes in ``δ``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.moments import Moments
from casysid.signals import BandAverage, Motion
from casysid.threads import single_threaded

NODES = 13
"""Of the torque's delay: with their spacing they span 1.2 periods of the cut-off; they follow a delay
that runs away."""
NODE_SPACING = 0.1
"""In periods of the cut-off: a fifth of what the sampling theorem allows, so that a polynomial does between nodes."""
FULL_WINDOW = 0.9
"""A window with less than this share of the usual weight, of motion or of torque, is left out."""
SAMPLES_PER_PERIOD = 20
"""Torque of a far higher rate is averaged down to so many samples in a period of the cut-off first."""


@dataclass(frozen=True, eq=False)
class DelayedMoments:
    """Sums of ``r rᵀ``, ``r = [x, y_1 .. y_K]``, by block of time and joint, ``y_k`` the torque ``nodes[k]`` later.

    Attributes:
        squares: Of each joint in its own w columns, shape (blocks, w + K, w + K).
        count: Rows in each sum, shape (blocks, joints).
        nodes: Delays [s], evenly spaced, shape (K,).
        regressor: Of the rows ``x``.
    """

    squares: tuple[Array, ...]
    count: Array
    nodes: Array
    regressor: Regressor

    def at(self, delays: Array, groups: Array | None = None) -> Moments:
        """Moments of ``[x, z_1 .. z_G, y]`` with the torque taken ``delays`` later, shape (joints,) [s].

        Args:
            delays: Within the nodes.
            groups: Shape (G, joints): each gives a column ``z_g``, minus the torque's slope in the delay of its joints.
                The coefficient of ``z_g`` is what is to be added to their delays.
        """
        p, joints = len(self.regressor.names), len(delays)
        values, slopes = self._lagrange(delays)
        groups = np.zeros((0, joints)) if groups is None else groups
        mixing = np.concatenate([-groups[:, :, None] * slopes, values[None]])  # (G + 1, joints, K)
        rows, squares = [], []
        for joint, (own, sums) in enumerate(zip(self.regressor.row_columns, self.squares, strict=True)):
            felt = np.append(np.flatnonzero(groups[:, joint]), len(groups))
            T = np.zeros((sums.shape[1], len(own) + len(felt)))
            T[np.arange(len(own)), np.arange(len(own))] = 1.0
            T[len(own) :, len(own) :] = mixing[felt, joint].T
            squares.append(T.T @ sums @ T)
            rows.append(np.append(own, p + felt[:-1]))
        names = (*self.regressor.names, *(f"delay_{g + 1}" for g in range(len(groups))))
        return Moments(tuple(squares), tuple(rows), self.count, names, self.regressor.robot.dofs)

    def _lagrange(self, delays: Array) -> tuple[Array, Array]:
        """Weights of the nodes for the torque and for its slope at each delay, shape (joints, K) each."""
        step = self.nodes[1] - self.nodes[0]
        powers = np.vander(np.arange(len(self.nodes)) - (len(self.nodes) - 1) / 2, increasing=True).T
        u = (delays - self.nodes.mean()) / step
        k = np.arange(len(self.nodes))
        monomials = u[:, None] ** k
        slopes = np.where(k > 0, k * u[:, None] ** np.maximum(k - 1, 0), 0.0) / step
        return np.linalg.solve(powers, monomials.T).T, np.linalg.solve(powers, slopes.T).T


def node_delays(centre: float, cutoff: float) -> Array:
    """Delays around ``centre`` [s] that suffice for averages up to ``cutoff`` [Hz]."""
    return np.asarray(centre + (np.arange(NODES) - (NODES - 1) / 2) * NODE_SPACING / cutoff)


def sum_delayed_moments(
    regressor: Regressor,
    motions: Sequence[Motion],
    torques: Sequence[Motion],
    nodes: Array,
    cutoff: float,
    *,
    blocks: int = 20,
    threads: int = 2,
) -> DelayedMoments:
    """One pass over all recordings.

    Args:
        regressor: Gives the rows ``x``.
        motions: The smoothed recordings, possibly at fewer samples.
        torques: The same at all samples, of which the torque is taken.
        nodes: Delays [s], shape (K,).
        cutoff: Of the equations' average [Hz].
        blocks: Blocks of time of each recording.
        threads: Threads of the regressor's evaluation.
    """
    parts = [
        _sum_one(regressor, motion, _thinned(whole, cutoff), nodes, cutoff, blocks, threads)
        for motion, whole in zip(motions, torques, strict=True)
    ]
    squares = tuple(frozen(np.concatenate(own)) for own in zip(*(sums for sums, _ in parts), strict=True))
    count = np.concatenate([rows for _, rows in parts])
    return DelayedMoments(squares, np.repeat(count[:, None], regressor.robot.nv, axis=1), frozen(nodes), regressor)


def _thinned(motion: Motion, cutoff: float) -> tuple[Array, Array]:
    """Time and torque, averaged over neighbours down to a rate that is plenty for the cut-off."""
    rate = (len(motion) - 1) / max(float(motion.time[-1] - motion.time[0]), np.finfo(np.float64).tiny)
    stride = max(int(rate / (SAMPLES_PER_PERIOD * cutoff)), 1)
    whole = len(motion) // stride * stride
    time = motion.time[:whole].reshape(-1, stride).mean(axis=1)
    return time, motion.tau[:whole].reshape(len(time), stride, -1).mean(axis=1)


def _sum_one(
    regressor: Regressor,
    motion: Motion,
    torque: tuple[Array, Array],
    nodes: Array,
    cutoff: float,
    blocks: int,
    threads: int,
) -> tuple[list[Array], Array]:
    """Sums over one recording of each joint, shape (blocks, w + K, w + K), and rows by block, shape (blocks,)."""
    ends = np.searchsorted(motion.time, [torque[0][0] - min(nodes[0], 0.0), torque[0][-1] - max(nodes[-1], 0.0)])
    inside = np.arange(*ends)
    sizes = [len(columns) + len(nodes) for columns in regressor.row_columns]
    sums, count = [np.zeros((blocks, size, size)) for size in sizes], np.zeros(blocks)
    histories = regressor.histories(motion.q, motion.time)
    inputs, _ = regressor.equations.check((motion.q, motion.v, motion.a, motion.tau, *histories))
    starts = np.cumsum([0, *(len(columns) + 1 for columns in regressor.row_columns)])

    def square(values: Array, piece: npt.NDArray[np.intp]) -> tuple[int, list[Array]]:
        average = BandAverage(motion.time, cutoff)
        x, y = average.beside(piece, values.T, *torque, nodes, FULL_WINDOW)
        rows = [
            np.hstack([x[:, start : stop - 1], y[:, joint]]) for joint, (start, stop) in enumerate(pairwise(starts))
        ]
        return len(x), [r.T @ r for r in rows]

    with single_threaded():
        for block, (equations, squares) in regressor.equations.map(
            square, inputs, np.array_split(inside, blocks), threads
        ):
            count[block] += equations
            for total, own in zip(sums, squares, strict=True):
                total[block] += own
    return sums, count

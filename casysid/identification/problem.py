"""From recordings and a cut-off to a regressor and its moments: the linear problem that is to be solved."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.dynamics import Column, Coulomb, Regressor, build_regressor
from casysid.identification.settings import Settings
from casysid.moments import Moments
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import Motion, motion_from_recording

WIDTH_IN_NOISE = 3.0
"""The smooth sign of Coulomb friction turns within this many standard deviations of the velocity's noise."""
SMALLEST_WIDTH = 1e-4
"""And within no less than this fraction of the root mean square velocity."""
MINIMUM_BLOCKS = 4


@dataclass(frozen=True, eq=False)
class LinearProblem:
    """One regression problem: ``tau = Y(q, v, a) θ`` over some recordings.

    Attributes:
        regressor: The regressor, its Coulomb width set by the motions' velocity noise.
        motions: The smoothed recordings.
        moments: Sums over all of them, in blocks of time.
    """

    regressor: Regressor
    motions: tuple[Motion, ...]
    moments: Moments


def build_problem(
    robot: Robot, recordings: Sequence[Recording], cutoff: float | None, settings: Settings, *, rows: int | None = None
) -> LinearProblem:
    """Smooth, differentiate, and sum up; at most about ``rows`` samples of each recording when given."""
    motions = tuple(_thinned(motion_from_recording(robot, recording, cutoff), rows) for recording in recordings)
    regressor = build_regressor(robot, friction=with_widths(settings.friction, motions), couplings=settings.couplings)
    return LinearProblem(regressor, motions, sum_moments(regressor, motions, settings))


def sum_moments(regressor: Regressor, motions: Sequence[Motion], settings: Settings) -> Moments:
    """Moments of all motions, their blocks one after the other."""
    blocks = max(MINIMUM_BLOCKS, -(-settings.blocks // len(motions)))
    parts = [
        accumulate_moments(
            regressor, motion.q, motion.v, motion.a, motion.tau, blocks=blocks, threads=settings.threads
        )
        for motion in motions
    ]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def with_widths(friction: Sequence[Column], motions: Sequence[Motion]) -> tuple[Column, ...]:
    """The friction columns, Coulomb's smooth sign as narrow as the noise of these motions' velocities allows."""
    width = coulomb_width(motions)
    return tuple(
        dataclasses.replace(column, width=width) if isinstance(column, Coulomb) and column.width is None else column
        for column in friction
    )


def coulomb_width(motions: Sequence[Motion]) -> Array:
    """Velocity within which the sign of each degree of freedom's velocity is not certain, shape (nv,)."""
    noise = np.max([motion.velocity_noise for motion in motions], axis=0)
    speed = np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in motions], axis=0))
    return np.maximum(np.maximum(WIDTH_IN_NOISE * noise, SMALLEST_WIDTH * speed), 1e-9)


def _thinned(motion: Motion, rows: int | None) -> Motion:
    return motion if rows is None else motion.every(max(1, len(motion) // rows))

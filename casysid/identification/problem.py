"""From recordings and a cut-off to a regressor and its moments: the linear problem that is to be solved."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.dynamics import Coulomb, Regressor, build_regressor
from casysid.identification.settings import Settings
from casysid.moments import Moments
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import Motion, motion_from_recording

WIDTH_IN_NOISE = 3.0
"""Coulomb's smooth sign turns within no less than this many standard deviations of the velocity's noise."""
USUAL_WIDTH = 5e-3
"""And, before the data have chosen, within this fraction of the root mean square velocity."""
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
    robot: Robot,
    recordings: Sequence[Recording],
    cutoff: float | None,
    settings: Settings,
    *,
    relative_width: float | Array = USUAL_WIDTH,
    rows: int | None = None,
) -> LinearProblem:
    """Smooth, differentiate, and sum up.

    Args:
        robot: The robot.
        recordings: At least one.
        cutoff: Of the low-pass [Hz]; None takes the samples as logged.
        settings: Friction columns, couplings, blocks, threads.
        relative_width: Of Coulomb's smooth sign, in root mean square velocities; one for all or by degree of freedom.
        rows: Take at most about this many samples of each recording.
    """
    motions = tuple(_thinned(motion_from_recording(robot, recording, cutoff), rows) for recording in recordings)
    width = settings.coulomb_width or tuple(coulomb_width(motions, relative_width).tolist())
    friction = tuple(
        dataclasses.replace(column, width=width) if isinstance(column, Coulomb) else column
        for column in settings.friction
    )
    regressor = build_regressor(robot, friction=friction, couplings=settings.couplings)
    return LinearProblem(regressor, motions, sum_moments(regressor, motions, settings))


def sum_moments(regressor: Regressor, motions: Sequence[Motion], settings: Settings) -> Moments:
    """Moments of all motions, their blocks one after the other."""
    blocks = max(MINIMUM_BLOCKS, -(-settings.blocks // len(motions)))
    parts = [
        accumulate_moments(regressor, motion.q, motion.v, motion.a, motion.tau, blocks=blocks, threads=settings.threads)
        for motion in motions
    ]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def coulomb_width(motions: Sequence[Motion], relative_width: float | Array) -> Array:
    """Velocity within which each degree of freedom's smooth sign turns, shape (nv,): never sharper than its noise."""
    noise = np.max([motion.velocity_noise for motion in motions], axis=0)
    speed = np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in motions], axis=0))
    return np.asarray(np.maximum(np.maximum(WIDTH_IN_NOISE * noise, relative_width * speed), 1e-9))


def _thinned(motion: Motion, rows: int | None) -> Motion:
    return motion if rows is None else motion.every(max(1, len(motion) // rows))

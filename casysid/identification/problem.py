"""From recordings and a cut-off to a regressor and its moments: the linear problem that is to be solved.

Two low-passes share one cut-off. Positions are smoothed at twice it before they are differentiated, so that no motion
is lost; the equations ``tau = Y θ`` are then averaged, both sides alike, up to it. What the encoders' noise adds to the
moments is found by adding as much noise once more, with both signs, to the logged positions, and going the same way
again: simulation-extrapolation (Cook and Stefanski 1994) with antithetic noise. It holds for every joint type and
regressor, and the noise has the colour that smoothing gives it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.dynamics import Coulomb, FrictionColumn, Regressor, build_regressor
from casysid.identification.settings import Settings
from casysid.moments import Moments
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import BandAverage, Motion, disturbed, motion_from_recording, position_noise

MOTION_TO_TORQUE_BAND = 2.0
"""Cut-off of the positions' smoothing over that of the equations' average."""
WIDTH_IN_NOISE = 3.0
"""Coulomb's smooth sign turns within no less than this many standard deviations of the velocity's noise."""
USUAL_WIDTH = 5e-3
"""And, before the data have chosen, within this fraction of the root mean square velocity."""
MINIMUM_BLOCKS = 4
SAMPLES_PER_PERIOD = 10
"""A decimated motion keeps so many samples in a period of its cut-off."""

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class LinearProblem:
    """One regression problem: ``tau = Y(q, v, a) θ`` over some recordings.

    Attributes:
        regressor: The regressor, its Coulomb width set by the motions' velocity noise.
        motions: The smoothed recordings, marked as standing where equations are left out.
        moments: Sums over all of them, in blocks of time.
        cutoff: Of the equations' average [Hz]; None when they are taken as they are.
    """

    regressor: Regressor
    motions: tuple[Motion, ...]
    moments: Moments
    cutoff: float | None


def build_problem(
    robot: Robot,
    recordings: Sequence[Recording],
    cutoff: float | None,
    settings: Settings,
    *,
    relative_width: float | Array = USUAL_WIDTH,
    moving_only: Mask | bool = False,
    quick: bool = False,
) -> LinearProblem:
    """Smooth, differentiate, and sum up.

    Args:
        robot: The robot.
        recordings: At least one.
        cutoff: Of the low-pass [Hz]; None takes the samples as logged.
        settings: Friction columns, couplings, blocks, threads.
        relative_width: Of Coulomb's smooth sign, in root mean square velocities; one for all or by degree of freedom.
        moving_only: Whether a degree of freedom's equations are taken only while it moves; one for all or by degree of
            freedom.
        quick: Decimate, and leave out what noise adds: for trials.
    """
    motions = tuple(make_motion(robot, recording, cutoff, quick=quick) for recording in recordings)
    motions = tuple(dataclasses.replace(motion, standing=motion.standing & moving_only) for motion in motions)
    friction = with_widths(settings, motions, relative_width)
    regressor = build_regressor(
        robot, friction=friction, couplings=settings.couplings, quasi_static=bool(settings.quasi_static)
    )
    moments = sum_moments(regressor, motions, cutoff, settings)
    if not (quick or cutoff is None):
        noise = _noise_moments(regressor, recordings, motions, moments, cutoff, settings)
        moments = dataclasses.replace(moments, noise=noise)
    return LinearProblem(regressor, motions, moments, cutoff)


def with_widths(
    settings: Settings, motions: Sequence[Motion], relative_width: float | Array
) -> tuple[FrictionColumn, ...]:
    """The friction columns asked for, Coulomb's smooth sign as sharp as the motions allow."""
    width = settings.coulomb_width or tuple(coulomb_width(motions, relative_width).tolist())
    return tuple(
        dataclasses.replace(column, width=width) if isinstance(column, Coulomb) else column
        for column in settings.friction
    )


def make_motion(robot: Robot, recording: Recording, cutoff: float | None, *, quick: bool = False) -> Motion:
    """A recording smoothed for equations up to ``cutoff`` [Hz]; ``quick`` drops samples far above it."""
    if cutoff is None or recording.time is None:
        return motion_from_recording(robot, recording, None)
    smoothing = MOTION_TO_TORQUE_BAND * cutoff
    motion = motion_from_recording(robot, recording, smoothing)
    return motion.decimated(int(recording.rate / (SAMPLES_PER_PERIOD * smoothing))) if quick else motion


def sum_moments(regressor: Regressor, motions: Sequence[Motion], cutoff: float | None, settings: Settings) -> Moments:
    """Moments of all motions, their blocks one after the other, each joint's without its stands."""
    blocks = max(MINIMUM_BLOCKS, -(-settings.blocks // len(motions)))
    parts = [
        accumulate_moments(
            regressor,
            motion.q,
            motion.v,
            motion.a,
            motion.tau,
            average=None if cutoff is None else BandAverage(motion.time, cutoff),
            valid=~motion.standing if motion.standing.any() else None,
            blocks=blocks,
            threads=settings.threads,
        )
        for motion in motions
    ]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def _noise_moments(
    regressor: Regressor,
    recordings: Sequence[Recording],
    motions: Sequence[Motion],
    here: Moments,
    cutoff: float,
    settings: Settings,
) -> Array:
    """By how much moments grow when the encoders' noise is added once more, shape of ``gram``."""
    grown = []
    for sign in (1.0, -1.0):
        noisier = []
        for seed, (recording, motion) in enumerate(zip(recordings, motions, strict=True)):
            noise = position_noise(recording.time, recording.position)  # type: ignore[arg-type]
            noisy = make_motion(regressor.robot, disturbed(recording, noise, sign, seed), cutoff)
            noisier.append(dataclasses.replace(noisy, standing=motion.standing))  # the same equations
        grown.append(sum_moments(regressor, noisier, cutoff, settings).gram)
    return np.asarray(0.5 * (grown[0] + grown[1]) - here.gram)


def coulomb_width(motions: Sequence[Motion], relative_width: float | Array) -> Array:
    """Velocity within which each degree of freedom's smooth sign turns, shape (nv,): never sharper than its noise."""
    noise = np.max([motion.velocity_noise for motion in motions], axis=0)
    speed = np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in motions], axis=0))
    return np.asarray(np.maximum(np.maximum(WIDTH_IN_NOISE * noise, relative_width * speed), 1e-9))

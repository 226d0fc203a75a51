"""From recordings and a cut-off to a regressor and its moments: the linear problem that is to be solved.

Two low-passes share one cut-off. Positions are smoothed at twice it before they are differentiated, so that no motion
is lost; the equations ``tau = Y θ`` are then averaged, both sides alike, up to it. What the encoders' noise adds to the
moments is found by adding as much noise once more to the logged positions and going the same way again
(:mod:`casysid.identification.noise_moments`). Noise so heavy that smoothing at twice the cut-off would let more of it
pass than it keeps of the motion, is smoothed lower.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.dynamics import FrictionKind, Regressor, build_regressor, with_width
from casysid.estimation import ErrorsInVariables
from casysid.identification.noise_moments import noise_moments
from casysid.identification.settings import Settings
from casysid.moments import Moments
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import (
    BandAverage,
    InputNoise,
    Motion,
    find_input_noise,
    mean_input_noise,
    motion_from_recording,
    smoothing_cutoff,
)

MOTION_TO_TORQUE_BAND = 2.0
"""Cut-off of the positions' smoothing over that of the equations' average."""
WIDTH_IN_NOISE = 2.0
"""Coulomb's smooth sign turns within no less than this many standard deviations of the velocity's noise."""
WIDTH_IN_GIVEN_NOISE = 0.3
"""And of the given noise of logged velocities, which extrapolation takes out of a sharper sign as well."""
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
        input_noise: Of the measured motion, over all recordings; None where it is not known or not asked for.
    """

    regressor: Regressor
    motions: tuple[Motion, ...]
    moments: Moments
    cutoff: float | None
    input_noise: InputNoise | None = None


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
    motions = make_motions(robot, recordings, cutoff, settings, moving_only=moving_only, quick=quick)
    noise = () if quick else tuple(_input_noise(recording, cutoff, settings) for recording in recordings)
    input_noise = mean_input_noise(noise)
    regressor = regressor_for(robot, motions, settings, relative_width, input_noise)
    moments = sum_moments(regressor, motions, cutoff, settings)
    if input_noise is not None:

        def sums_of(disturbed: Sequence[Recording]) -> Moments:
            noisier = [
                dataclasses.replace(
                    make_motion(robot, recording, cutoff, smoothing=motion.cutoff), standing=motion.standing
                )
                for recording, motion in zip(disturbed, motions, strict=True)  # the same equations, noisier
            ]
            return sum_moments(regressor, noisier, cutoff, settings)

        added = noise_moments(regressor, recordings, noise, moments, sums_of, as_logged=cutoff is None)
        moments = dataclasses.replace(moments, noise=added, noise_error=input_noise.relative_error)
    return LinearProblem(regressor, motions, moments, cutoff, input_noise)


def with_widths(
    settings: Settings,
    motions: Sequence[Motion],
    relative_width: float | Array,
    input_noise: InputNoise | None = None,
) -> tuple[FrictionKind, ...]:
    """The friction columns asked for, their smooth signs as sharp as the motions allow."""
    width = settings.coulomb_width or tuple(coulomb_width(motions, relative_width, input_noise).tolist())
    return with_width(settings.friction, width)


def regressor_for(
    robot: Robot,
    motions: Sequence[Motion],
    settings: Settings,
    relative_width: float | Array,
    input_noise: InputNoise | None = None,
) -> Regressor:
    """The regressor asked for, its smooth signs as sharp as the motions allow."""
    return build_regressor(
        robot,
        friction=with_widths(settings, motions, relative_width, input_noise),
        couplings=settings.couplings,
        quasi_static=bool(settings.quasi_static),
        torque_gains=settings.torque_gains,
    )


def make_motions(
    robot: Robot,
    recordings: Sequence[Recording],
    cutoff: float | None,
    settings: Settings,
    *,
    moving_only: Mask | bool,
    quick: bool,
) -> tuple[Motion, ...]:
    """The recordings smoothed, marked as standing where equations are left out; arguments as :func:`build_problem`."""
    motions = [
        make_motion(robot, recording, cutoff, smoothing=position_smoothing(recording, cutoff, settings), quick=quick)
        for recording in recordings
    ]
    return tuple(dataclasses.replace(motion, standing=motion.standing & moving_only) for motion in motions)


def _input_noise(recording: Recording, cutoff: float | None, settings: Settings) -> InputNoise | None:
    as_logged = cutoff is None or recording.time is None
    return find_input_noise(recording, settings.input_noise, as_logged=as_logged)


def make_motion(
    robot: Robot,
    recording: Recording,
    cutoff: float | None,
    *,
    smoothing: float | None = None,
    quick: bool = False,
) -> Motion:
    """A recording smoothed for equations up to ``cutoff`` [Hz].

    Args:
        robot: The robot.
        recording: The recording.
        cutoff: Of the equations' average [Hz]; None takes the samples as logged.
        smoothing: Cut-off of the positions [Hz]; None is twice the equations'.
        quick: Drop samples far above the cut-off.
    """
    if cutoff is None or recording.time is None:
        return motion_from_recording(robot, recording, None)
    highest = MOTION_TO_TORQUE_BAND * cutoff
    motion = motion_from_recording(robot, recording, highest if smoothing is None else smoothing)
    return motion.decimated(int(recording.rate / (SAMPLES_PER_PERIOD * highest))) if quick else motion


def position_smoothing(recording: Recording, cutoff: float | None, settings: Settings) -> float | None:
    """Cut-off of the positions' smoothing [Hz]: lower where noise is heavy and the method reckons with noise."""
    if cutoff is None or recording.time is None or not isinstance(settings.method, ErrorsInVariables):
        return None
    return smoothing_cutoff(recording.time, recording.position, MOTION_TO_TORQUE_BAND * cutoff)


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
        for motion in counted(motions, settings)
    ]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def counted(motions: Sequence[Motion], settings: Settings) -> Sequence[Motion]:
    """The motions without their ends where these do not count."""
    return [motion.without_ends() for motion in motions] if settings.ends is False else motions


def coulomb_width(
    motions: Sequence[Motion], relative_width: float | Array, input_noise: InputNoise | None = None
) -> Array:
    """Velocity within which each degree of freedom's smooth sign turns, shape (nv,): never sharper than its noise."""
    noise = WIDTH_IN_NOISE * np.max([motion.velocity_noise for motion in motions], axis=0)
    if input_noise is not None:
        noise = np.maximum(noise, WIDTH_IN_GIVEN_NOISE * input_noise.velocity)
    speed = np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in motions], axis=0))
    return np.asarray(np.maximum(np.maximum(noise, relative_width * speed), 1e-9))

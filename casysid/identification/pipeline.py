"""From recordings to identified parameters: prepare once, solve as often as there are methods to try."""

from __future__ import annotations

import dataclasses
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from casysid.arrays import Array
from casysid.errors import CasysidWarning, RecordingError
from casysid.estimation import Estimate
from casysid.identifiability import BaseParameters, excited_base_parameters, structural_base_parameters
from casysid.identification.coulomb import choose_relative_width
from casysid.identification.cutoff import COARSE_STEP, FINE_STEP, CutoffChoice, choose_cutoff
from casysid.identification.delay import DelayChoice, choose_delay, given_delay
from casysid.identification.equation_band import choose_equation_band
from casysid.identification.excerpts import excerpts
from casysid.identification.friction_choice import FrictionChoice, choose_friction
from casysid.identification.friction_laws import friction_laws
from casysid.identification.mistakes import Mistake, find_mistakes
from casysid.identification.prediction import torque_error
from casysid.identification.problem import (
    USUAL_WIDTH,
    LinearProblem,
    Mask,
    build_problem,
    make_motion,
    position_smoothing,
)
from casysid.identification.result import IdentificationResult
from casysid.identification.settings import Settings
from casysid.identification.standstill import choose_moving_only
from casysid.identification.stretch_ends import choose_ends
from casysid.identification.time_base import TimeBase, settle_time_base
from casysid.identification.torque_gains import TorqueGains, settle_torque_gains
from casysid.projection import ProjectionResult, build_projection, project
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import Motion, aligned
from casysid.signals.admission import FEWEST, FEWEST_TO_PREDICT, check_noise, check_recordings
from casysid.uncertainty import ParameterUncertainty, propagate

PRIOR_BUDGET = 0.03
"""Share of the residual energy that may be spent on staying near the model file where the data hardly see."""
Progress = Callable[[str, float], None]
"""Told the stage and the share of it that is done."""


def silent(stage: str, share: float) -> None:
    """No progress."""


@dataclass(frozen=True, eq=False)
class Preparation:
    """All that is read from the data: what every estimator starts from.

    Attributes:
        robot: The robot.
        time_base: What was found of the recordings' clock.
        mistakes: What in the recordings contradicts the model file.
        cutoff: The low-pass and why.
        delay: How late the torque is, and what was taken out of all recordings.
        friction: What the data added to the friction that was asked for.
        torque_gains: Of the joints relative to each other, and why.
        problem: Regressor, motions and moments of the fitted recordings.
        held_out: Motions that are only predicted.
        structural: Base parameters of the mechanism.
        seconds: Wall time by stage.
    """

    robot: Robot
    time_base: TimeBase
    mistakes: tuple[Mistake, ...]
    cutoff: CutoffChoice
    delay: DelayChoice
    friction: FrictionChoice
    torque_gains: TorqueGains
    problem: LinearProblem
    held_out: tuple[Motion, ...]
    structural: BaseParameters
    seconds: dict[str, float]


def identify(
    robot: Robot,
    recordings: Recording | Sequence[Recording],
    settings: Settings | None = None,
    *,
    held_out: Sequence[Recording] = (),
    progress: Progress = silent,
) -> IdentificationResult:
    """Identify a robot's parameters from recordings.

    Args:
        robot: The robot; its own parameters are the prior.
        recordings: What is fitted.
        settings: Hyperparameters; the defaults let the data decide.
        held_out: Recordings that are only predicted.
        progress: Told the stage and the share done.

    Raises:
        RecordingError: No recordings.
        SolverError: No consistent parameters could be found.
    """
    settings = settings or Settings()
    return solve(
        prepare(robot, recordings, settings, held_out=held_out, progress=progress), settings, progress=progress
    )


def prepare(
    robot: Robot,
    recordings: Recording | Sequence[Recording],
    settings: Settings,
    *,
    held_out: Sequence[Recording] = (),
    progress: Progress = silent,
) -> Preparation:
    """Settle cut-off, delay and friction's sharpness, and take the moments; arguments as in :func:`identify`."""
    fitted = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    if not fitted:
        raise RecordingError("identify: at least one recording to fit is needed; got none")
    for several, fewest in ((fitted, FEWEST), (held_out, FEWEST_TO_PREDICT)):
        check_recordings(
            several, cutoff=settings.cutoff, time_scale=settings.time_scale, delay=settings.delay, fewest=fewest
        )
    check_noise(fitted, settings.input_noise)
    clock = _Clock()
    fitted, held_out = (tuple(one.flipped(settings.flip) for one in several) for several in (fitted, held_out))
    time_base = settle_time_base(robot, fitted, settings)
    if time_base.reason:
        warnings.warn(time_base.reason, CasysidWarning, stacklevel=3)
    settings = dataclasses.replace(settings, quasi_static=time_base.quasi_static)
    fitted = tuple(recording.with_time_scaled(time_base.scale) for recording in fitted)
    unseen = tuple(recording.with_time_scaled(time_base.scale) for recording in held_out)
    mistakes = find_mistakes(robot, fitted)
    for mistake in mistakes:
        warnings.warn(mistake.sentence, CasysidWarning, stacklevel=3)
    cutoff, delay, width, moving_only, friction = _settle(robot, fitted, settings, progress)
    fitted, unseen = (tuple(aligned(one, delay.seconds) for one in several) for several in (fitted, unseen))
    clock.lap("tuning")
    progress("moments", 0.0)
    build = partial(build_problem, robot, fitted, relative_width=width, moving_only=moving_only)
    problem = build(cutoff.fitted, friction.settings)
    seen = problem if cutoff.equations is None else build(cutoff.cutoff, friction.settings, quick=True)
    gains = settle_torque_gains(seen.moments, problem.regressor.parameters, settings)
    if gains.found:
        warnings.warn(gains.reason, CasysidWarning, stacklevel=3)
        problem = build(cutoff.fitted, dataclasses.replace(friction.settings, torque_gains=tuple(gains.values)))
    predicted = tuple(
        make_motion(robot, one, cutoff.fitted, smoothing=position_smoothing(one, cutoff.fitted, settings))
        for one in unseen
    )
    structural = structural_base_parameters(problem.regressor)
    clock.lap("moments")
    progress("moments", 1.0)
    return Preparation(
        robot, time_base, mistakes, cutoff, delay, friction, gains, problem, predicted, structural, clock.laps
    )


def solve(preparation: Preparation, settings: Settings, *, progress: Progress = silent) -> IdentificationResult:
    """Estimate, make consistent, and check: everything after the data have been read."""
    problem, regressor = preparation.problem, preparation.problem.regressor
    clock = _Clock()
    progress("estimate", 0.0)
    estimate = settings.method.estimate(problem.moments, regressor.prior)
    clock.lap("estimate")
    progress("estimate", 1.0)
    projection, uncertainty = _project(problem, estimate, settings, progress)
    clock.lap("projection")
    progress("check", 0.0)
    parameters = estimate.parameters if projection is None else projection.parameters
    judged, band = preparation.held_out or problem.motions, preparation.cutoff.cutoff
    result = IdentificationResult(
        robot=preparation.robot,
        settings=settings,
        time_base=preparation.time_base,
        mistakes=preparation.mistakes,
        cutoff=preparation.cutoff,
        delay=preparation.delay,
        friction=preparation.friction,
        torque_gains=preparation.torque_gains,
        regressor=regressor,
        moments=problem.moments,
        estimate=estimate,
        projection=projection,
        uncertainty=uncertainty,
        structural=preparation.structural,
        excited=excited_base_parameters(regressor, problem.moments, estimate.noise_std),
        unconstrained=torque_error(regressor, estimate.parameters, judged, band),
        train=torque_error(regressor, parameters, problem.motions, band),
        held_out=torque_error(regressor, parameters, preparation.held_out, band) if preparation.held_out else None,
        file=torque_error(regressor, regressor.prior, judged, band),
        train_motions=problem.motions,
        held_out_motions=preparation.held_out,
        input_noise=problem.input_noise,
        seconds={**preparation.seconds, **clock.laps},
    )
    progress("check", 1.0)
    return result


def _project(
    problem: LinearProblem, estimate: Estimate, settings: Settings, progress: Progress
) -> tuple[ProjectionResult | None, ParameterUncertainty]:
    """The nearest consistent parameters in the estimate's own metric, None if not asked for; and how sure they are."""
    regressor, moments = problem.regressor, problem.moments
    if settings.consistency is None:
        return None, propagate(estimate, moments, regressor.parameters)
    progress("projection", 0.0)
    projection = build_projection(
        regressor.parameters,
        consistency=settings.consistency,
        knowledge=(*settings.knowledge, *friction_laws(regressor)),
        prior_budget=PRIOR_BUDGET,
    )
    energy = moments.pooled(estimate.noise_std**-2.0).residual_energy(estimate.parameters)
    prior = regressor.prior
    found = project(projection, estimate.parameters, estimate.metric, prior, residual_energy=energy)
    uncertainty = propagate(estimate, moments, regressor.parameters, projection, found, prior, residual_energy=energy)
    progress("projection", 1.0)
    return found, uncertainty


def _settle(
    robot: Robot, recordings: Sequence[Recording], settings: Settings, progress: Progress
) -> tuple[CutoffChoice, DelayChoice, Array, Mask, FrictionChoice]:
    """Ends, cut-off, sharpness of Coulomb friction, stands to leave out, each given the others; roughly, then finely.

    The cut-off is chosen with all stands in, so that all candidates are judged by the same equations. The second time
    the torque's delay has been taken out. Further kinds of friction are chosen last. Of long recordings, excerpts are
    looked at, but for these.
    """
    width, moving_only = np.full(robot.nv, USUAL_WIDTH), np.zeros(robot.nv, dtype=bool)
    delay, parts, asked = given_delay(robot, 0.0), excerpts(recordings), settings
    for pace, step in (("rough", COARSE_STEP), ("fine", FINE_STEP)):
        fitted = [aligned(recording, delay.seconds) for recording in parts]
        settings = dataclasses.replace(settings, ends=choose_ends(robot, fitted, asked))
        cutoff = choose_cutoff(
            robot,
            fitted,
            settings,
            relative_width=width,
            step=step,
            progress=lambda share, pace=pace: progress(f"cut-off, {pace}", share),  # type: ignore[misc]
        )
        moving_only = choose_moving_only(robot, fitted, cutoff.cutoff, settings, width)
        width = choose_relative_width(
            robot,
            fitted,
            cutoff.cutoff,
            settings,
            moving_only,
            lambda share, pace=pace: progress(f"friction, {pace}", share),  # type: ignore[misc]
        )
        if pace == "rough":
            progress("delay", 0.0)
            delay = choose_delay(robot, parts, cutoff.cutoff, settings, width)
            progress("delay", 1.0)
    friction = FrictionChoice(settings)
    if settings.choose_friction:
        progress("friction, kinds", 0.0)
        whole = [aligned(recording, delay.seconds) for recording in recordings]
        friction = choose_friction(robot, whole, cutoff.cutoff, settings, width, moving_only)
        if friction.chosen:
            width = choose_relative_width(robot, fitted, cutoff.cutoff, friction.settings, moving_only)
        progress("friction, kinds", 1.0)
    cutoff = choose_equation_band(robot, fitted, cutoff, friction.settings, width, moving_only)
    return cutoff, delay, width, moving_only, friction


class _Clock:
    """Wall time by stage."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._start = time.perf_counter()

    def lap(self, stage: str) -> None:
        """End a stage and start the next."""
        now = time.perf_counter()
        self.laps[stage] = now - self._start
        self._start = now

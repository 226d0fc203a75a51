"""From recordings to identified parameters: prepare once, solve as often as there are methods to try."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.dynamics import Regressor
from casysid.errors import CasysidWarning, RecordingError
from casysid.estimation import Estimate
from casysid.identifiability import BaseParameters, excited_base_parameters, structural_base_parameters
from casysid.identification.choices import Choices
from casysid.identification.choosing import Progress, choose
from casysid.identification.friction_laws import friction_laws
from casysid.identification.noise_moments import with_noise
from casysid.identification.order import as_given, places_by_content
from casysid.identification.passes import Mapped, Passes, excerpts, is_long
from casysid.identification.result import IdentificationResult
from casysid.identification.sameness import check_sameness
from casysid.identification.settings import Settings
from casysid.identification.unknown_forces import is_free, settings_for, with_noise_of_known
from casysid.moments import Moments
from casysid.projection import (
    KeptLink,
    PossibleParameters,
    ProjectionProblem,
    ProjectionResult,
    build_projection,
    project,
)
from casysid.recording import Source
from casysid.recording.even_stamps import evened
from casysid.robot import Robot
from casysid.robot.likely_bodies import believed
from casysid.signals import InputNoise, Motion
from casysid.signals.admission import FEWEST, FEWEST_TO_PREDICT, check_noise, check_recordings
from casysid.threads import single_threaded
from casysid.uncertainty import ParameterUncertainty, propagate

PRIOR_BUDGET = 0.03
"""Share of the residual energy that may be spent on staying near the model file where the data hardly see."""


def silent(stage: str, share: float) -> None:
    """No progress."""


@dataclass(frozen=True, eq=False)
class Preparation:
    """All that is read from the data: what every estimator starts from.

    Attributes:
        robot: The robot as its file has it.
        choices: What was chosen on the way.
        regressor: With the friction that was chosen; its prior is the file's without what no body can be.
        moments: Of the fitted recordings, with what noise added if some method needs it.
        motions: Of the fitted recordings, or of excerpts of long ones.
        held_out: Motions that are only predicted, alike.
        passes: Over the fitted recordings.
        unseen: Over the recordings that are only predicted; None if there are none.
        input_noise: Of the measured motion; None where no method needs it, or it is not known.
        structural: Base parameters of the mechanism.
        places: In the order of the moments' blocks, the places of the fitted recordings as they were given.
        seconds: Wall time by stage.
    """

    robot: Robot
    choices: Choices
    regressor: Regressor
    moments: Moments
    motions: tuple[Motion, ...]
    held_out: tuple[Motion, ...]
    passes: Passes
    unseen: Passes | None
    input_noise: InputNoise | None
    structural: BaseParameters
    places: tuple[int, ...]
    seconds: dict[str, float]


@single_threaded()
def identify(
    robot: Robot,
    recordings: Source | Sequence[Source],
    settings: Settings | None = None,
    *,
    held_out: Sequence[Source] = (),
    progress: Progress = silent,
) -> IdentificationResult:
    """Identify a robot's parameters from recordings.

    Args:
        robot: The robot; its own parameters are the prior, where they are those of a body (:func:`believed`).
        recordings: What is fitted.
        settings: Hyperparameters; the defaults let the data decide.
        held_out: Recordings that are only predicted.
        progress: Called with the stage and the share done.

    Raises:
        RecordingError: No recordings.
        SolverError: No consistent parameters could be found.
    """
    settings = settings or Settings()
    return solve(
        prepare(robot, recordings, settings, held_out=held_out, progress=progress), settings, progress=progress
    )


@single_threaded()
def prepare(
    robot: Robot,
    recordings: Source | Sequence[Source],
    settings: Settings,
    *,
    held_out: Sequence[Source] = (),
    noise_too: bool = False,
    progress: Progress = silent,
    mapped: Mapped = map,
) -> Preparation:
    """Choose what the data decide, and take the moments.

    Args:
        robot: As for :func:`identify`.
        recordings: Likewise.
        settings: Likewise.
        held_out: Likewise.
        noise_too: Whether what noise adds to the moments is wanted although ``settings.method`` does not need it.
        progress: Likewise.
        mapped: Does one thing to each of many recordings: cuts excerpts, sums equations and errors.
    """
    fitted = (recordings,) if isinstance(recordings, Source) else tuple(recordings)
    if not fitted:
        raise RecordingError("identify: at least one recording to fit is needed; got none")
    for several, fewest in ((fitted, FEWEST), (held_out, FEWEST_TO_PREDICT)):
        check_recordings(
            several,
            cutoff=settings.cutoff,
            time_scale=settings.time_scale,
            delay=settings.delay,
            fewest=fewest,
            base_is_free=is_free(robot),
        )
    settings = settings_for(robot, (*fitted, *held_out), settings)
    check_noise(fitted, settings.input_noise)
    check_sameness(fitted, held_out)
    fitted, held_out = evened(fitted), evened(held_out)
    clock = _Clock()
    fitted, held_out = (tuple(one.flipped(settings.flip) for one in several) for several in (fitted, held_out))
    places = places_by_content(fitted)
    fitted = tuple(fitted[place] for place in places)
    progress("tuning", 0.0)
    witness = believed(robot, [known.link for known in settings.knowledge if isinstance(known, KeptLink)])
    if witness.sentence:
        warnings.warn(witness.sentence, CasysidWarning, stacklevel=3)
    chosen = choose(witness.robot, fitted, settings, progress, mapped)
    clock.lap("tuning")
    progress("moments", 0.0)
    regressor, moments, passes = chosen.regressor, chosen.moments, chosen.passes
    noise = None
    if noise_too or settings.method.needs_input_noise:
        moments, noise = with_noise(moments, regressor, passes, settings.input_noise)
    scale, delay, band = chosen.choices.clock.scale, chosen.choices.delay, chosen.choices.band
    later = [one.with_time_scaled(scale) for one in held_out]
    unseen = Passes(witness.robot, later, band, delays=delay.seconds, mapped=mapped)
    structural = structural_base_parameters(regressor)
    clock.lap("moments")
    progress("moments", 1.0)
    return Preparation(
        robot=robot,
        choices=chosen.choices,
        regressor=regressor,
        moments=moments,
        motions=as_given(chosen.looked_at.motions, places),
        held_out=_shown(unseen, mapped),
        passes=passes,
        unseen=unseen if held_out else None,
        input_noise=noise,
        structural=structural,
        places=places,
        seconds=clock.laps,
    )


def _shown(passes: Passes, mapped: Mapped) -> tuple[Motion, ...]:
    """The motions of recordings, or of excerpts of long ones."""
    if not is_long(passes.recordings):
        return passes.motions
    return Passes(passes.robot, excerpts(passes.recordings, mapped), passes.band).motions


@single_threaded()
def solve(preparation: Preparation, settings: Settings, *, progress: Progress = silent) -> IdentificationResult:
    """Estimate, make consistent, and check: everything after the data have been read."""
    regressor, moments, prior = preparation.regressor, preparation.moments, preparation.regressor.prior
    clock = _Clock()
    progress("estimate", 0.0)
    problem = _projection_problem(regressor, settings)
    estimate = _estimate(regressor, moments, settings, problem)
    clock.lap("estimate")
    progress("estimate", 1.0)
    progress("projection", 0.0)
    projection, uncertainty = _project(regressor, moments, problem, estimate)
    clock.lap("projection")
    progress("projection", 1.0)
    progress("check", 0.0)
    parameters = estimate.parameters if projection is None else projection.parameters
    band = preparation.choices.band.errors
    passes, unseen = preparation.passes, preparation.unseen
    own = preparation.robot.inertial_parameters
    vectors = [parameters, estimate.parameters, np.concatenate([own, prior[own.size :]])]
    fitted = [parameters] if unseen else vectors
    errors = tuple(one.as_given(preparation.places) for one in passes.errors(regressor, fitted, band))
    judged = unseen.errors(regressor, vectors, band) if unseen else errors
    result = IdentificationResult(
        robot=preparation.robot,
        settings=settings,
        choices=preparation.choices,
        regressor=regressor,
        moments=moments,
        estimate=estimate,
        projection=projection,
        uncertainty=uncertainty,
        structural=preparation.structural,
        excited=excited_base_parameters(regressor, moments, estimate.noise_std),
        unconstrained=judged[1],
        train=errors[0],
        held_out=judged[0] if unseen else None,
        file=judged[2],
        train_motions=preparation.motions,
        held_out_motions=preparation.held_out,
        input_noise=preparation.input_noise,
        seconds={**preparation.seconds, **clock.laps},
    )
    progress("check", 1.0)
    return result


def _projection_problem(regressor: Regressor, settings: Settings) -> ProjectionProblem | None:
    """What parameters have to obey; None if nothing is asked for."""
    if settings.consistency is None:
        return None
    return build_projection(
        regressor.parameters,
        consistency=settings.consistency,
        knowledge=(*settings.knowledge, *friction_laws(regressor)),
        prior_budget=PRIOR_BUDGET,
    )


def fit(
    regressor: Regressor, moments: Moments, settings: Settings
) -> tuple[Estimate, ProjectionResult | None, ParameterUncertainty]:
    """Estimate and make consistent, from moments alone; see :func:`solve`."""
    problem = _projection_problem(regressor, settings)
    estimate = _estimate(regressor, moments, settings, problem)
    return (estimate, *_project(regressor, moments, problem, estimate))


def _estimate(
    regressor: Regressor, moments: Moments, settings: Settings, problem: ProjectionProblem | None
) -> Estimate:
    if problem is None:
        return with_noise_of_known(settings.method.estimate(moments, regressor.prior), moments)
    possible = PossibleParameters(problem, regressor.prior)
    return with_noise_of_known(settings.method.estimate_among(moments, regressor.prior, possible), moments)


def _project(
    regressor: Regressor, moments: Moments, problem: ProjectionProblem | None, estimate: Estimate
) -> tuple[ProjectionResult | None, ParameterUncertainty]:
    """The nearest consistent parameters in the estimate's own metric, None if not asked for; and how sure they are."""
    if problem is None:
        return None, propagate(estimate, moments, regressor.parameters)
    energy = moments.pooled(estimate.noise_std**-2.0).residual_energy(estimate.parameters)
    prior = regressor.prior
    found = project(problem, estimate.parameters, estimate.metric, prior, residual_energy=energy)
    uncertainty = propagate(estimate, moments, regressor.parameters, problem, found, prior, residual_energy=energy)
    return found, uncertainty


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

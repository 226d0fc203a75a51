"""From recordings to identified parameters: prepare once, solve as often as there are methods to try."""

from __future__ import annotations

import dataclasses
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import JointUse, Regressor
from casysid.errors import CasysidWarning, RecordingError
from casysid.estimation import Estimate
from casysid.identifiability import BaseParameters, excited_base_parameters, structural_base_parameters
from casysid.identification.aside import gains_of_the_rest
from casysid.identification.choices import Choices
from casysid.identification.friction_laws import friction_laws
from casysid.identification.mistakes import find_mistakes
from casysid.identification.noise_moments import with_noise
from casysid.identification.order import as_given, places_by_content
from casysid.identification.passes import Mapped, Passes, excerpts, is_long
from casysid.identification.result import IdentificationResult
from casysid.identification.sameness import check_sameness
from casysid.identification.settings import Settings
from casysid.identification.tuning.band import BandChoice, choose_band
from casysid.identification.tuning.candidates import Candidates, final_regressor, gather_candidates, moments_of
from casysid.identification.tuning.clock import choose_clock
from casysid.identification.tuning.delay import choose_delay
from casysid.identification.tuning.friction_selection import FrictionChoice, fit_model, select_friction
from casysid.identification.tuning.ripples import ripple_uses
from casysid.identification.unknown_forces import (
    describe_equations,
    has_unknown_forces,
    is_free,
    settings_for,
    with_noise_of_known,
)
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
from casysid.robot import Robot
from casysid.robot.likely_bodies import believed
from casysid.signals import InputNoise, Motion
from casysid.signals.admission import FEWEST, FEWEST_TO_PREDICT, check_noise, check_recordings
from casysid.threads import single_threaded
from casysid.uncertainty import ParameterUncertainty, propagate

PRIOR_BUDGET = 0.03
"""Share of the residual energy that may be spent on staying near the model file where the data hardly see."""
Progress = Callable[[str, float], None]
"""Called with the stage and the share of it that is done."""


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
    clock = _Clock()
    fitted, held_out = (tuple(one.flipped(settings.flip) for one in several) for several in (fitted, held_out))
    places = places_by_content(fitted)
    fitted = tuple(fitted[place] for place in places)
    progress("tuning", 0.0)
    witness = believed(robot, [known.link for known in settings.knowledge if isinstance(known, KeptLink)])
    if witness.sentence:
        warnings.warn(witness.sentence, CasysidWarning, stacklevel=3)
    chosen = _choose(witness.robot, fitted, settings, progress, mapped)
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


@dataclass(frozen=True, eq=False)
class _Chosen:
    """Choices, the regressor and the moments that they led to, and passes over all and over what was looked at."""

    choices: Choices
    regressor: Regressor
    moments: Moments
    passes: Passes
    looked_at: Passes


def _choose(
    robot: Robot, recordings: Sequence[Source], settings: Settings, progress: Progress, mapped: Mapped
) -> _Chosen:
    """Band, clock, delay, friction and gains, each given those before; recordings are smoothed anew for a new clock."""
    whole, recordings = recordings, excerpts(recordings, mapped)
    band = choose_band(whole, settings.cutoff)
    passes, candidates = _gather(robot, recordings, band, settings)
    progress("tuning", 0.3)
    clock = choose_clock(passes, candidates, settings.time_scale, settings.quasi_static)
    if clock.reason:
        warnings.warn(clock.reason, CasysidWarning, stacklevel=4)
    settings = dataclasses.replace(settings, quasi_static=clock.quasi_static)
    work = [passes]
    if clock.scale != 1.0 or clock.quasi_static:
        whole, recordings = (tuple(one.with_time_scaled(clock.scale) for one in some) for some in (whole, recordings))
        band = choose_band(whole, settings.cutoff)
        passes, candidates = _gather(robot, recordings, band, settings)
        work.append(passes)
    mistakes = () if has_unknown_forces(recordings) else find_mistakes(robot, passes.sparse_motions, band.cutoff)
    for mistake in mistakes:
        warnings.warn(mistake.sentence, CasysidWarning, stacklevel=4)
    progress("tuning", 0.5)
    delay = choose_delay(passes, candidates.base, settings.delay)
    usual = fit_model(candidates, candidates.model(), settings) if candidates.proposals else None
    uses = None if usual is None else ripple_uses(passes, candidates, usual)
    if uses or not delay.is_none:
        passes, candidates = _gather(robot, recordings, band, settings, delay.seconds, uses)
        work.append(passes)
    progress("tuning", 0.7)
    friction = select_friction(candidates, settings, usual) if usual else FrictionChoice(settings)
    regressor = final_regressor(candidates, settings, [proposal for proposal, _ in friction.taken])
    moments = moments_of(regressor, candidates, friction.taken)
    gains = gains_of_the_rest(moments, regressor, settings)
    if gains.found:
        warnings.warn(gains.reason, CasysidWarning, stacklevel=4)
        settings = dataclasses.replace(settings, torque_gains=tuple(gains.values.tolist()))
        regressor = final_regressor(candidates, settings, [proposal for proposal, _ in friction.taken])
        moments = passes.moments(regressor)
    friction = dataclasses.replace(
        friction,
        settings=dataclasses.replace(settings, friction=regressor.friction, couplings=regressor.couplings),
    )
    looked_at = passes
    if is_long(whole):
        passes = Passes(
            robot,
            whole,
            band,
            delays=delay.seconds,
            blocks=settings.blocks,
            threads=settings.threads,
            mapped=mapped,
        ).like(passes)
        moments = passes.moments(regressor)
        work.append(passes)
    choices = Choices(
        band=band,
        width=passes.width if settings.coulomb_width is None else np.full(robot.nv, settings.coulomb_width),
        clock=clock,
        mistakes=mistakes,
        delay=delay,
        friction=friction,
        gains=gains,
        smoothings=sum(one.smoothings for one in work),
        passes=sum(one.passes for one in work),
        equations=describe_equations(robot, whole),
    )
    return _Chosen(choices, regressor, moments, passes, looked_at)


def _gather(
    robot: Robot,
    recordings: Sequence[Source],
    band: BandChoice,
    settings: Settings,
    delays: Array | None = None,
    uses: Mapping[int, JointUse] | None = None,
) -> tuple[Passes, Candidates]:
    passes = Passes(robot, recordings, band, delays=delays, blocks=settings.blocks, threads=settings.threads)
    return passes, gather_candidates(passes, settings, uses)


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

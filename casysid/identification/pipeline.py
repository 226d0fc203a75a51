"""From recordings to identified parameters."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.estimation import Estimate
from casysid.identifiability import excited_base_parameters, structural_base_parameters
from casysid.identification.coulomb import choose_relative_width
from casysid.identification.cutoff import COARSE_STEP, FINE_STEP, CutoffChoice, choose_cutoff
from casysid.identification.prediction import torque_error
from casysid.identification.problem import USUAL_WIDTH, LinearProblem, build_problem
from casysid.identification.result import IdentificationResult
from casysid.identification.settings import Settings
from casysid.projection import ProjectionResult, build_projection, project
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import motion_from_recording

Progress = Callable[[str, float], None]
"""Told the stage and the share of it that is done."""


def _silent(stage: str, share: float) -> None:
    """No progress."""


def identify(
    robot: Robot,
    recordings: Recording | Sequence[Recording],
    settings: Settings | None = None,
    *,
    held_out: Sequence[Recording] = (),
    progress: Progress = _silent,
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
    """
    settings = settings or Settings()
    fitted = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    if not fitted:
        raise RecordingError("identify: at least one recording to fit is needed; got none")
    clock = _Clock()
    cutoff, width = _settle(robot, fitted, settings, progress)
    clock.lap("tuning")
    progress("moments", 0.0)
    problem = build_problem(robot, fitted, cutoff.cutoff, settings, relative_width=width)
    clock.lap("moments")
    progress("estimate", 0.0)
    regressor = problem.regressor
    estimate = settings.method.estimate(problem.moments, regressor.prior)
    clock.lap("estimate")
    projection = _project(problem, estimate, settings, progress)
    clock.lap("projection")
    progress("check", 0.0)
    parameters = estimate.parameters if projection is None else projection.parameters
    held_out_motions = tuple(motion_from_recording(robot, recording, cutoff.cutoff) for recording in held_out)
    judged = held_out_motions or problem.motions
    structural = structural_base_parameters(regressor)
    excited = excited_base_parameters(regressor, problem.moments, estimate.noise_std)
    train = torque_error(regressor, parameters, problem.motions)
    unseen = torque_error(regressor, parameters, held_out_motions) if held_out_motions else None
    unconstrained = torque_error(regressor, estimate.parameters, judged)
    file = torque_error(regressor, regressor.prior, judged)
    clock.lap("check")
    progress("check", 1.0)
    return IdentificationResult(
        robot=robot,
        settings=settings,
        cutoff=cutoff,
        regressor=regressor,
        estimate=estimate,
        projection=projection,
        structural=structural,
        excited=excited,
        unconstrained=unconstrained,
        train=train,
        held_out=unseen,
        file=file,
        train_motions=problem.motions,
        held_out_motions=held_out_motions,
        seconds=clock.laps,
    )


def _project(
    problem: LinearProblem, estimate: Estimate, settings: Settings, progress: Progress
) -> ProjectionResult | None:
    """The nearest consistent parameters in the estimate's own metric; None when consistency is not asked for."""
    if settings.consistency is None:
        return None
    progress("projection", 0.0)
    regressor = problem.regressor
    projection = build_projection(regressor.parameters, consistency=settings.consistency, knowledge=settings.knowledge)
    weighted = problem.moments.pooled(estimate.noise_std**-2.0)
    return project(
        projection,
        estimate.parameters,
        estimate.metric,
        regressor.prior,
        residual_energy=weighted.residual_energy(estimate.parameters),
    )


def _settle(
    robot: Robot, recordings: Sequence[Recording], settings: Settings, progress: Progress
) -> tuple[CutoffChoice, Array]:
    """Cut-off and sharpness of Coulomb friction, each chosen given the other; first roughly, then finely."""
    width: float | Array = USUAL_WIDTH
    for step in (COARSE_STEP, FINE_STEP):
        pace = "rough" if step == COARSE_STEP else "fine"
        cutoff = choose_cutoff(
            robot,
            recordings,
            settings,
            relative_width=width,
            step=step,
            progress=lambda share, pace=pace: progress(f"cut-off, {pace}", share),  # type: ignore[misc]
        )
        width = choose_relative_width(
            robot,
            recordings,
            cutoff.cutoff,
            settings,
            lambda share, pace=pace: progress(f"friction, {pace}", share),  # type: ignore[misc]
        )
    return cutoff, np.broadcast_to(width, robot.nv)


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

"""From recordings to identified parameters."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from casysid.errors import RecordingError
from casysid.identifiability import excited_base_parameters, structural_base_parameters
from casysid.identification.cutoff import choose_cutoff
from casysid.identification.prediction import torque_error
from casysid.identification.problem import build_problem
from casysid.identification.result import IdentificationResult
from casysid.identification.settings import Settings
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
    cutoff = choose_cutoff(robot, fitted, settings, lambda share: progress("cut-off", share))
    clock.lap("cut-off")
    progress("moments", 0.0)
    problem = build_problem(robot, fitted, cutoff.cutoff, settings)
    clock.lap("moments")
    progress("estimate", 0.0)
    regressor = problem.regressor
    estimate = settings.method.estimate(problem.moments, regressor.prior)
    clock.lap("estimate")
    progress("check", 0.0)
    held_out_motions = tuple(motion_from_recording(robot, recording, cutoff.cutoff) for recording in held_out)
    judged = held_out_motions or problem.motions
    structural = structural_base_parameters(regressor)
    excited = excited_base_parameters(regressor, problem.moments, estimate.noise_std)
    train = torque_error(regressor, estimate.parameters, problem.motions)
    unseen = torque_error(regressor, estimate.parameters, held_out_motions) if held_out_motions else None
    file = torque_error(regressor, regressor.prior, judged)
    clock.lap("check")
    progress("check", 1.0)
    return IdentificationResult(
        robot=robot,
        settings=settings,
        cutoff=cutoff,
        regressor=regressor,
        estimate=estimate,
        parameters=estimate.parameters,
        structural=structural,
        excited=excited,
        train=train,
        held_out=unseen,
        file=file,
        train_motions=problem.motions,
        held_out_motions=held_out_motions,
        seconds=clock.laps,
    )


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

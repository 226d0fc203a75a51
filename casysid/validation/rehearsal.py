"""The whole experiment rehearsed in simulation, where the truth is known, before the real robot moves.

A machine that differs from its file, by as much as machines do, is excited, recorded through imperfect sensors, and
identified by the ordinary pipeline; then what came out is compared with what was hidden.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.identification import IdentificationResult, Settings, identify
from casysid.robot import Robot
from casysid.simulation import (
    PD,
    ControlModel,
    Plant,
    PlantSettings,
    SimulatedRun,
)
from casysid.threads import single_threaded
from casysid.validation.exciting import Excitation, excite
from casysid.validation.perturbation import hidden_truth
from casysid.validation.tracking import Tracking, measure_tracking, track
from casysid.validation.truth import (
    BaseComparison,
    compare_base_parameters,
    true_coefficients,
    true_torque_error,
)

Progress = Callable[[str, float], None]
SHORTEST = 4.0
LONGEST_TRACKING = 10.0


def _silent(stage: str, share: float) -> None:
    """No progress."""


@dataclass(frozen=True, kw_only=True)
class RehearsalSettings:
    """What is rehearsed; nothing of it needs to be said.

    Attributes:
        duration: Of the recording to fit, and of the one held out [s].
        rate: Of controller and log [Hz].
        seed: Of the hidden truth, the motions and the sensors' noise.
        excitation: What moves the machine while the recording to fit is made; the one held out has sinusoids always.
        inertia_spread: How far links differ from the file: see :func:`casysid.validation.hidden_truth`.
        friction_spread: How far friction and armature do.
        plant: What the machine does beside rigid-body dynamics, and its sensors.
        identification: Of the pipeline.
        recording_bandwidth: Of the feedback while recording [Hz]: stiff, so that friction holds no joint.
        bandwidth: Of the feedback while tracking is judged [Hz]: soft, so that the model shows.
    """

    duration: float = 30.0
    rate: float = 500.0
    seed: int = 0
    excitation: Excitation = Excitation.SINUSOIDS
    inertia_spread: float = 0.1
    friction_spread: float = 0.3
    plant: PlantSettings = field(default_factory=PlantSettings)
    identification: Settings = field(default_factory=Settings)
    recording_bandwidth: float = 6.0
    bandwidth: float = 3.0

    def __post_init__(self) -> None:
        if not SHORTEST <= self.duration < np.inf:
            raise ParameterError(f"rehearsal: duration must be at least {SHORTEST:g} s; got {self.duration}")
        if self.seed < 0:
            raise ParameterError(f"rehearsal: seed must be a whole number from 0 up; got {self.seed}")


@dataclass(frozen=True, eq=False, kw_only=True)
class Rehearsal:
    """What came out of a rehearsal.

    Attributes:
        settings: What was asked for.
        plant: The machine, with the hidden truth.
        train: The run that was fitted.
        held_out: The run that was predicted.
        result: The ordinary identification.
        base: Identified against true parameters.
        torque_error: Against the true torque of the held-out run, relative by joint, shape (nv,), by the parameters'
            name: ``file``, ``identified``, ``true``.
        tracking_runs: Computed torque along a third motion, by the parameters' name.
        tracking: Their errors.
    """

    settings: RehearsalSettings
    plant: Plant
    train: SimulatedRun
    held_out: SimulatedRun
    result: IdentificationResult
    base: BaseComparison
    torque_error: Mapping[str, Array]
    tracking_runs: Mapping[str, SimulatedRun]
    tracking: Mapping[str, Tracking]

    def to_json(self) -> dict[str, object]:
        """Plain numbers, lists and words."""
        dofs = self.plant.robot.dofs
        result = self.result
        return {
            "robot": self.plant.robot.name,
            "seed": self.settings.seed,
            "excitation": self.settings.excitation.value,
            "duration": self.settings.duration,
            "rate": self.settings.rate,
            "method": result.estimate.method,
            "status": result.status.value,
            "physically_consistent": result.is_physically_consistent,
            "held_out_error": {"file": result.file.relative, "identified": _relative(result)},
            "true_torque_error": {
                name: {"mean": float(np.mean(error)), "by_joint": dict(zip(dofs, error.tolist(), strict=True))}
                for name, error in self.torque_error.items()
            },
            "tracking": {name: tracking.to_json(dofs) for name, tracking in self.tracking.items()},
            "base_parameters": self.base.to_json(),
        }


@single_threaded()
def rehearse(robot: Robot, settings: RehearsalSettings | None = None, progress: Progress = _silent) -> Rehearsal:
    """Rehearse the identification of a robot on a machine that differs from its file.

    Args:
        robot: Its file's parameters are what the user believes beforehand.
        settings: The defaults need no thought.
        progress: Told the stage and the share done.

    Raises:
        RobotError: The robot cannot be simulated.
        RecordingError: The machine ran away too early for anything to be identified.
    """
    settings = settings or RehearsalSettings()
    plant = build_machine(robot, settings)
    drill = _Drill(plant, settings, progress)
    believed = ControlModel.from_robot(robot)
    train, held_out = (drill.record(believed, k, stage) for k, stage in enumerate(("record", "record again")))
    result = identify(robot, train.recording, settings.identification, held_out=[held_out.recording], progress=progress)
    regressor = result.regressor
    parameters = {
        "file": regressor.prior,
        "identified": result.parameters,
        "true": true_coefficients(plant, regressor),
    }
    runs = {name: drill.track(ControlModel(regressor, theta), f"track: {name}") for name, theta in parameters.items()}
    return Rehearsal(
        settings=settings,
        plant=plant,
        train=train,
        held_out=held_out,
        result=result,
        base=compare_base_parameters(result, plant),
        torque_error=true_torque_error(regressor, parameters, held_out),
        tracking_runs=runs,
        tracking={name: measure_tracking(plant, run) for name, run in runs.items()},
    )


def build_machine(robot: Robot, settings: RehearsalSettings) -> Plant:
    """The machine with the hidden truth."""
    truth = hidden_truth(
        robot,
        settings.plant.mechanics,
        settings.seed,
        inertia_spread=settings.inertia_spread,
        friction_spread=settings.friction_spread,
    )
    return Plant(robot, settings.plant, truth)


@dataclass(frozen=True, eq=False)
class _Drill:
    """The motions of a rehearsal, numbered; gains are as one would have tuned them on the machine."""

    plant: Plant
    settings: RehearsalSettings
    progress: Progress

    def record(self, model: ControlModel, number: int, stage: str) -> SimulatedRun:
        """A motion to fit or to predict."""
        settings = self.settings
        kind = settings.excitation if number == 0 else Excitation.SINUSOIDS
        return self._run(model, number, stage, settings.duration, settings.recording_bandwidth, kind)

    def track(self, model: ControlModel, stage: str) -> SimulatedRun:
        """The motion on which models are compared."""
        duration = min(self.settings.duration, LONGEST_TRACKING)
        return self._run(model, 2, stage, duration, self.settings.bandwidth, Excitation.SINUSOIDS)

    def _run(
        self, model: ControlModel, number: int, stage: str, duration: float, bandwidth: float, kind: Excitation
    ) -> SimulatedRun:
        self.progress(stage, 0.0)
        plant, seed, rate = self.plant, 3 * self.settings.seed + number, self.settings.rate
        motion = excite(plant.robot, kind, duration=duration, rate=rate, seed=seed)
        gains = PD.tuned(plant.robot, plant.parameters, bandwidth=bandwidth)
        run = track(plant, model, gains, motion, rate=rate, duration=duration, seed=seed)
        self.progress(stage, 1.0)
        return run


def _relative(result: IdentificationResult) -> float:
    return (result.held_out or result.train).relative

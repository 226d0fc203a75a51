"""The robots of Ting et al. (2006), §IV-B and §IV-C, in simulation: recorded, identified by each method, and tracked.

Each seed is a machine of its own that differs from its model file. All methods of the paper see the same moments:
positions through one zero-phase low-pass, the same regressor, the same weights between joints, no prior. Beyond the
paper is weighted least squares with a filter that the data chose, without the samples at which a joint stands, because
stiction has no column.
"""

from __future__ import annotations

import dataclasses
import functools
import operator
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from casysid.accumulation import accumulate_moments
from casysid.bundled import find_model
from casysid.dynamics import DEFAULT_FRICTION, FrictionColumn, Regressor, Viscous
from casysid.errors import CasysidError, CasysidWarning
from casysid.estimation import LassoRegression, Ridge, StepwiseRegression, WeightedLeastSquares
from casysid.estimation.base import Estimate, Estimator
from casysid.estimation.bayesian import BayesianDenoising
from casysid.identification import Settings, choose_cutoff
from casysid.identification.coulomb import choose_relative_width
from casysid.identification.problem import USUAL_WIDTH, LinearProblem, build_problem, coulomb_width
from casysid.moments import Moments
from casysid.projection import build_projection, project
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import build_smoother, motion_from_recording
from casysid.simulation import PD, ControlModel, Plant, PlantSettings, Sensing, SimulatedRun, design_sinusoids
from casysid.validation import hidden_truth, measure_tracking, track, true_coefficients

CUTOFF = 20.0  # [Hz], of the low-pass that all of the paper's methods share: twenty times the fastest sinusoid
SOFT, STIFF = 3.0, 6.0  # [Hz], bandwidth of the feedback where tracking is judged, and in recordings
PIECES = 8  # recordings, each along sinusoids of its own
EVALUATION = 20.0  # [s] of each trajectory that is tracked
STANDING = 0.1  # of the joint's root mean square velocity; and no less than
STANDING_WIDTHS = 3.0  # widths of Coulomb's smooth sign, which is then within 0.5 % of one
FEW_ROWS = 100_000  # are as good as all once the low-pass has made neighbours alike
HAND_TUNED = np.geomspace(1e-8, 1e1, 10)

SENSING = Sensing(position_noise=2e-4, position_resolution=3.8e-4, torque_noise=0.014)
"""Fixed before any method was run: encoders of 14 bits with noise of half a step, torque noise of 1.4 % of the effort
limit, as the two low-cost robots among eight real ones have (a desktop arm, a pendulum with direct drives)."""

FAILURE = float("inf")


@dataclass(frozen=True)
class Experiment:
    """One robot, one machine, one level of noise.

    Attributes:
        robot: ``head`` or ``arm``.
        rate: Of control [Hz].
        samples: That are fitted.
        stride: Of these, one in so many that were recorded.
        seed: Of machine, motions and noise.
        noise: Factor on every sensor's noise and resolution.
        paper_features: Ten inertial parameters and viscous friction a joint, as in the paper; else Coulomb friction,
            offset and armature too.
        moving: Whether the paper's methods, too, are spared the samples at which a joint stands.
    """

    robot: str
    rate: float
    samples: int
    stride: int
    seed: int
    noise: float = 1.0
    paper_features: bool = False
    moving: bool = False

    @property
    def friction(self) -> tuple[FrictionColumn, ...]:
        """The regressor's drive columns."""
        return (Viscous(),) if self.paper_features else DEFAULT_FRICTION

    def build_plant(self) -> Plant:
        """The machine, its sensors as noisy as asked for."""
        names = ("position_noise", "position_resolution", "torque_noise", "torque_resolution")
        louder = {name: self.noise * getattr(SENSING, name) for name in names}
        settings = PlantSettings(sensing=dataclasses.replace(SENSING, **louder))
        robot = Robot.from_file(find_model(f"{self.robot}.xml"))
        return Plant(robot, settings, hidden_truth(robot, settings.mechanics, self.seed))

    def follow(
        self, plant: Plant, model: ControlModel, duration: float, motion: int, bandwidth: float = SOFT
    ) -> SimulatedRun:
        """Computed torque along the motion of that number; the gains are the same whatever the model."""
        seed = 1000 * self.seed + motion
        trajectory = design_sinusoids(plant.robot, duration=duration, seed=seed)
        gains = PD.tuned(plant.robot, plant.parameters, bandwidth=bandwidth)
        return track(plant, model, gains, trajectory, rate=self.rate, duration=duration, seed=seed)


@dataclass(frozen=True)
class Outcome:
    """What one machine showed: measures by method, what was tuned, and remarks."""

    measures: Mapping[str, Mapping[str, float]]
    remarks: Mapping[str, str] = field(default_factory=dict)


def record_piece(experiment: Experiment, piece: int, folder: Path) -> Path:
    """One of the recordings, the model file's parameters in control, as an NPZ file."""
    plant = experiment.build_plant()
    count = experiment.samples * experiment.stride // PIECES
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CasysidWarning)
        run = experiment.follow(plant, ControlModel.from_robot(plant.robot), count / experiment.rate, piece, STIFF)
    rows = slice(None, None, experiment.stride)
    path = folder / f"{experiment.robot}-{experiment.seed}-{experiment.noise:g}-{piece}.npz"
    log = run.recording
    np.savez(path, time=log.time[rows], position=log.position[rows], torque=log.torque[rows])
    return path


def evaluate(experiment: Experiment, pieces: Sequence[Path]) -> Outcome:
    """Every method on the recordings, and how the machine tracks with what it found."""
    warnings.simplefilter("ignore", CasysidWarning)  # weak answers are what the tables show
    plant = experiment.build_plant()
    recordings = [_read(plant.robot, path) for path in pieces]
    settings = Settings(friction=experiment.friction, threads=1)
    problem = build_problem(plant.robot, recordings, CUTOFF, settings)
    moments = moving_moments(problem, recordings, CUTOFF) if experiment.moving else problem.moments
    problem = dataclasses.replace(
        problem, motions=(), moments=moments
    )  # the moments are all that is needed from here on
    tuning = experiment.follow(plant, ControlModel.from_robot(plant.robot), EVALUATION, 500)
    models: dict[str, ControlModel | None] = {}
    remarks: dict[str, str] = {}
    for name, fit in METHODS.items():
        try:
            model, remark = fit(problem, plant, recordings, tuning)
        except CasysidError as error:
            model, remark = None, f"{type(error).__name__}: {error}"
        models[name] = model
        if remark:
            remarks[name] = remark
    return Outcome({name: _measure(experiment, plant, model) for name, model in models.items()}, remarks)


def _read(robot: Robot, path: Path) -> Recording:
    with np.load(path) as data:
        return Recording(channels=robot.channels, dofs=robot.dofs, **data)


def _measure(experiment: Experiment, plant: Plant, model: ControlModel | None) -> Mapping[str, float]:
    """RMS position error, velocity error and feedback command, averaged over the degrees of freedom."""
    if model is None:
        return dict.fromkeys(("position", "velocity", "feedback"), FAILURE)
    try:
        return measure_tracking(plant, experiment.follow(plant, model, EVALUATION, 501)).means()
    except CasysidError:  # the first command is not even finite
        return dict.fromkeys(("position", "velocity", "feedback"), FAILURE)


Fitted = tuple[ControlModel | None, str]
Method = Callable[[LinearProblem, Plant, Sequence[Recording], SimulatedRun], Fitted]


def project_estimate(regressor: Regressor, moments: Moments, estimate: Estimate) -> ControlModel:
    """The consistent parameters nearest to an estimate; directions without any torque are taken from the file."""
    weighted = moments.pooled(estimate.noise_std**-2.0)
    answer = project(
        build_projection(regressor.parameters),
        estimate.parameters,
        estimate.metric,
        regressor.prior,
        residual_energy=weighted.residual_energy(estimate.parameters),
    )
    return ControlModel(regressor, answer.parameters)


def by_estimator(estimator: Estimator) -> Method:
    """An estimator without prior, then the projection."""

    def fit(problem: LinearProblem, plant: Plant, recordings: Sequence[Recording], tuning: SimulatedRun) -> Fitted:
        estimate = estimator.estimate(problem.moments)
        figures = ", ".join(f"{name} {value:.3g}" for name, value in estimate.diagnostics.items())
        return project_estimate(problem.regressor, problem.moments, estimate), f"{estimate.status.value}; {figures}"

    return fit


def hand_tuned_ridge(
    problem: LinearProblem, plant: Plant, recordings: Sequence[Recording], tuning: SimulatedRun
) -> Fitted:
    """The strength that predicts the *true* torque of another motion best: no hand does better."""
    best, chosen, least = None, float("nan"), np.inf
    for strength in HAND_TUNED:
        model = project_estimate(problem.regressor, problem.moments, Ridge(strength).estimate(problem.moments))
        predicted = model.inverse_dynamics(tuning.q, tuning.v, tuning.a)
        error = float(np.mean(np.sqrt(np.mean((predicted - tuning.tau) ** 2, axis=0))))
        if error < least:
            best, chosen, least = model, strength, error
    return best, f"strength {chosen:.1e}"


def beyond(estimator: Estimator) -> Method:
    """An estimator with the file's prior, the data's filter and moving joints alone; then the projection."""

    def fit(problem: LinearProblem, plant: Plant, recordings: Sequence[Recording], tuning: SimulatedRun) -> Fitted:
        settings = Settings(friction=problem_friction(problem), threads=1)
        few = recordings[:2]
        cutoff = choose_cutoff(plant.robot, few, settings).cutoff
        width = choose_relative_width(plant.robot, few, cutoff, settings)
        own = build_problem(plant.robot, recordings, cutoff, settings, relative_width=width)
        moments = moving_moments(own, recordings, cutoff)
        estimate = estimator.estimate(moments, own.regressor.prior)
        return project_estimate(own.regressor, moments, estimate), f"cut-off {cutoff:.3g} Hz"

    return fit


def moving_moments(problem: LinearProblem, recordings: Sequence[Recording], cutoff: float | None) -> Moments:
    """Moments of a problem's regressor, each joint's equations only from samples at which it moves."""
    regressor = problem.regressor
    motions = [motion_from_recording(regressor.robot, recording, cutoff) for recording in recordings]
    standing = np.maximum(STANDING_WIDTHS * coulomb_width(motions, USUAL_WIDTH), coulomb_width(motions, STANDING))
    stride = max(1, sum(map(len, motions)) // FEW_ROWS)
    parts = []
    for motion, recording in zip(motions, recordings, strict=True):
        torque = recording.torque
        if cutoff is not None:
            torque = build_smoother(motion.time, cutoff).smooth(torque)
        q, v, a, tau = (x[::stride] for x in (motion.q, motion.v, motion.a, torque))
        p, dofs = len(regressor.names), regressor.robot.dofs
        gram, count = np.zeros((4, len(dofs), p + 1, p + 1)), np.zeros((4, len(dofs)))
        for k in range(len(dofs)):
            moving = np.abs(v[:, k]) > standing[k]
            if moving.sum() >= len(gram):  # else the joint stood all the time
                part = accumulate_moments(regressor, q, v, a, tau, valid=moving, blocks=len(gram), threads=1)
                gram[:, k], count[:, k] = part.gram[:, k], part.count[:, k]
        parts.append(Moments(gram, count, regressor.names, dofs))
    return functools.reduce(operator.add, parts)


def problem_friction(problem: LinearProblem) -> tuple[FrictionColumn, ...]:
    """The kinds of drive columns that a problem has."""
    kinds = {one.kind for one in problem.regressor.parameters}
    return tuple(column for column in DEFAULT_FRICTION if column.kind in kinds)


def file_parameters(
    problem: LinearProblem, plant: Plant, recordings: Sequence[Recording], tuning: SimulatedRun
) -> Fitted:
    """What the model file says."""
    return ControlModel(problem.regressor, problem.regressor.prior), ""


def true_parameters(
    problem: LinearProblem, plant: Plant, recordings: Sequence[Recording], tuning: SimulatedRun
) -> Fitted:
    """The machine's own parameters."""
    return ControlModel(problem.regressor, true_coefficients(plant, problem.regressor)), ""


METHODS: dict[str, Method] = {
    "Bayesian de-noising": by_estimator(BayesianDenoising()),
    "ridge (cross-validated)": by_estimator(Ridge()),
    "ridge (hand-tuned)": hand_tuned_ridge,
    "LASSO": by_estimator(LassoRegression()),
    "stepwise": by_estimator(StepwiseRegression()),
    "weighted least squares, own filter": beyond(WeightedLeastSquares()),
    "model file": file_parameters,
    "true parameters": true_parameters,
}

"""The robots of Ting et al. (2006), §IV-B and §IV-C, in simulation: recorded, identified by each method, and tracked.

Each seed is a machine of its own that differs from its model file. The paper's methods see what its authors had: motion
by differences of the encoders' positions at the control rate, all signals behind the low-pass of the controller's
velocity; the same moments, regressor and weights between joints for all, no prior. The noise of accelerations is then
as large as they are, and one joint's is in the columns of every link that it moves: it keeps the columns' relations, so
that a model with noise of its own in each column cannot see it. Two rows beside the paper's take it out of the moments
by what the encoders' noise adds to them. Beyond the paper are casysid's own: motion from a spline, equations averaged
in a band derived from the motion, the model file as prior, and equations of joints near rest with a noise of their own.
"""

from __future__ import annotations

import dataclasses
import functools
import operator
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from casysid.arrays import Array
from casysid.bundled import find_model
from casysid.dynamics import DEFAULT_FRICTION, Regressor, Viscous, build_regressor, with_width
from casysid.errors import CasysidError, CasysidWarning
from casysid.estimation import (
    EmpiricalBayes,
    ErrorsInVariables,
    LassoRegression,
    Ridge,
    StepwiseRegression,
    WeightedLeastSquares,
)
from casysid.estimation.base import Estimate, Estimator
from casysid.estimation.bayesian import BayesianDenoising
from casysid.identification import Settings, choose_band
from casysid.identification.noise_moments import with_noise
from casysid.identification.passes import Passes, sum_moments
from casysid.moments import Moments
from casysid.projection import PossibleParameters, build_projection, project
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import Motion, motion_from_recording, position_noise
from casysid.simulation import PD, ControlModel, Plant, PlantSettings, Sensing, SimulatedRun, design_sinusoids
from casysid.validation import hidden_truth, measure_tracking, track, true_coefficients

CUTOFF = (
    20.0  # [Hz], of the spline when the paper's methods are given smoothed motion: twenty times the fastest sinusoid
)
SOFT, STIFF = 3.0, 6.0  # [Hz], bandwidth of the feedback where tracking is judged, and in recordings
PIECES = 8  # recordings, each along sinusoids of its own
BLOCKS = 4  # of time in each
WIDTH_IN_NOISE, WIDTH = 2.0, 5e-3
"""Coulomb friction of the paper's methods turns within so many standard deviations of the velocity's noise, or within
this share of its root mean square where that is more."""
EVALUATION = 20.0  # [s] of each trajectory that is tracked
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
        smoothed: Whether the paper's methods are given motion from a spline instead of differences.
    """

    robot: str
    rate: float
    samples: int
    stride: int
    seed: int
    noise: float = 1.0
    paper_features: bool = False
    smoothed: bool = False

    @property
    def settings(self) -> Settings:
        """The regressor's drive columns; one thread, for processes run beside each other."""
        friction = (Viscous(),) if self.paper_features else DEFAULT_FRICTION
        return Settings(friction=friction, threads=1, blocks=PIECES * BLOCKS)

    def build_plant(self) -> Plant:
        """The machine, its sensors as noisy as asked for."""
        names = ("position_noise", "position_resolution", "torque_noise", "torque_resolution")
        louder = {name: self.noise * getattr(SENSING, name) for name in names}
        settings = PlantSettings(sensing=dataclasses.replace(SENSING, **louder))
        return dataclasses.replace(build_machine(self.robot, self.seed), settings=settings)

    def follow(
        self, plant: Plant, model: ControlModel, duration: float, motion: int, bandwidth: float = SOFT
    ) -> SimulatedRun:
        """Computed torque along the motion of that number; the gains are the same whatever the model."""
        seed = 1000 * self.seed + motion
        trajectory = design_sinusoids(plant.robot, duration=duration, seed=seed)
        gains = tune(self.robot, self.seed, bandwidth)
        return track(plant, model, gains, trajectory, rate=self.rate, duration=duration, seed=seed)


@functools.cache
def build_machine(robot: str, seed: int) -> Plant:
    """A machine that differs from its model file, with the usual sensors; built once in each process."""
    settings, model = PlantSettings(), Robot.from_file(find_model(f"{robot}.xml"))
    return Plant(model, settings, hidden_truth(model, settings.mechanics, seed))


@functools.cache
def tune(robot: str, seed: int, bandwidth: float) -> PD:
    """Gains as one would have tuned them on the machine."""
    plant = build_machine(robot, seed)
    return PD.tuned(plant.robot, plant.parameters, bandwidth=bandwidth)


@functools.cache
def believe(robot: str, seed: int) -> ControlModel:
    """What the model file says, before anything is identified."""
    return ControlModel.from_robot(build_machine(robot, seed).robot)


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
        model = believe(experiment.robot, experiment.seed)
        run = experiment.follow(plant, model, count / experiment.rate, piece, STIFF)
    log, rows = run.recording, slice(None, None, experiment.stride)
    signals = {"position": log.position, "torque": log.torque}
    noise = position_noise(log.time, log.position)  # type: ignore[arg-type]
    for name, values in differentiate(log.position, log.torque, experiment.rate).items():
        signals[f"filtered_{name}"] = values
    path = folder / f"{experiment.robot}-{experiment.seed}-{experiment.noise:g}-{piece}.npz"
    np.savez(path, time=log.time[rows], noise=noise, **{name: values[rows] for name, values in signals.items()})
    return path


def differentiate(position: Array, torque: Array, rate: float) -> dict[str, Array]:
    """Positions, their backward differences and those of these, and torques, all twice behind the same low-pass."""
    velocity = np.diff(position, axis=0, prepend=position[:1]) * rate
    acceleration = np.diff(velocity, axis=0, prepend=velocity[:1]) * rate
    signals = {"position": position, "velocity": velocity, "acceleration": acceleration, "torque": torque}
    return {name: _low_pass(_low_pass(values, rate), rate) for name, values in signals.items()}


def _low_pass(values: Array, rate: float) -> Array:
    """The first-order low-pass of the controller's velocity, at rest at first."""
    gain = 1.0 - np.exp(-2.0 * np.pi * SENSING.velocity_cutoff / rate)
    return np.asarray(lfilter([gain], [1.0, gain - 1.0], values - values[0], axis=0) + values[0])


def filter_gain(rate: float) -> float:
    """Standard deviation of such a velocity for white noise of unit variance on positions [1/s]."""
    impulse = np.zeros((1000, 1))
    impulse[1] = 1.0
    return float(np.linalg.norm(differentiate(impulse, impulse, rate)["velocity"]))


@dataclass(frozen=True, eq=False)
class Problem:
    """A regressor with its moments, and the cut-off of the equations [Hz]; None where there was no average."""

    regressor: Regressor
    moments: Moments
    cutoff: float | None


@dataclass(frozen=True)
class Recorded:
    """The recordings of one experiment, read when they are needed."""

    experiment: Experiment
    plant: Plant
    pieces: Sequence[Path]

    @cached_property
    def tuning(self) -> SimulatedRun:
        """A motion that is neither fitted nor judged."""
        model = believe(self.experiment.robot, self.experiment.seed)
        return self.experiment.follow(self.plant, model, EVALUATION, 500)

    @cached_property
    def paper(self) -> Problem:
        """What the paper's methods see."""
        motions: Sequence[Motion]
        if self.experiment.smoothed:
            band = choose_band(self._positions(), CUTOFF)
            passes = Passes(self.plant.robot, self._positions(), band)
            regressor = self._blunt_regressor(passes.motions)
            moments = sum_moments(regressor, passes.sparse_motions, CUTOFF, blocks=BLOCKS, threads=1)
            return Problem(regressor, moments, CUTOFF)
        motions = [self._logged(path) for path in self.pieces]
        regressor = self._blunt_regressor(motions)
        parts = []
        for motion in motions:  # one by one: all disturbed motions at once would take much memory
            here, *grown = (
                sum_moments(regressor, [one], None, blocks=BLOCKS, threads=1)
                for one in (motion, self._disturbed(motion, 1.0), self._disturbed(motion, -1.0))
            )
            squares = zip(*(one.squares for one in grown), here.squares, strict=True)
            noise = tuple(0.5 * (one + two) - own for one, two, own in squares)
            parts.append(dataclasses.replace(here, noise=noise))
        return Problem(regressor, functools.reduce(operator.add, parts), None)

    def _blunt_regressor(self, motions: Sequence[Motion]) -> Regressor:
        """Coulomb friction no sharper than the noise of velocities."""
        noise = np.max([motion.velocity_noise for motion in motions], axis=0)
        speed = np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in motions], axis=0))
        width = tuple(np.maximum(WIDTH_IN_NOISE * noise, WIDTH * speed).tolist())
        return build_regressor(self.plant.robot, friction=with_width(self.experiment.settings.friction, width))

    def _logged(self, path: Path) -> Motion:
        """The signals as the paper's authors had them."""
        robot = self.plant.robot
        with np.load(path) as data:
            signals = {name.removeprefix("filtered_"): data[name] for name in data if name.startswith("filtered_")}
            log = Recording(channels=robot.channels, dofs=robot.dofs, time=data["time"], **signals)
            velocity_noise = filter_gain(self.experiment.rate) * data["noise"]
        return dataclasses.replace(motion_from_recording(robot, log, None), velocity_noise=velocity_noise)

    def _disturbed(self, motion: Motion, sign: float) -> Motion:
        """The same motion with the encoders' noise once more, behind the same filters."""
        stride, rate = self.experiment.stride, self.experiment.rate
        sigma = motion.velocity_noise / filter_gain(rate)
        noise = sign * sigma * np.random.default_rng(len(motion)).normal(size=(stride * len(motion), len(sigma)))
        added = {name: values[::stride] for name, values in differentiate(noise, noise, rate).items()}
        q, v, a = motion.q + added["position"], motion.v + added["velocity"], motion.a + added["acceleration"]
        return dataclasses.replace(motion, q=q, v=v, a=a)

    @cached_property
    def own(self) -> Problem:
        """What casysid makes of the recordings, in the band that it derives from them."""
        settings, recordings = self.experiment.settings, self._positions()
        band = choose_band(recordings)
        passes = Passes(self.plant.robot, recordings, band, blocks=settings.blocks, threads=settings.threads)
        friction = with_width(settings.friction, tuple(passes.width.tolist()))
        regressor = build_regressor(self.plant.robot, friction=friction)
        moments, _ = with_noise(passes.moments(regressor), regressor, passes, settings.input_noise)
        return Problem(regressor, moments, band.cutoff)

    def _positions(self) -> list[Recording]:
        robot, recordings = self.plant.robot, []
        for path in self.pieces:
            with np.load(path) as data:
                logged = {name: data[name] for name in ("time", "position", "torque")}
                recordings.append(Recording(channels=robot.channels, dofs=robot.dofs, **logged))
        return recordings


def evaluate(experiment: Experiment, pieces: Sequence[Path]) -> Outcome:
    """Every method on the recordings, and how the machine tracks with what it found."""
    warnings.simplefilter("ignore", CasysidWarning)  # weak answers are what the tables show
    recorded = Recorded(experiment, experiment.build_plant(), pieces)
    measures: dict[str, Mapping[str, float]] = {}
    remarks: dict[str, str] = {}
    for name, fit in METHODS.items():
        model: ControlModel | None = None
        try:
            model, remark = fit(recorded)
        except CasysidError as error:
            remark = f"{type(error).__name__}: {error}"
        measures[name] = _measure(experiment, recorded.plant, model)
        if remark:
            remarks[name] = remark
    return Outcome(measures, remarks)


def _measure(experiment: Experiment, plant: Plant, model: ControlModel | None) -> Mapping[str, float]:
    """RMS position error, velocity error and feedback command, averaged over the degrees of freedom."""
    if model is None:
        return dict.fromkeys(("position", "velocity", "feedback"), FAILURE)
    try:
        return measure_tracking(plant, experiment.follow(plant, model, EVALUATION, 501)).means()
    except CasysidError:  # the first command is not even finite
        return dict.fromkeys(("position", "velocity", "feedback"), FAILURE)


Fitted = tuple[ControlModel, str]
Method = Callable[[Recorded], Fitted]


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


def of_paper(estimator: Estimator) -> Method:
    """An estimator without prior on what the paper's methods see; then the projection."""

    def fit(recorded: Recorded) -> Fitted:
        problem = recorded.paper
        estimate = estimator.estimate(problem.moments)
        figures = ", ".join(f"{name} {value:.3g}" for name, value in estimate.diagnostics.items())
        return project_estimate(problem.regressor, problem.moments, estimate), f"{estimate.status.value}; {figures}"

    return fit


def hand_tuned_ridge(recorded: Recorded) -> Fitted:
    """The strength that predicts the *true* torque of another motion best: no hand does better."""
    problem, run = recorded.paper, recorded.tuning
    found = []
    for strength in HAND_TUNED:
        model = project_estimate(problem.regressor, problem.moments, Ridge(strength).estimate(problem.moments))
        predicted = model.inverse_dynamics(run.q, run.v, run.a)
        found.append((float(np.mean(np.sqrt(np.mean((predicted - run.tau) ** 2, axis=0)))), strength, model))
    _, strength, model = min(found, key=lambda one: one[0])
    return model, f"strength {strength:.1e}"


def of_casysid(estimator: Estimator) -> Method:
    """An estimator with the file's prior and possible parameters on casysid's own equations; then the projection."""

    def fit(recorded: Recorded) -> Fitted:
        problem, prior = recorded.own, recorded.own.regressor.prior
        possible = PossibleParameters(build_projection(problem.regressor.parameters), prior)
        estimate = estimator.estimate_among(problem.moments, prior, possible)
        return project_estimate(problem.regressor, problem.moments, estimate), f"cut-off {problem.cutoff:.3g} Hz"

    return fit


def file_parameters(recorded: Recorded) -> Fitted:
    """What the model file says."""
    return believe(recorded.experiment.robot, recorded.experiment.seed), ""


def true_parameters(recorded: Recorded) -> Fitted:
    """The machine's own parameters; of what it does, springs, lag and stiction have no column."""
    regressor = believe(recorded.experiment.robot, recorded.experiment.seed).regressor
    return ControlModel(regressor, true_coefficients(recorded.plant, regressor)), ""


METHODS: dict[str, Method] = {
    "Bayesian de-noising": of_paper(BayesianDenoising()),
    "ridge (cross-validated)": of_paper(Ridge()),
    "ridge (hand-tuned)": hand_tuned_ridge,
    "LASSO": of_paper(LassoRegression()),
    "stepwise": of_paper(StepwiseRegression()),
    "Bayesian de-noising, encoder noise": of_paper(ErrorsInVariables(BayesianDenoising(vector="noisy"))),
    "errors in variables": of_paper(ErrorsInVariables()),
    "weighted least squares, own filter": of_casysid(WeightedLeastSquares()),
    "empirical Bayes, own filter": of_casysid(EmpiricalBayes()),
    "errors in variables, own filter": of_casysid(ErrorsInVariables()),
    "model file": file_parameters,
    "true parameters": true_parameters,
}

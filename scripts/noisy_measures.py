"""What is measured on noisy trials, one trial at a time, so that trials may run side by side."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from noisy_trials import RATE, best_rival, consistent_least_squares, denoised_problem, make_trial, unordered_trial

from casysid.accumulation import accumulate_moments
from casysid.estimation import BayesianDenoising, ErrorsInVariables, WeightedLeastSquares
from casysid.identification import Settings, identify
from casysid.signals import position_noise

NOISE, HIGHEST = (1e-5, 1e-4, 1e-3), (2.0, 6.0)
FLAT_RATIOS = (1.5, 2.0, 3.0, 4.0, 6.0)
SHARES = (0.03, 0.1)
STEPS = (0.0, 1e-4)
DELAY = 5e-3
EIV = Settings(method=ErrorsInVariables(), threads=1)
"""Trials run side by side, so each takes one thread."""
Row = dict[str, Any]


@dataclass(frozen=True)
class Measure:
    """A figure of merit over a grid of trials.

    Attributes:
        grid: Names and values that a trial is made for, beside robot and seed.
        run: Figures of one trial: ``run(robot, seed, size, **place on the grid)``.
        summarise: A row of the table from the trials of one place on the grid that differ by their seeds.
        limits: By column of the table: largest allowed value.
    """

    grid: dict[str, tuple[float, ...]]
    run: Callable[..., Row]
    summarise: Callable[[Sequence[Row]], Row]
    limits: dict[str, float]

    def places(self, robots: Sequence[str], seeds: int) -> list[Row]:
        """Everything that there is to run, seed by seed: who stops has fewer seeds, but all of the grid."""
        values = product(range(seeds), robots, *self.grid.values())
        return [dict(zip(("seed", "robot", *self.grid), chosen, strict=True)) for chosen in values]

    def table(self, trials: Sequence[Row]) -> list[Row]:
        """One row for every place on the grid that has trials."""
        groups: dict[tuple[Any, ...], list[Row]] = {}
        for trial in trials:
            groups.setdefault(tuple(trial[name] for name in ("robot", *self.grid)), []).append(trial)
        return [
            {"robot": Path(str(place[0])).stem, **dict(zip(self.grid, place[1:], strict=True)), "seeds": len(group)}
            | self.summarise(group)
            for place, group in groups.items()
        ]


def rms(values: Sequence[float]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def accuracy(robot: str, seed: int, size: float, noise: float, highest: float) -> Row:
    """Errors of `identify` with nothing told, of the best rival, and of least squares that knows the true motion."""
    trial = make_trial(robot, seed, noise, highest, duration=size)
    error, cutoff = best_rival(trial, highest)
    result = identify(trial.robot, trial.recording, EIV)
    motion, regressor = trial.clean, trial.regressor
    exact = accumulate_moments(regressor, motion.q, motion.v, motion.a, trial.recording.torque)
    return {
        "ours": trial.error_of(result),
        "rival": error,
        "true motion": trial.error(consistent_least_squares(regressor, exact)),
        "rival's cut-off": cutoff,
        "cut-off": result.cutoff.cutoff,
        "motion": result.cutoff.motion_band,
        "further friction": len(result.friction.chosen),
    }


def summarise_accuracy(trials: Sequence[Row]) -> Row:
    """Root mean squares over the seeds and their ratio."""
    names = ("ours", "rival", "true motion")
    found = {name: rms([trial[name] for trial in trials]) for name in names}
    return {**found, "ours / rival": found["ours"] / found["rival"]}


def flatness(robot: str, seed: int, size: float, noise: float, highest: float) -> Row:
    """Errors with and without correction over given cut-offs."""
    trial = make_trial(robot, seed, noise, highest, duration=size)
    found: Row = {"eiv": [], "wls": []}
    for name, method in (("eiv", ErrorsInVariables()), ("wls", WeightedLeastSquares())):
        for ratio in FLAT_RATIOS:
            regressor, moments = denoised_problem(trial, ratio * highest, EIV)
            estimate = method.estimate(moments, regressor.prior)
            found[name].append(trial.error(estimate.parameters))
    return found


def summarise_flatness(trials: Sequence[Row]) -> Row:
    """Root mean squares over the seeds by cut-off, and the largest over the smallest."""
    over = {
        name: [rms(column) for column in zip(*(trial[name] for trial in trials), strict=True)]
        for name in ("eiv", "wls")
    }
    return over | {f"spread of {name}": max(found) / min(found) for name, found in over.items()}


def unordered(robot: str, seed: int, size: float, share: float) -> Row:
    """Error variances on samples in random order, levels of the noise given or not."""
    trial, levels = unordered_trial(robot, seed, 1e-3, share, samples=int(size * RATE))
    methods = {"least squares": WeightedLeastSquares(), "Bayes": BayesianDenoising(), "eiv": ErrorsInVariables()}
    found = {}
    for told, settings in (("", Settings(threads=1)), (", given", Settings(input_noise=levels, threads=1))):
        regressor, moments = denoised_problem(trial, None, settings)
        for name, method in methods.items():
            if not told or name == "eiv":  # the others do not use the levels
                estimate = method.estimate(moments, regressor.prior)
                found[name + told] = trial.error(estimate.parameters) ** 2
    return found


def summarise_unordered(trials: Sequence[Row]) -> Row:
    """Means over the seeds."""
    names = ("least squares", "Bayes", "eiv", "eiv, given")
    found = {name: float(np.mean([trial[name] for trial in trials])) for name in names}
    given = found["eiv, given"]
    return found | {"of least squares": given / found["least squares"], "of Bayes": given / found["Bayes"]}


def noise(robot: str, seed: int, size: float, noise: float, highest: float, step: float) -> Row:
    """Estimated noise of the positions over the true, with and without quantisation."""
    trial = make_trial(robot, seed, noise, highest, duration=size)
    logged = trial.recording.position
    logged = np.round(logged / step) * step if step else logged
    true = np.sqrt(np.mean((logged - trial.clean.channels) ** 2, axis=0))
    ratios = position_noise(trial.recording.time, logged) / true
    return {"lowest": float(ratios.min()), "largest": float(ratios.max())}


def summarise_noise(trials: Sequence[Row]) -> Row:
    """The extremes over joints and seeds."""
    lowest, largest = min(trial["lowest"] for trial in trials), max(trial["largest"] for trial in trials)
    return {"lowest": lowest, "largest": largest, "off by": max(1.0 - lowest, largest - 1.0)}


def delay(robot: str, seed: int, size: float, noise: float, highest: float) -> Row:
    """Error with torques 5 ms late over that of the same recording without, and of the delay that is found."""
    errors, found = [], []
    for late in (0.0, DELAY):
        trial = make_trial(robot, seed, noise, highest, duration=size, delay=late)
        result = identify(trial.robot, trial.recording, EIV)
        errors.append(trial.error_of(result))
        found.append(float(np.abs(result.delay.seconds - late).max() * RATE))
    return {"in time": errors[0], "late": errors[1], "missed": found[1], "missed in time": found[0]}


def summarise_delay(trials: Sequence[Row]) -> Row:
    """Largest misses in samples, and the ratio of root mean squares."""
    errors = {name: rms([trial[name] for trial in trials]) for name in ("in time", "late")}
    missed = {name: max(trial[name] for trial in trials) for name in ("missed", "missed in time")}
    return {**errors, "late / in time": errors["late"] / errors["in time"], **missed}


MOTIONS = {"noise": NOISE, "highest": HIGHEST}
MEASURES = {
    "accuracy": Measure(MOTIONS, accuracy, summarise_accuracy, {"ours / rival": 1.15}),
    "flatness": Measure(MOTIONS, flatness, summarise_flatness, {"spread of eiv": 2.0}),
    "unordered": Measure({"share": SHARES}, unordered, summarise_unordered, {"of least squares": 0.1, "of Bayes": 0.2}),
    "noise": Measure({**MOTIONS, "step": STEPS}, noise, summarise_noise, {"off by": 0.2}),
    "delay": Measure(MOTIONS, delay, summarise_delay, {"late / in time": 1.05, "missed": 0.1}),
}


def run(name: str, place: Row, size: float) -> Row:
    """The figures of one trial beside its place on the grid."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return place | MEASURES[name].run(size=size, **place)

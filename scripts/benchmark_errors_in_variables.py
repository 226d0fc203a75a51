"""Errors in variables against least squares with the best cut-off there is, on simulated robots.

    python scripts/benchmark_errors_in_variables.py [--json FILE] [--quick] [--measures accuracy,flatness,...]

accuracy   `identify` with method eiv and nothing told, against re-weighted least squares whose zero-phase cut-off is
           picked with the truth in view, then made consistent; held-out torque error against the noise-free truth.
flatness   Error over cut-offs from 1.5 to 6 times the highest frequency of the motion, with and without correction.
unordered  Samples in random order with noise on q, v and a: error variance against least squares and Bayesian
           de-noising, noise levels given and not given.
noise      Estimated noise of the positions over the truth, with and without quantisation.
overhead   Time of the noise's moments over that of the moments alone, and time of all on 500 000 samples.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from noisy_trials import RATE, RIVAL_WIDTH, best_rival, make_trial, rival_moments, unordered_trial
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from casysid.estimation import BayesianDenoising, ErrorsInVariables, WeightedLeastSquares
from casysid.identification import Settings, identify
from casysid.identification.problem import build_problem
from casysid.signals import position_noise

NOISE, HIGHEST = (1e-5, 1e-4, 1e-3), (2.0, 6.0)
FLAT_RATIOS = (1.5, 2.0, 3.0, 4.0, 6.0)
SHARES = (0.03, 0.1)
LARGE = 500_000
EIV = Settings(method=ErrorsInVariables())
Rows = list[dict[str, Any]]
Tick = Callable[[], None]


def rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def accuracy(robots: Sequence[str], seeds: Sequence[int], duration: float, tick: Tick) -> Rows:
    rows = []
    for robot in robots:
        for noise in NOISE:
            for highest in HIGHEST:
                ours, rival, cutoffs = [], [], []
                for seed in seeds:
                    trial = make_trial(robot, seed, noise, highest, duration=duration)
                    error, cutoff = best_rival(trial, highest)
                    result = identify(trial.robot, trial.recording, EIV)
                    ours.append(trial.error(result.parameters, result.regressor))
                    rival.append(error)
                    cutoffs.append([cutoff, result.cutoff.cutoff])
                    tick()
                ratio = rms(ours) / rms(rival)
                rows.append(
                    {"robot": Path(robot).stem, "noise": noise, "highest": highest, "ours": ours, "rival": rival}
                    | {"cutoffs": cutoffs, "ratio": ratio}
                )
    return rows


def flatness(robots: Sequence[str], seeds: Sequence[int], duration: float, tick: Tick) -> Rows:
    rows = []
    for robot in robots:
        for noise in NOISE:
            for highest in HIGHEST:
                errors: dict[str, Rows | list[list[float]]] = {"eiv": [], "wls": []}
                for seed in seeds:
                    trial = make_trial(robot, seed, noise, highest, duration=duration)
                    for name, method in (("eiv", ErrorsInVariables()), ("wls", WeightedLeastSquares())):
                        settings = Settings(method=method)
                        found = []
                        for ratio in FLAT_RATIOS:
                            problem = build_problem(
                                trial.robot,
                                [trial.recording],
                                ratio * highest,
                                settings,
                                relative_width=RIVAL_WIDTH,
                            )
                            estimate = method.estimate(problem.moments, problem.regressor.prior)
                            found.append(trial.error(estimate.parameters))
                        errors[name].append(found)
                    tick()
                over = {name: [rms(column) for column in np.transpose(found)] for name, found in errors.items()}
                rows.append(
                    {"robot": Path(robot).stem, "noise": noise, "highest": highest, **over}
                    | {f"{name}_spread": max(found) / min(found) for name, found in over.items()}
                )
    return rows


def unordered(robots: Sequence[str], seeds: Sequence[int], samples: int, tick: Tick) -> Rows:
    rows = []
    methods = {"wls": WeightedLeastSquares(), "bayes": BayesianDenoising(), "eiv": ErrorsInVariables()}
    for robot in robots:
        for share in SHARES:
            errors: dict[str, list[float]] = {}
            for seed in seeds:
                trial, levels = unordered_trial(robot, seed, 1e-3, share, samples=samples)
                for told, settings in (("", Settings()), (", given", Settings(input_noise=levels))):
                    problem = build_problem(trial.robot, [trial.recording], None, settings)
                    for name, method in methods.items():
                        if told and name != "eiv":
                            continue  # they do not use the levels
                        found = method.estimate(problem.moments, problem.regressor.prior).parameters
                        errors.setdefault(name + told, []).append(trial.error(found) ** 2)
                tick()
            variance = {name: float(np.mean(found)) for name, found in errors.items()}
            best = variance["eiv, given"]
            rows.append(
                {"robot": Path(robot).stem, "share": share, **variance}
                | {"of least squares": best / variance["wls"], "of Bayes": best / variance["bayes"]}
            )
    return rows


def noise_levels(robots: Sequence[str], seeds: Sequence[int], duration: float, tick: Tick) -> Rows:
    rows = []
    for robot in robots:
        for noise in NOISE:
            for highest in HIGHEST:
                for step in (0.0, 1e-4):
                    ratios = []
                    for seed in seeds:
                        trial = make_trial(robot, seed, noise, highest, duration=duration)
                        logged = trial.recording.position
                        logged = np.round(logged / step) * step if step else logged
                        true = np.sqrt(np.mean((logged - trial.clean.channels) ** 2, axis=0))
                        ratios.append(position_noise(trial.recording.time, logged) / true)
                        tick()
                    rows.append(
                        {"robot": Path(robot).stem, "noise": noise, "highest": highest, "step": step}
                        | {"lowest": float(np.min(ratios)), "largest": float(np.max(ratios))}
                    )
    return rows


def overhead(samples: int, tick: Tick) -> Rows:
    trial = make_trial("head", 0, 1e-4, 2.0, duration=samples / RATE)
    cutoff, seconds = 12.0, {}
    rival_moments(dataclasses.replace(trial, recording=trial.recording.split(0.1)[0]), cutoff)  # compiles
    runs: dict[str, Callable[[], Any]] = {
        "moments": lambda: rival_moments(trial, cutoff),
        "with noise": lambda: build_problem(trial.robot, [trial.recording], cutoff, EIV),
        "all": lambda: identify(trial.robot, trial.recording, EIV),
    }
    for name, run in runs.items():
        wall, cpu = time.perf_counter(), time.process_time()
        run()
        seconds |= {f"{name} [s]": time.perf_counter() - wall, f"{name}, CPU [s]": time.process_time() - cpu}
        tick()
    ratio = seconds["with noise, CPU [s]"] / seconds["moments, CPU [s]"] - 1.0
    return [{"samples": samples, **seconds, "overhead": ratio}]


def show(console: Console, title: str, rows: Rows) -> None:
    names = [name for name, value in rows[0].items() if not (isinstance(value, list) and name not in ("eiv", "wls"))]
    table = Table(title=title)
    for name in names:
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(*(_word(row[name]) for name in names))
    console.print(table)


def _word(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(_word(item) for item in value)
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help="head only, one seed, short recordings")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--duration", type=float, default=20.0, help="of a recording [s]")
    parser.add_argument("--samples", type=int, default=40_000, help="without order")
    parser.add_argument("--robots", help="bundled models and paths of files, separated by commas")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--measures", default="accuracy,flatness,unordered,noise,overhead")
    options = parser.parse_args()
    found = [str(options.data / file) for file in ("kuka_iiwa14_lasa/iiwa14.urdf", "staubli_tx40/tx40.urdf")]
    robots = ["head", "arm", *(path for path in found if Path(path).exists())]
    if options.robots:
        robots = options.robots.split(",")
    if options.quick:
        robots, options.seeds, options.duration, options.samples = robots[:1], 1, 10.0, 20_000
    seeds, cells = range(options.seeds), options.seeds * len(robots)
    jobs = {
        "accuracy": (6 * cells, lambda tick: accuracy(robots, seeds, options.duration, tick)),
        "flatness": (6 * cells, lambda tick: flatness(robots, seeds, options.duration, tick)),
        "unordered": (2 * cells, lambda tick: unordered(robots, seeds, options.samples, tick)),
        "noise": (12 * cells, lambda tick: noise_levels(robots, seeds, options.duration, tick)),
        "overhead": (3, lambda tick: overhead(20_000 if options.quick else LARGE, tick)),
    }
    console, figures = Console(), {}
    with Progress(console=Console(stderr=True), transient=True) as progress, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in options.measures.split(","):
            count, job = jobs[name]
            task = progress.add_task(name, total=count)
            figures[name] = job(lambda task=task: progress.advance(task))
            show(console, name, figures[name])
            if options.json:
                options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    if "accuracy" in figures:
        ratios = [row["ratio"] for row in figures["accuracy"]]
        console.print(f"ours / rival: geometric mean {np.exp(np.mean(np.log(ratios))):.3f}, largest {max(ratios):.3f}")


if __name__ == "__main__":
    main()

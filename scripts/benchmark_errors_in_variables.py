"""Errors in variables against least squares with the best cut-off there is, on simulated robots.

    python scripts/benchmark_errors_in_variables.py [--workers 2] [--json FILE] [--resume] [--measures accuracy,...]

accuracy   `identify` with method eiv and nothing told, against re-weighted least squares whose zero-phase cut-off is
           picked with the truth in view, then made consistent; held-out torque error against the noise-free truth.
           Beside them the same least squares on the true motion and all samples: what the torque's noise alone does.
flatness   Error over cut-offs from 1.5 to 6 times the highest frequency of the motion, with and without correction.
unordered  Samples in random order with noise on q, v and a: error variance against least squares and Bayesian
           de-noising, noise levels given and not given.
noise      Estimated noise of the positions over the truth, with and without quantisation.
delay      Error of recordings whose torques are 5 ms late over that of the same ones without; delay missed in samples.
overhead   Time of the noise's moments over that of the moments alone, and time of all on 500 000 samples.

Every trial is written to the JSON file as soon as it is done, and --resume takes those in it as done.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from noisy_measures import EIV, MEASURES, Row, run
from noisy_trials import RATE, denoised_problem, make_trial, rival_moments
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from casysid.identification import identify

LARGE = 500_000
LARGEST_OVERHEAD, LONGEST = 4.0, 60.0
FEWER_SEEDS = {"flatness": 2, "delay": 2}
"""Measures whose trials take long and differ little; no more seeds for these."""
BUNDLED_ONLY = ("flatness", "delay")


def overhead(samples: int) -> Row:
    """Times of moments, of moments with their noise, and of the whole identification [s]."""
    trial = make_trial("head", 0, 1e-4, 2.0, duration=samples / RATE)
    cutoff, seconds = 12.0, {}
    rival_moments(dataclasses.replace(trial, recording=trial.recording.split(0.1)[0]), cutoff)  # compiles
    runs: dict[str, Callable[[], Any]] = {
        "moments": lambda: rival_moments(trial, cutoff),
        "with noise": lambda: denoised_problem(trial, cutoff, EIV),
        "all": lambda: identify(trial.robot, trial.recording, EIV),
    }
    for name, timed in runs.items():
        wall, cpu = time.perf_counter(), time.process_time()
        timed()
        seconds |= {f"{name} [s]": time.perf_counter() - wall, f"{name}, CPU [s]": time.process_time() - cpu}
    ratio = seconds["with noise, CPU [s]"] / seconds["moments, CPU [s]"] - 1.0
    return {"samples": samples, **seconds, "overhead": ratio}


def run_all(name: str, places: Sequence[Row], size: float, workers: int) -> Iterator[Row]:
    """Trials in the order in which they are done; one that fails says so in its row."""
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(run, name, place, size): place for place in places}
        try:
            for done in as_completed(running):
                error = done.exception()
                yield done.result() if error is None else running[done] | {"failed": f"{type(error).__name__}: {error}"}
        finally:
            pool.shutdown(cancel_futures=True)


def succeeded(trials: Sequence[Row]) -> list[Row]:
    """Trials that did not fail."""
    return [trial for trial in trials if "failed" not in trial]


def write(figures: dict[str, list[Row]], path: Path | None) -> None:
    """The trials of all measures, replaced as a whole."""
    if path is not None:
        partial = path.with_name(f".{path.name}.part")
        partial.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
        os.replace(partial, path)


def show(console: Console, title: str, rows: Sequence[Row], limits: dict[str, float]) -> None:
    """A table whose headers name the limits and whose cells beyond them are marked."""
    table = Table(title=title)
    for name in rows[0]:
        table.add_column(f"{name}\n<= {limits[name]:g}" if name in limits else name, justify="right")
    for row in rows:
        table.add_row(*(_cell(value, limits.get(name)) for name, value in row.items()))
    console.print(table)


def _cell(value: Any, limit: float | None) -> str:
    values = value if isinstance(value, list) else [value]
    word = " ".join(f"{one:.3g}" if isinstance(one, float) else str(one) for one in values)
    return f"[red]{word} ![/red]" if limit is not None and value > limit else word


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--resume", action="store_true", help="trials in the JSON file are done")
    parser.add_argument("--quick", action="store_true", help="head only, one seed, short recordings")
    parser.add_argument("--workers", type=int, default=1, help="processes side by side")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--duration", type=float, default=20.0, help="of a recording [s]")
    parser.add_argument("--samples", type=int, default=40_000, help="without order")
    parser.add_argument("--robots", help="bundled models and paths of files, separated by commas")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--measures", default=",".join([*MEASURES, "overhead"]))
    options = parser.parse_args()
    found = [str(options.data / file) for file in ("kuka_iiwa14_lasa/iiwa14.urdf", "staubli_tx40/tx40.urdf")]
    robots = ["head", "arm", *(path for path in found if Path(path).exists())]
    if options.robots:
        robots = options.robots.split(",")
    if options.quick:
        robots, options.seeds, options.duration, options.samples = robots[:1], 1, 10.0, 20_000
    done = json.loads(options.json.read_text(encoding="utf-8")) if options.resume and options.json.exists() else {}
    console, figures = Console(width=150), dict(done)
    for name in options.measures.split(","):
        if name == "overhead":
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                figures[name] = [overhead(20_000 if options.quick else LARGE)]
            limits = {"overhead": LARGEST_OVERHEAD, "all [s]": LONGEST}
            show(console, name, figures[name], limits)
            write(figures, options.json)
            continue
        measure = MEASURES[name]
        chosen = [robot for robot in robots if name not in BUNDLED_ONLY or "/" not in robot]
        places = measure.places(chosen, min(options.seeds, FEWER_SEEDS.get(name, options.seeds)))
        trials = figures[name] = succeeded(figures.get(name, []))
        left = [place for place in places if not any(place.items() <= trial.items() for trial in trials)]
        size = options.samples / RATE if name == "unordered" else options.duration
        with Progress(console=Console(stderr=True), transient=True) as progress:
            for trial in progress.track(run_all(name, left, size, options.workers), total=len(left), description=name):
                trials.append(trial)
                write(figures, options.json)
        show(console, name, measure.table(succeeded(trials)), measure.limits)
        for trial in trials:
            if "failed" in trial:
                console.print(f"{name}: {trial}", markup=False)
    if "accuracy" in figures:
        ratios = [row["ours / rival"] for row in MEASURES["accuracy"].table(succeeded(figures["accuracy"]))]
        mean = float(np.exp(np.mean(np.log(ratios))))
        console.print(f"ours / rival: geometric mean {mean:.3f} (<= 1), largest {max(ratios):.3f} (<= 1.15)")


if __name__ == "__main__":
    main()

"""Figure 2 of Ting et al. (2006): how well each estimator predicts when inputs are noisy, redundant and irrelevant.

    python scripts/reproduce_figure_2.py --out DIR [--trials 10] [--samples 1000] [--seed 0] [--methods ols,bayes]

Writes DIR/figure_2.png and DIR/figure_2.json: by input signal-to-noise ratio, number of redundant inputs and estimator,
the normalised mean squared error on noiseless ("clean") and on noisy test rows, mean and deviation over the trials.
Bayesian de-noising predicts noiseless rows by its noiseless vector (Eq. 4) and noisy rows by its noisy one (Eq. 3).
"""

from __future__ import annotations

import argparse
import importlib
import json
import multiprocessing
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from synthetic_regression import Array, Problem, Sample, draw_problem

from casysid.errors import CasysidWarning
from casysid.estimation.base import Estimator
from casysid.moments import Moments

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INPUT_SNRS = (2, 5)
OUTPUT_SNR = 5
REDUNDANT = (0, 30, 60, 90)
BLOCKS = 10  # of the training rows, for cross-validation

METHODS = {  # module and class, in the order of the bars: the paper's methods, and two more
    "ols": ("least_squares", "OrdinaryLeastSquares"),
    "stepwise": ("stepwise", "StepwiseRegression"),
    "pls": ("partial_least_squares", "PartialLeastSquares"),
    "lasso": ("lasso", "LassoRegression"),
    "jfa": ("joint_factor_analysis", "JointFactorAnalysis"),
    "bayes": ("bayesian", "BayesianDenoising"),
    "ard": ("relevance", "RelevanceRegression"),
    "tls": ("total_least_squares", "TotalLeastSquares"),
}

Errors = dict[str, tuple[float, float]]  # clean and noisy error by method
Table = dict[str, dict[str, dict[str, dict[str, float]]]]


def build_estimator(method: str, **settings: str) -> Estimator:
    """The named method with its defaults, but for ``settings``."""
    module, kind = METHODS[method]
    estimator: Estimator = getattr(importlib.import_module(f"casysid.estimation.{module}"), kind)(**settings)
    return estimator


def fit_vectors(method: str, moments: Moments) -> tuple[Array, Array]:
    """Regression vectors for noiseless and for noisy rows: Eqs. (4) and (3) for Bayesian de-noising, else the same."""
    parameters = build_estimator(method).estimate(moments).parameters
    if method != "bayes":
        return parameters, parameters
    return parameters, build_estimator(method, vector="noisy").estimate(moments).parameters


def normalised_error(sample: Sample, parameters: Array) -> float:
    """Mean squared error over the variance of the output."""
    return float(np.mean((sample.y - sample.x @ parameters) ** 2) / np.var(sample.y))


def run_trial(problem: Problem, methods: Sequence[str]) -> Errors:
    """Clean and noisy test error of the methods on one draw."""
    moments = Moments.from_rows(problem.train.x, problem.train.y, blocks=BLOCKS)
    errors = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CasysidWarning)  # weak answers are what the figure shows
        for method in methods:
            noiseless, noisy = fit_vectors(method, moments)
            errors[method] = (
                normalised_error(problem.clean_test, noiseless),
                normalised_error(problem.noisy_test, noisy),
            )
    return errors


def run_cell(snr: int, redundant: int, trial: int, samples: int, seed: int, methods: Sequence[str]) -> Errors:
    """One trial by its coordinates; both signal-to-noise ratios see the same draws."""
    rng = np.random.default_rng([seed, redundant, trial])
    return run_trial(draw_problem(rng, samples, snr, OUTPUT_SNR, redundant), methods)


def run_trials(
    trials: int, samples: int, seed: int, methods: Sequence[str], *, workers: int, advance: Callable[[], None]
) -> Table:
    """Every trial, spread over processes; ``advance`` is called after each."""
    cells = [(snr, r, trial) for trial in range(trials) for snr in INPUT_SNRS for r in REDUNDANT]
    os.environ["OMP_NUM_THREADS"] = "1"  # inherited by the processes, which would else fight for the cores
    collected: dict[tuple[int, int], list[Errors]] = {}
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = {pool.submit(run_cell, *cell, samples, seed, methods): cell for cell in cells}
        for future in as_completed(futures):
            snr, r, _ = futures[future]
            collected.setdefault((snr, r), []).append(future.result())
            advance()
    return {str(snr): {str(r): summarise(collected[snr, r]) for r in REDUNDANT} for snr in INPUT_SNRS}


def summarise(trials: list[Errors]) -> dict[str, dict[str, float]]:
    """Mean and standard deviation over trials, by method."""
    summary = {}
    for name in trials[0]:
        values = np.sort(
            [trial[name] for trial in trials], axis=0
        )  # (trials, 2), sorted: sums do not depend on the order
        mean, std = values.mean(axis=0), values.std(axis=0, ddof=1 if len(values) > 1 else 0)
        summary[name] = {
            "clean": float(mean[0]),
            "noisy": float(mean[1]),
            "clean_std": float(std[0]),
            "noisy_std": float(std[1]),
        }
    return summary


LABELS = {
    "ols": "OLS",
    "stepwise": "stepwise",
    "pls": "PLS",
    "lasso": "LASSO",
    "jfa": "JFA",
    "bayes": "Bayesian de-noising",
    "ard": "ARD",
    "tls": "TLS",
}
COLOURS = {
    "ols": "#c6cbd3",
    "stepwise": "#9aa5b4",
    "pls": "#e3b778",
    "lasso": "#c98b4b",
    "jfa": "#7fa8c9",
    "bayes": "#10243e",
    "ard": "#86a98a",
    "tls": "#c9a3b4",
}


def draw_figure(table: Table, path: Path, trials: int) -> None:
    """The paper's two panels side by side, clean test rows above noisy ones."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 7.5), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    for row, test in enumerate(("clean", "noisy")):
        top = 1.2 * max(
            cell[name][test] + cell[name][f"{test}_std"] / np.sqrt(trials)
            for cells in table.values()
            for cell in cells.values()
            for name in cell
            if name != "tls"  # may explode; its bars are cut and carry their number
        )
        for column, (snr, cells) in enumerate(table.items()):
            _draw_panel(axes[row, column], cells, test, top, trials)
            if row == 0:
                axes[row, column].set_title(f"({'ab'[column]})  input SNR {snr}, output SNR {OUTPUT_SNR}")
        axes[row, 0].set_ylabel(f"normalised squared error,\n{'noiseless' if test == 'clean' else 'noisy'} test rows")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    temporary = path.with_name(path.name + ".part")
    figure.savefig(temporary, format="png", dpi=150)
    os.replace(temporary, path)


def _draw_panel(axes: Axes, cells: dict[str, dict[str, dict[str, float]]], test: str, top: float, trials: int) -> None:
    places = np.arange(len(cells))
    methods = list(next(iter(cells.values())))
    width = 0.85 / len(methods)
    for k, name in enumerate(methods):
        heights = np.array([cell[name][test] for cell in cells.values()])
        spread = np.array([cell[name][f"{test}_std"] for cell in cells.values()]) / np.sqrt(trials)
        x = places + (k - (len(methods) - 1) / 2.0) * width
        spread[heights > top] = 0.0
        axes.bar(x, heights, 0.92 * width, color=COLOURS[name], label=LABELS[name])
        axes.errorbar(x, heights, spread, fmt="none", ecolor="#555555", elinewidth=0.8)
        for place, height in zip(x[heights > top], heights[heights > top], strict=True):
            axes.text(place, 0.985 * top, f"{height:.2g}", rotation=90, ha="center", va="top", fontsize=8)
    axes.set_ylim(0.0, top)
    axes.set_xticks(places, [f"r = {r}, u = {90 - int(r)}" for r in cells])
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="#e5e5e5", linewidth=0.7)
    axes.set_axisbelow(True)


def write_json(table: Table, path: Path) -> None:
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    os.replace(temporary, path)


def format_rows(table: Table) -> Iterator[list[str]]:
    """Clean and noisy means by signal-to-noise ratio, redundancy and method, as text."""
    for snr, cells in table.items():
        for r, cell in cells.items():
            yield [snr, r, *(f"{value['clean']:.3f} {value['noisy']:.3f}" for value in cell.values())]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--samples", type=int, default=1000, help="rows of each training and test set")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=min(2, os.cpu_count() or 1), help="processes")
    parser.add_argument("--methods", default=",".join(METHODS), help="some of %(default)s")
    options = parser.parse_args()
    methods = options.methods.split(",")
    if unknown := set(methods) - set(METHODS):
        parser.error(f"--methods: wanted some of {', '.join(METHODS)}; got {', '.join(sorted(unknown))}")
    if min(options.trials, options.workers) < 1 or options.samples < BLOCKS:
        parser.error(f"wanted --trials and --workers of at least 1 and --samples of at least {BLOCKS}")

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.table import Table as RichTable

    options.out.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("trials", total=options.trials * len(INPUT_SNRS) * len(REDUNDANT))
        table = run_trials(
            options.trials,
            options.samples,
            options.seed,
            methods,
            workers=options.workers,
            advance=lambda: progress.advance(task),
        )
    write_json(table, options.out / "figure_2.json")
    draw_figure(table, options.out / "figure_2.png", options.trials)
    shown = RichTable("SNR", "r", *methods, title="normalised mean squared error: clean, noisy test rows")
    for row in format_rows(table):
        shown.add_row(*row)
    console.print(shown)
    print(options.out / "figure_2.png")


if __name__ == "__main__":
    main()

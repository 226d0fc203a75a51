"""Tables I and II of Ting et al. (2006): tracking under computed torque with the parameters that each method finds.

    python scripts/reproduce_tables.py --out DIR [--robot head|arm] [--scale 1.0] [--seeds 3] [--features 11] ...

Simulated: a 7-DOF head at 420 Hz, 500 000 samples, and a 10-DOF arm at 480 Hz, 1 000 000 samples of which every second
is used (--scale shrinks both). Each seed is a machine that differs from its model file. --features 11 is the paper's
regressor (ten inertial parameters and viscous friction a joint); the default of 14 adds Coulomb friction, offset and
armature. The paper's methods see motion by filtered differences; --smoothed gives them that of casysid's spline. Two
more rows see the same, and know the encoders' noise. Writes DIR/tables.json, tables.txt, tables.png and sweep.png
(tracking over sensor noise).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import multiprocessing
import os
import tempfile
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path

import numpy as np
from paper_robots import CUTOFF, PIECES, SENSING, Experiment, Outcome, evaluate, record_piece

MEASURES = ("position", "velocity", "feedback")
UNITS = {"position": "rad", "velocity": "rad/s", "feedback": "N m"}
ROBOTS = {"head": Experiment("head", 420.0, 500_000, 1, 0), "arm": Experiment("arm", 480.0, 500_000, 2, 0)}
DENOISING = {
    "Bayesian de-noising": "bayesian",
    "Bayesian de-noising, encoder noise": "bayesian_with_encoder_noise",
    "errors in variables": "errors_in_variables",
}
SWEEP = (0.03, 0.1, 0.3, 1.0, 3.0)
PAPER = {
    "head": {
        "ridge (hand-tuned)": (0.0291, 0.2465, 0.3969),
        "Bayesian de-noising": (0.0243, 0.2189, 0.3292),
        "LASSO": (0.0308, 0.2517, 0.4272),
        "stepwise": (np.inf, np.inf, np.inf),
    },
    "arm": {
        "ridge (hand-tuned)": (0.0210, 0.1119, 0.5839),
        "Bayesian de-noising": (0.0201, 0.0930, 0.5297),
        "LASSO": (np.inf, np.inf, np.inf),
        "stepwise": (np.inf, np.inf, np.inf),
    },
}

FEW_SAMPLES = 100_000  # may be evaluated beside others

Table = dict[str, dict[str, float]]  # method, measure


def run_all(
    experiments: Sequence[Experiment], workers: int, folder: Path, advance: Callable[[str], None]
) -> dict[Experiment, Outcome]:
    """Record and evaluate, spread over processes; ``advance`` is called after each piece of work.

    Of long experiments one at a time is evaluated, which takes most of the memory, while others are recorded.
    """
    os.environ["OMP_NUM_THREADS"] = "1"  # inherited by the processes, which would else fight for the cores
    outcomes: dict[Experiment, Outcome] = {}
    recordings: dict[Experiment, list[Path]] = {experiment: [] for experiment in experiments}
    to_record = deque((experiment, piece) for experiment in experiments for piece in range(PIECES))
    to_evaluate: list[Experiment] = []
    running: dict[Future[Path] | Future[Outcome], tuple[Experiment, bool]] = {}  # and whether it is an evaluation
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        while running or to_record or to_evaluate:
            while len(running) < workers:
                evaluated = [experiment for experiment, evaluates in running.values() if evaluates]
                if (experiment := _next_to_evaluate(to_evaluate, evaluated)) is not None:
                    to_evaluate.remove(experiment)
                    running[pool.submit(evaluate, experiment, sorted(recordings[experiment]))] = (experiment, True)
                elif to_record:
                    experiment, piece = to_record.popleft()
                    running[pool.submit(record_piece, experiment, piece, folder)] = (experiment, False)
                else:
                    break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                (experiment, _), answer = running.pop(future), future.result()
                if isinstance(answer, Outcome):
                    outcomes[experiment] = answer
                    for path in recordings[experiment]:
                        path.unlink()
                else:
                    recordings[experiment].append(answer)
                    if len(recordings[experiment]) == PIECES:
                        to_evaluate.append(experiment)
                advance(experiment.robot)
    return outcomes


def _next_to_evaluate(ready: Sequence[Experiment], running: Sequence[Experiment]) -> Experiment | None:
    """The first that is ready, but no long one beside a long one."""
    busy = any(one.samples > FEW_SAMPLES for one in running)
    return next((one for one in ready if not busy or one.samples <= FEW_SAMPLES), None)


def average(outcomes: Sequence[Outcome]) -> Table:
    """Means over machines; infinite, which is FAILURE, when any of them could not be run."""
    return {
        method: {name: float(np.mean([one.measures[method][name] for one in outcomes])) for name in MEASURES}
        for method in outcomes[0].measures
    }


def write_table(robot: str, table: Table) -> str:
    """One table as text, the paper's figures beside it."""
    lines = [
        f"{robot}: RMS position [rad], velocity [rad/s], feedback [N m], averaged over joints; the paper's in brackets"
    ]
    for method, values in table.items():
        paper = PAPER[robot].get(method)
        cells = [_cell(values[name]) + (f" [{_cell(paper[k])}]" if paper else "") for k, name in enumerate(MEASURES)]
        lines.append(f"  {method:<36}" + "".join(f"{cell:>22}" for cell in cells))
    return "\n".join(lines)


def compare(table: Table) -> dict[str, float]:
    """By how much de-noising beats the better ridge, and how near to the limit casysid comes, by measure."""
    found = {}
    for measure in MEASURES:
        better = min(values[measure] for method, values in table.items() if method.startswith("ridge"))
        for method, key in DENOISING.items():
            found[f"{key}_improves_{measure}"] = 1.0 - table[method][measure] / better
    limit = table["true parameters"]
    for measure in MEASURES:
        found[f"best_over_true_{measure}"] = _best(table, measure) / limit[measure]
        found[f"default_over_true_{measure}"] = table["empirical Bayes, own filter"][measure] / limit[measure]
        found[f"eiv_over_true_{measure}"] = table["errors in variables, own filter"][measure] / limit[measure]
    return found


def _best(table: Table, measure: str) -> float:
    unfitted = ("model file", "true parameters")
    return min(values[measure] for method, values in table.items() if method not in unfitted)


def _cell(value: float) -> str:
    return f"{value:.4f}" if np.isfinite(value) else "FAILURE"


def draw_tables(tables: dict[str, Table], path: Path) -> None:
    """Bars: every measure of every method, relative to the true parameters'."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 3.6 * len(tables)), layout="constrained")
    axes = figure.subplots(len(tables), len(MEASURES), squeeze=False)
    for row, (robot, table) in enumerate(tables.items()):
        for column, measure in enumerate(MEASURES):
            ax, methods = axes[row, column], list(table)[::-1]
            values = [table[method][measure] for method in methods]
            ax.barh(methods, [value if np.isfinite(value) else 0.0 for value in values], color="#1f6feb", height=0.6)
            ax.axvline(table["true parameters"][measure], color="#d1495b", linewidth=1.0)
            for k, value in enumerate(values):
                ax.text(0.0, k, f" {_cell(value)}", va="center", fontsize=7, color="black")
            ax.set_title(f"{robot}: {measure} [{UNITS[measure]}]", fontsize=9)
            ax.tick_params(labelsize=7, labelleft=column == 0)
            ax.spines[["top", "right"]].set_visible(False)
    _save(figure, path)


def draw_sweep(sweeps: dict[str, dict[float, Table]], path: Path) -> None:
    """Position error and feedback over the sensors' noise, a line a method."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2 * len(sweeps)), layout="constrained")
    axes = figure.subplots(len(sweeps), 2, squeeze=False)
    for row, (robot, tables) in enumerate(sweeps.items()):
        for ax, measure in zip(axes[row], ("position", "feedback"), strict=True):
            for method in next(iter(tables.values())):
                values = [table[method][measure] for table in tables.values()]
                style = {"model file": ":", "true parameters": "--"}.get(method, "-")
                ax.loglog(list(tables), values, style, marker="o", markersize=3, linewidth=1.2, label=method)
            ax.set_xlabel("factor on the sensors' noise")
            ax.set_ylabel(f"{robot}: {measure} [{UNITS[measure]}]")
            ax.spines[["top", "right"]].set_visible(False)
        axes[row, 1].legend(fontsize=7, frameon=False)
    _save(figure, path)


def _save(figure: object, path: Path) -> None:
    temporary = path.with_name(path.name + ".part")
    figure.savefig(temporary, format="png", dpi=150)  # type: ignore[attr-defined]
    os.replace(temporary, path)


def write_text(text: str, path: Path) -> None:
    """Whole or not at all."""
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(text, encoding="utf-8")
    os.replace(temporary, path)


def plan(options: argparse.Namespace) -> tuple[list[Experiment], list[Experiment]]:
    """The experiments of the tables and of the sweep; long and short ones in turn."""
    robots = [options.robot] if options.robot else ["arm", "head"]
    tables, sweep = [], []
    for name in robots:
        base = dataclasses.replace(ROBOTS[name], paper_features=options.features == 11, smoothed=options.smoothed)
        samples = int(options.scale * base.samples)
        tables += [dataclasses.replace(base, samples=samples, seed=seed) for seed in range(options.seeds)]
        if not options.no_sweep:
            few = dataclasses.replace(base, samples=max(samples // 10, 20_000), stride=1, seed=options.seeds)
            sweep += [dataclasses.replace(few, noise=factor) for factor in SWEEP]
    tables.sort(key=lambda one: one.seed)
    return tables, sweep


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--robot", choices=tuple(ROBOTS), help="default: both")
    parser.add_argument("--scale", type=float, default=1.0, help="share of the paper's samples")
    parser.add_argument("--seeds", type=int, default=3, help="machines, each with its own data")
    parser.add_argument("--features", type=int, choices=(11, 14), default=14, help="regressor columns a joint")
    parser.add_argument("--smoothed", action="store_true", help="give the paper's methods motion from a spline")
    parser.add_argument("--no-sweep", action="store_true", help="skip the sweep over noise")
    parser.add_argument("--workers", type=int, default=min(2, os.cpu_count() or 1), help="processes")
    options = parser.parse_args()
    if not 0.02 <= options.scale <= 10.0 or min(options.seeds, options.workers) < 1:
        parser.error("wanted --scale from 0.02 to 10, and --seeds and --workers of at least 1")
    return options


def main() -> None:
    options = parse()
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console, start = Console(stderr=True), time.perf_counter()
    tables_plan, sweep_plan = plan(options)
    everything = [*tables_plan, *sweep_plan]
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    options.out.mkdir(parents=True, exist_ok=True)
    with Progress(*columns, console=console) as progress, tempfile.TemporaryDirectory() as folder:
        work = {one.robot: sum(PIECES + 1 for two in everything if two.robot == one.robot) for one in everything}
        bars = {robot: progress.add_task(robot, total=count) for robot, count in work.items()}
        outcomes = run_all(everything, options.workers, Path(folder), lambda robot: progress.advance(bars[robot]))
    tables = {
        robot: average([outcomes[one] for one in tables_plan if one.robot == robot])
        for robot in ROBOTS
        if robot in bars
    }
    sweeps = {
        robot: {one.noise: average([outcomes[one]]) for one in sweep_plan if one.robot == robot} for robot in tables
    }
    text = "\n\n".join(write_table(robot, table) for robot, table in tables.items())
    content = {
        **tables,
        "comparison": {robot: compare(table) for robot, table in tables.items()},
        "sweep": sweeps,
        "by_seed": [
            {**dataclasses.asdict(one), "measures": outcomes[one].measures, "remarks": outcomes[one].remarks}
            for one in everything
        ],
        "sensing": dataclasses.asdict(SENSING),
        "spline_hz": CUTOFF,
        "seconds": round(time.perf_counter() - start, 1),
    }
    write_text(_as_json(content), options.out / "tables.json")
    write_text(text + "\n", options.out / "tables.txt")
    draw_tables(tables, options.out / "tables.png")
    if sweep_plan:
        draw_sweep(sweeps, options.out / "sweep.png")
    console.print(text, markup=False, highlight=False, soft_wrap=True)
    console.print({robot: compare(table) for robot, table in tables.items()})
    print(options.out / "tables.json")


def _as_json(content: object) -> str:
    """JSON in which what is infinite reads FAILURE."""
    return json.dumps(_marked(content), indent=2, allow_nan=False) + "\n"


def _marked(content: object) -> object:
    if isinstance(content, dict):
        return {str(key): _marked(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_marked(value) for value in content]
    return "FAILURE" if isinstance(content, float) and not np.isfinite(content) else content


if __name__ == "__main__":
    main()

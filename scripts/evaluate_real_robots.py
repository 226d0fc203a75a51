"""Held-out torque error on logs of real robots, every method with its defaults, as a table and as JSON.

    python scripts/evaluate_real_robots.py --data DIR [--methods all] [--robots emps,...] [--json FILE]

DIR holds a folder per robot with its URDF and recordings; nothing is told. With ``--friction plain``, what is known of
a robot beforehand, such as a wrist whose motors drive two joints, is declared in the table below. Under the table
stands what the data settled for each robot.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from casysid.dynamics import Coupling
from casysid.estimation import ESTIMATORS, ErrorsInVariables, estimator_by_name
from casysid.identification import IdentificationResult, Preparation, Settings, compare, prepare, solve
from casysid.inertia import Consistency
from casysid.recording import read_recording
from casysid.robot import Robot

WIDTH = 190
"""Columns of text that the table takes."""


@dataclass(frozen=True)
class Trial:
    """A robot's fitted and held-out recordings; without the latter, the last 40 % of time is held out."""

    folder: str
    urdf: str
    fitted: tuple[str, ...]
    held_out: tuple[str, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    anchor: float = float("nan")


def pendulum(*stamps: str) -> tuple[str, ...]:
    return tuple(f"design_C1_{stamp}" for stamp in stamps)


TRIALS = (
    Trial("emps", "emps.urdf", ("estimation",), ("validation_pulses",), anchor=0.074),
    Trial(
        "staubli_tx40",
        "tx40.urdf",
        ("excitation_9s_joint",),
        couplings=(Coupling(joints=("joint_5", "joint_6"), weights=(1.0, 1.0)),),
        anchor=0.124,
    ),
    Trial("kuka_iiwa14_lasa", "iiwa14.urdf", ("motion_30s",), anchor=0.025),
    Trial("rokae_xmate3pro", "xmate3pro.urdf", ("excitation_20s",), anchor=0.042),
    Trial("airbot_play", "airbot_play.urdf", ("chirp",), ("trapezoid",), anchor=0.077),
    Trial("kuka_kr300", "kuka_kr300.urdf", ("traj_A", "traj_B"), ("traj_C",), anchor=0.160),
    Trial("kuka_med7_slow", "med7.urdf", ("measurements",), anchor=0.204),
    Trial(
        "dfki_double_pendulum",
        "design_C1.urdf",
        pendulum("143339", "143601", "143747", "144003", "154220"),
        pendulum("143524", "143704", "143906", "144115", "154548"),
        anchor=0.404,
    ),
)


OWN_WAY = {ErrorsInVariables.name}
"""Estimators that the recordings are prepared for by themselves, because they reckon with noise; the others share."""


def prepare_trial(data: Path, trial: Trial, settings: Settings) -> Preparation:
    robot = Robot.from_file(data / trial.folder / trial.urdf)
    fitted, held_out = (
        [read_recording(data / trial.folder / f"{name}.csv.gz", robot) for name in names]
        for names in (trial.fitted, trial.held_out)
    )
    if not held_out:
        (whole,) = fitted
        first, second = whole.split(0.6)
        fitted, held_out = [first], [second]
    return prepare(robot, fitted, settings, held_out=held_out)


def settled(preparation: Preparation, result: IdentificationResult) -> list[str]:
    """What the data decided on one robot, in sentences: friction, delay, prior, noise."""
    chosen = [one.sentence for one in preparation.choices.friction.chosen] or ["nothing beyond viscous and Coulomb"]
    figures = result.estimate.diagnostics
    lines = [f"friction: {'; '.join(chosen)}", f"delay: {preparation.choices.delay.reason}"]
    decided = {name.removeprefix("decided_"): value for name, value in figures.items() if name.startswith("decided_")}
    if decided:
        numbers = ", ".join(f"{name} {value:.1f}" for name, value in decided.items())
        lines.append(f"prior: the data decide {sum(decided.values()):.1f} parameters ({numbers})")
    if "noise_share_of_weakest_direction" in figures:
        share, removed = figures["noise_share_of_weakest_direction"], figures["directions_too_noisy"]
        lines.append(f"noise: {share:.2g} of the weakest direction's energy; {removed:.0f} directions limited")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--methods", default="all", help="names with commas between them, or all")
    parser.add_argument("--judged", default="eiv", help="the method that is compared with the best of the others")
    parser.add_argument("--consistency", choices=["none", "inertia", "full"], default="full")
    parser.add_argument("--robots", default=",".join(trial.folder for trial in TRIALS))
    parser.add_argument("--friction", choices=["plain", "auto"], default="auto")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    names = [kind.name for kind in ESTIMATORS] if arguments.methods == "all" else arguments.methods.split(",")
    methods, chosen = [estimator_by_name(name) for name in names], arguments.robots.split(",")
    consistency = None if arguments.consistency == "none" else Consistency(arguments.consistency)
    console, figures = Console(width=WIDTH), {}
    table = Table(
        title=f"held-out relative torque error, consistency {arguments.consistency}, friction {arguments.friction}"
    )
    for header in ("robot", "plain WLS, tuned", "Hz", *names, f"{arguments.judged} / best other", "file", "CPU [s]"):
        table.add_column(header, justify="left" if header == "robot" else "right")
    for trial in track([one for one in TRIALS if one.folder in chosen], console=Console(stderr=True), transient=True):
        started, auto = time.process_time(), arguments.friction == "auto"
        settings = Settings(consistency=consistency, choose_friction=auto, couplings=() if auto else trial.couplings)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            preparation = prepare_trial(arguments.data, trial, settings)
            prepared = time.process_time() - started
            comparison = compare(preparation, [one for one in methods if one.name not in OWN_WAY], settings)
            own = {
                one.name: solve(prepare_trial(arguments.data, trial, its), its)
                for one in methods
                if one.name in OWN_WAY and (its := dataclasses.replace(settings, method=one))
            }
        results, cutoff = {**comparison.results, **own}, preparation.choices.band.cutoff
        errors = {name: result.held_out.relative for name, result in results.items()}
        others = [error for name, error in errors.items() if name != arguments.judged]
        judged = results.get(arguments.judged)
        ratio = errors[arguments.judged] / min(others) if judged and others else float("nan")
        shown = judged or next(iter(results.values()))
        figures[trial.folder] = {
            "anchor": trial.anchor,
            "cutoff": cutoff,
            "held_out": errors,
            "unfiltered": {name: result.held_out.relative_unfiltered for name, result in results.items()},
            "unconstrained": {name: result.unconstrained.relative for name, result in results.items()},
            "consistent": {name: result.is_physically_consistent for name, result in results.items()},
            "failed": dict(comparison.failures),
            "judged_over_best_other": ratio,
            "file": shown.file.relative,
            "settled": settled(preparation, shown),
            "cpu_seconds": {"prepare": prepared, "all": time.process_time() - started},
        }
        table.add_row(
            trial.folder,
            f"{trial.anchor:.3f}",
            f"{cutoff:.3g}",
            *(f"{errors[name]:.4f}" if name in errors else "–" for name in names),
            f"{ratio:.3f}",
            f"{shown.file.relative:.3f}",
            f"{prepared:.1f}",
        )
    together = {name: [content["held_out"].get(name, np.nan) for content in figures.values()] for name in names}
    means = [f"{np.exp(np.mean(np.log(errors))):.4f}" for errors in together.values()]
    table.add_row("geometric mean", "", "", *means, "", "", "")
    console.print(table)
    for folder, content in figures.items():
        for sentence in content["settled"]:
            console.print(f"{folder}: {sentence}", markup=False, highlight=False, soft_wrap=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

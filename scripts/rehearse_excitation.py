"""Whether designed excitation pays: the same machine identified from random and from designed motions.

    python scripts/rehearse_excitation.py --json pays.json [--robot head arm] [--seeds 5] [--machine real plain]

Every machine has a hidden truth that differs from its file. It is recorded three times, as long and through the same
imperfect sensors: along random sinusoids (``sinusoids``), along a random motion of the Fourier series that is designed,
as large as its limits allow (``random``), and along designed motions (``designed``). A ``real`` machine has stiction,
cables, lag and offsets besides, which no parameter stands for; a ``plain`` one has nothing that the regressor lacks, so
that its errors come from the sensors. Compared are

- standard errors of the base parameters, as reported: geometric mean of their ratios;
- their true errors, likewise;
- on a motion never fitted, the torque of the parameters' errors, ``|Y (identified - true)| / |tau|``, mean over joints;
- there, the whole torque error, which on a ``real`` machine is mostly what even the true parameters do not explain.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from pathlib import Path

import numpy as np

from casysid.bundled import find_model
from casysid.errors import CasysidWarning
from casysid.excitation import build_excitation, choose_series, limits_of
from casysid.excitation.search.initial import find_standing, random_start
from casysid.excitation.search.program import Evaluation
from casysid.identification import identify
from casysid.robot import Robot
from casysid.simulation import PD, PLAIN_MECHANICS, ControlModel, PlantSettings, design_sinusoids
from casysid.validation import (
    DesignedMotion,
    RehearsalSettings,
    compare_base_parameters,
    track,
    true_coefficients,
    true_torque_error,
)
from casysid.validation.exciting import Excitation, excite, plan_set
from casysid.validation.rehearsal import build_machine

MACHINES = {"real": PlantSettings(), "plain": PlantSettings(mechanics=PLAIN_MECHANICS)}
MEASURES = ("standard_error", "true_error", "held_out_parameters", "held_out_whole")


def random_motion(robot, settings, seed):
    """A random motion of the series that is designed, as large as the limits of the design allow."""
    series, count, periods = plan_set(choose_series(limits_of(robot), settings.rate), settings.duration)
    problem = build_excitation(robot, series=series, periods=count * periods, rate=settings.rate)
    evaluation, rng = Evaluation(problem), np.random.default_rng(seed)
    standing, x = find_standing(problem, seed), None
    while x is None:
        x = random_start(problem, evaluation, standing, rng)
    return DesignedMotion((problem.trajectory(x),))


def motions(robot, settings, seed):
    """Each kind's motion, made when it is asked for."""
    same = {"duration": settings.duration, "rate": settings.rate, "seed": seed}
    yield "sinusoids", excite(robot, Excitation.SINUSOIDS, **same)
    yield "random", random_motion(robot, settings, seed)
    yield "designed", excite(robot, Excitation.DESIGNED, **same)


def relative(values, reference):
    return float(np.mean(np.linalg.norm(values, axis=0) / np.linalg.norm(reference, axis=0)))


def run_case(name, machine, seed, duration):
    """Figures by kind of motion; arrays are by base parameter."""
    robot = Robot.from_file(find_model(name))
    settings = RehearsalSettings(duration=duration, rate=420.0, seed=seed, plant=MACHINES[machine])
    plant, model = build_machine(robot, settings), ControlModel.from_robot(robot)
    gains = PD.tuned(robot, plant.parameters, bandwidth=settings.recording_bandwidth)

    def record(motion, number):
        return track(plant, model, gains, motion, rate=settings.rate, duration=duration, seed=3 * seed + number)

    unseen = record(design_sinusoids(robot, duration=duration, seed=10_000 + seed), 1)
    figures = {}
    for kind, motion in motions(robot, settings, seed):
        result = identify(robot, record(motion, 0).recording, settings.identification, held_out=[unseen.recording])
        base, true = compare_base_parameters(result, plant), true_coefficients(plant, result.regressor)
        wrong = result.regressor.predict(result.parameters - true, unseen.q, unseen.v, unseen.a)
        errors = true_torque_error(result.regressor, {"identified": result.parameters, "true": true}, unseen)
        figures[kind] = {
            "standard_error": dict(zip(base.names, base.std, strict=True)),
            "true_error": dict(zip(base.names, np.abs(base.identified - base.true), strict=True)),
            "held_out_parameters": relative(wrong, unseen.tau),
            "held_out_whole": float(errors["identified"].mean()),
            "held_out_true_parameters": float(errors["true"].mean()),
            "coverage_95": base.coverage,
            "rank": result.excited.rank,
        }
    return figures


def ratio(ours, other):
    """Geometric mean over what both know, by name where there are names: friction is chosen by each recording."""
    if isinstance(ours, dict):
        names = [name for name in ours if name in other]
        ours, other = [ours[name] for name in names], [other[name] for name in names]
    ours, other = np.atleast_1d(ours), np.atleast_1d(other)
    known = np.isfinite(ours) & np.isfinite(other) & (ours > 0.0) & (other > 0.0)  # laws hold some at zero exactly
    return float(np.exp(np.mean(np.log(ours[known] / other[known]))))


def run(robots, machines, seeds, duration):
    rows = []
    for machine in machines:
        for name in robots:
            for seed in range(seeds):
                began = time.process_time()
                figures = run_case(name, machine, seed, duration)
                ratios = {
                    rival: {key: ratio(figures["designed"][key], figures[rival][key]) for key in MEASURES}
                    for rival in ("sinusoids", "random")
                }
                plain = {
                    kind: {key: value for key, value in one.items() if not isinstance(value, dict)}
                    for kind, one in figures.items()
                }
                row = {"robot": name, "machine": machine, "seed": seed, "ratio": ratios, "figures": plain}
                row["cpu"] = time.process_time() - began
                rows.append(row)
                for rival, values in ratios.items():
                    text = "  ".join(f"{key} {value:.3f}" for key, value in values.items())
                    print(f"{name:8s} {machine:6s} seed {seed} designed / {rival:10s} {text}", flush=True)
                for kind, one in plain.items():
                    print(" " * 9, kind, {key: round(value, 4) for key, value in one.items()}, flush=True)
    return rows, summarise(rows)


def summarise(rows):
    """Of the ratios over the seeds the geometric mean and the factor of spread, exp of the logarithms' deviation."""
    summary = {}
    for name, machine in dict.fromkeys((row["robot"], row["machine"]) for row in rows):
        mine = [row for row in rows if (row["robot"], row["machine"]) == (name, machine)]
        for rival in ("sinusoids", "random"):
            logs = {key: np.log([one["ratio"][rival][key] for one in mine]) for key in MEASURES}
            summary[f"{name}, {machine}: designed / {rival}"] = {
                key: {"mean": float(np.exp(values.mean())), "spread": float(np.exp(values.std(ddof=len(values) > 1)))}
                for key, values in logs.items()
            }
        for kind in mine[0]["figures"]:
            covered = [one["figures"][kind]["coverage_95"] for one in mine]
            print(
                f"{name}, {machine}: {kind} covers {np.mean(covered):.1%} of the truth with 95 % intervals", flush=True
            )
    for what, ratios in summary.items():
        text = "  ".join(f"{key} {one['mean']:.3f} (x/ {one['spread']:.2f})" for key, one in ratios.items())
        print(f"{what:40s}", text, flush=True)
    return summary


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--robot", nargs="+", default=["head", "arm"])
    parser.add_argument("--machine", nargs="+", choices=list(MACHINES), default=list(MACHINES))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--duration", type=float, default=30.0, help="of each recording [s]")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", CasysidWarning)
    rows, summary = run(arguments.robot, arguments.machine, arguments.seeds, arguments.duration)
    if arguments.json:
        arguments.json.write_text(json.dumps({"cases": rows, "ratios": summary}, indent=1))


if __name__ == "__main__":
    main()

"""Times the design of excitation, compares it with rivals on the same problem, and checks every motion it returns.

    python scripts/benchmark_excitation.py --json excitation.json [--part speed rivals safety]

``speed``: four starts on bundled models (and on a URDF given with --robot), wall and processor seconds, evaluations,
gradients against finite differences. ``rivals``: log det and condition number of the same weighted base information
against the best of 200 random feasible motions and against SLSQP with finite differences, which is given ten times the
time on the same objective. ``safety``: violations on grids ten times finer than that of the design and more, and when
the motion is played in MuJoCo under computed torque, over robots and seeds: on a machine like the model file, against
the limits that were designed for, which leave room for a controller, and against those of the file; and on one with
other masses, stiction, cables, lag and noisy sensors, against those of the file. Whether designed excitation pays is in
``rehearse_excitation.py``.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import time
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

from casysid.bundled import find_model
from casysid.errors import CasysidError, CasysidWarning, RobotError
from casysid.excitation import (
    ConditionNumber,
    FourierSeries,
    JointLimits,
    build_excitation,
    design_excitation,
    verify_recorded,
)
from casysid.excitation.motion.fourier import Motion
from casysid.excitation.search.constraint_sampling import on_grid
from casysid.excitation.search.initial import find_standing, random_start, small_motion
from casysid.excitation.search.program import Evaluation
from casysid.excitation.search.scaling import scaled_to_feasible
from casysid.excitation.search.search import STRIDE
from casysid.robot import Robot
from casysid.simulation import Mechanics
from casysid.simulation.truth import drive_parameters, felt_inertia, true_parameters
from casysid.validation import RehearsalSettings, play
from casysid.validation.rehearsal import build_machine

SERIES = FourierSeries(10.0, 5)
RANDOM = 200
SHARES = {"position": 0.95, "velocity": 0.9, "torque": 0.7}  # of the file's limits, that a design keeps to by default


class Clock:
    """Wall and processor seconds since it was made."""

    def __init__(self):
        self.began = time.perf_counter(), time.process_time()

    def read(self):
        """Since then."""
        return {"wall": time.perf_counter() - self.began[0], "cpu": time.process_time() - self.began[1]}


def gradient_error(problem, seed=0):
    """Largest relative error of objective's and constraints' slopes along a random direction."""
    rng = np.random.default_rng(seed)
    evaluation = Evaluation(problem)
    x = small_motion(problem, find_standing(problem, seed), seed)
    direction, h = rng.normal(size=len(x)), 1e-6
    gradient = evaluation.gradient(x)
    jacobian = np.zeros((len(evaluation.constraints(x)), len(x)))
    jacobian[evaluation.pattern] = evaluation.jacobian(x)
    slope = (evaluation.objective(x + h * direction) - evaluation.objective(x - h * direction)) / (2 * h)
    slopes = (evaluation.constraints(x + h * direction) - evaluation.constraints(x - h * direction)) / (2 * h)
    return {
        "objective": abs(slope - gradient @ direction) / abs(gradient @ direction),
        "constraints": float(np.abs(slopes - jacobian @ direction).max() / np.abs(slopes).max()),
    }


def quality(problem, trajectory):
    information = problem.gained(trajectory, 10)
    return {"log_det": float(np.linalg.slogdet(information)[1]), "condition": float(np.linalg.cond(information))}


def run_speed(robots):
    rows = []
    for name, path in robots.items():
        clock = Clock()
        problem = build_excitation(Robot.from_file(path), series=SERIES)
        design = design_excitation(problem, starts=4)
        rows.append(
            {
                "robot": name,
                "joints": problem.robot.nv,
                "base_parameters": problem.information.size,
                **clock.read(),
                "status": design.status.name,
                "starts": [f"{one.status.name} {one.iterations}" for one in design.starts],
                "evaluations": design.evaluations,
                "gradient_error": gradient_error(problem),
                **quality(problem, design.trajectory),
                "shrink": design.shrink,
                "passed": design.check().passed,
            }
        )
        print(
            f"{name:10s} {problem.robot.nv:2d} joints, {problem.information.size:3d} base parameters: "
            f"{rows[-1]['wall']:6.1f} s wall, {rows[-1]['cpu']:6.1f} s cpu, {design.status.name}, "
            f"{sum(one.iterations for one in design.starts)} iterations, log det {rows[-1]['log_det']:.1f}, "
            f"condition {rows[-1]['condition']:.3g}, kept {rows[-1]['passed']}",
            flush=True,
        )
    return rows


def random_best(problem):
    """Best log det and best condition number of 200 random motions that keep the limits of the design grid."""
    evaluation = Evaluation(problem)
    standing, rng = find_standing(problem, 0), np.random.default_rng(1)
    found = []
    while len(found) < RANDOM:
        x = random_start(problem, evaluation, standing, rng)
        if x is not None:
            found.append(quality(problem, problem.trajectory(x)))
    return {"log_det": max(one["log_det"] for one in found), "condition": min(one["condition"] for one in found)}


def slsqp(problem, seconds):
    """SLSQP by finite differences on the same variables and constraints, from new starts until the time is over.

    Where it ends beyond the limits, its motion is made smaller as ours would be.
    """
    evaluation = Evaluation(problem, on_grid(problem, STRIDE))
    standing, rng = find_standing(problem, 0), np.random.default_rng(0)
    lower, upper = evaluation.bounds(problem.tightening)
    finite = np.isfinite(lower), np.isfinite(upper)
    nothing = {"log_det": -np.inf, "condition": np.inf}
    began, best, ends = time.process_time(), (np.inf, nothing), 0

    def room(x):
        values = evaluation.constraints(x)
        return np.concatenate([(values - lower)[finite[0]], (upper - values)[finite[1]]])

    def watch(x):
        latest[:] = [x.copy()]
        if time.process_time() - began > seconds:
            raise StopIteration

    x = small_motion(problem, standing, 0)
    while time.process_time() - began < seconds:
        latest = [x]
        with contextlib.suppress(StopIteration):
            answer = minimize(
                evaluation.objective,
                x,
                method="SLSQP",
                callback=watch,
                options={"maxiter": 1000, "ftol": 1e-6},
                constraints={"type": "ineq", "fun": room},
            )
            latest, ends = [answer.x], ends + 1
        smaller = scaled_to_feasible(problem, latest[0])
        if smaller is not None and (value := evaluation.objective(smaller[0])) < best[0]:
            best = value, quality(problem, problem.trajectory(smaller[0]))
        drawn = random_start(problem, evaluation, standing, rng)
        x = x if drawn is None else drawn
    return {"cpu": time.process_time() - began, "finished_runs": ends, **best[1]}


def run_rivals(robots, budget):
    rows = []
    for name, path in robots.items():
        problem = build_excitation(Robot.from_file(path), series=SERIES)
        clock = Clock()
        design = design_excitation(problem, starts=4)
        ours = {**clock.read(), **quality(problem, design.trajectory)}
        clock = Clock()
        conditioned = design_excitation(problem.judged_by(ConditionNumber()), starts=4)
        second = {**clock.read(), **quality(problem, conditioned.trajectory)}
        given = min(10.0 * ours["cpu"], budget)
        row = {
            "robot": name,
            "default": ours,
            "condition number": second,
            "random": random_best(problem),
            "SLSQP": {**slsqp(problem, given), "share_of_ten_times": given / (10.0 * ours["cpu"])},
        }
        rows.append(row)
        for rival, one in list(row.items())[1:]:
            figures = f"log det {one['log_det']:8.2f}  condition {one['condition']:10.4g}"
            print(f"{name:10s} {rival:17s} {figures}  cpu {one.get('cpu', float('nan')):7.1f} s", flush=True)
    return rows


def random_tree(rng, joints):
    """Revolute joints in a tree, links of some decimetres, usual limits."""
    model = pin.Model()
    for k in range(joints):
        parent = int(rng.integers(max(0, k - 1), k + 1))
        place = pin.SE3(pin.exp3(rng.integers(4) * np.pi / 2 * np.eye(3)[rng.integers(3)]), rng.normal(size=3) * 0.2)
        joint = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)[rng.integers(3)]()
        limit = np.ones(1)
        effort = limit * 200.0 * 0.7**k
        body = model.addJoint(parent, joint, place, f"joint_{k + 1}", effort, 3.0 * limit, -2.0 * limit, 2.0 * limit)
        root = rng.normal(size=(3, 3)) * 0.1
        second = root @ root.T + 1e-3 * np.eye(3)
        mass = 3.0 * 0.8**k
        body_inertia = pin.Inertia(mass, rng.normal(size=3) * 0.05, mass * (np.trace(second) * np.eye(3) - second))
        model.appendBodyToJoint(body, body_inertia, pin.SE3.Identity())
    return Robot.from_pin(model, name=f"tree of {joints}")


def simulable(robot):
    """The robot; where a joint of it moves no mass, with rotors as a rehearsal gives to files without any."""
    try:
        felt_inertia(robot)
    except RobotError:
        rotors = drive_parameters(robot, true_parameters(robot, Mechanics()))[3]
        return robot.with_parameters(inertial_parameters=robot.inertial_parameters, armature=rotors)
    return robot


def file_limits(problem):
    """The same problem within the limits of the model file (as assumed, where it has none), links just not touching."""
    limits = problem.limits
    reach = limits.half_range / SHARES["position"]
    widest = JointLimits(
        lower=limits.middle - reach,
        upper=limits.middle + reach,
        velocity=limits.velocity / SHARES["velocity"],
        acceleration=limits.acceleration,
        jerk=limits.jerk,
        torque=limits.torque / SHARES["torque"],
    )
    return build_excitation(problem.robot, series=problem.series, limits=widest, clearance=0.0)


def played(design, seed):
    """Violations in MuJoCo, and the nearest of each kind as a share of its scale."""
    machine, within = build_machine(design.problem.robot, RehearsalSettings(seed=seed)), file_limits(design.problem)
    try:
        alike = play(design, rate=1000.0)
        unlike = play(design, machine, within=within, seed=seed)
    except CasysidError as error:
        print(f"    not played: {error}", flush=True)
        return {}
    run = alike.run
    moved = Motion(run.channels, run.v, run.a, np.full_like(run.a, np.nan))
    checks = {
        "like_file, limits designed for": (run, alike.verification),
        "like_file, limits of the file": (run, verify_recorded(within, run.reference.time, moved, run.tau)),
        "unlike_file, limits of the file": (unlike.run, unlike.verification),
    }
    return {
        name: {
            "violations": [str(one) for one in checked.violations],
            "tightest": {one.kind: one.share for one in checked.tightest},
            "most_saturated": float(run.saturated.max()),
            "status": run.status.name,
        }
        for name, (run, checked) in checks.items()
    }


def run_safety(robots, cases):
    """Violations at 10, 17 and 40 times the instants of the design grid, and when played."""
    rng = np.random.default_rng(0)
    made = {
        f"{name} seed {seed}": (lambda path=path: Robot.from_file(path), seed)
        for seed in (0, 1)
        for name, path in robots.items()
    }
    seed = 0
    while len(made) < cases:
        made[f"tree {seed}"] = (lambda joints=2 + seed % 4: random_tree(rng, joints), seed)
        seed += 1
    rows = []
    for name, (make, seed) in list(made.items())[:cases]:
        clock = Clock()
        try:
            problem = build_excitation(simulable(make()))
            design = design_excitation(problem, starts=2, seed=seed, max_iterations=100)
        except CasysidError as error:
            rows.append({"case": name, "refused": str(error)})
            print(f"{name:24s} refused: {error}", flush=True)
            continue
        violations = [len(design.check(factor * problem.samples).violations) for factor in (10, 17, 40)]
        runs = played(design, seed)
        rows.append(
            {
                "case": name,
                "violations": violations,
                "played": runs,
                "status": design.status.name,
                "shrink": design.shrink,
                "log_det": design.log_det,
                **clock.read(),
            }
        )
        counts = [len(one["violations"]) for one in runs.values()]
        print(
            f"{name:24s} violations {violations}, played {counts}, {design.status.name}, shrink {design.shrink:.4f}, "
            f"log det {design.log_det:.1f}, {rows[-1]['cpu']:.1f} s cpu",
            flush=True,
        )
        for kind, one in runs.items():
            nearest = ", ".join(f"{what} {share:.4f}" for what, share in one["tightest"].items())
            line = f"    {kind:31s} {one['status']} {nearest}, saturated {one['most_saturated']:.2%}"
            print(line, *one["violations"][:2], sep=" | ", flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--part", nargs="+", default=["speed", "rivals", "safety"])
    parser.add_argument("--models", nargs="*", default=["two_link", "scara", "head", "arm"], help="bundled ones")
    parser.add_argument("--robot", nargs="*", default=[], help="further models, as NAME=FILE")
    parser.add_argument("--cases", type=int, default=20, help="of the safety part")
    parser.add_argument("--budget", type=float, default=120.0, help="processor seconds that SLSQP gets at most")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", CasysidWarning)
    more = {name: Path(path) for name, _, path in (text.partition("=") for text in arguments.robot)}
    robots = {name: find_model(name) for name in arguments.models} | more
    figures = {}
    if "speed" in arguments.part:
        figures["speed"] = run_speed(robots)
    if "rivals" in arguments.part:
        figures["rivals"] = run_rivals(robots, arguments.budget)
    if "safety" in arguments.part:
        figures["safety"] = run_safety(robots, arguments.cases)
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()

"""Times the physically consistent projection and checks it against an independent convex optimum.

Random robots (chains and trees) move along Fourier series; torques carry noise and some friction that no column
explains, so that least squares violates physics. For each, IPOPT's projection is compared with the optimum of the data
misfit alone, found by Clarabel without prior and floor.

    python scripts/benchmark_projection.py --json projection.json
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import clarabel
import numpy as np
import pinocchio as pin
from scipy import sparse
from scipy.linalg import block_diag

from casysid.inertia import (
    CONSISTENCY_BASIS,
    KINDS,
    Consistency,
    is_consistent,
    parameters_from_pseudo_inertia,
    pseudo_inertia,
)
from casysid.projection import PRIOR_BUDGET, ProjectionStatus, build_projection, project


@dataclass(frozen=True)
class Column:
    """A regressor column, as the projection wants to see it."""

    name: str
    owner: str
    kind: str
    non_negative: bool


@dataclass(frozen=True)
class Case:
    """One experiment, its rows divided by their noise."""

    metric: np.ndarray
    estimate: np.ndarray
    prior: np.ndarray
    residual_energy: float


def columns(joints):
    links = [Column(f"l{i}.{kind}", f"l{i}", kind, False) for i in range(joints) for kind in KINDS]
    return links + [Column(f"j{i}.viscous", f"j{i}", "viscous", True) for i in range(joints)]


def random_robot(joints, rng):
    """A chain, or with even chance a tree, lighter towards its tips."""
    model, tree, axis = pin.Model(), rng.random() < 0.5, 0
    for index in range(joints):
        parent = int(rng.integers(1, index + 1)) if tree and index and rng.random() < 0.4 else index
        axis = (axis + rng.integers(1, 3)) % 3
        tilt = pin.exp3(0.8 * rng.normal(size=3) * (rng.random() < 0.3))
        place = pin.SE3(tilt, rng.normal(size=3) * [0.02, 0.02, 0.25])
        joint = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)[axis]()
        body = model.addJoint(parent, joint, place, f"j{index}")
        mass = rng.uniform(0.7, 1.4) * (6.0 * 0.75**index + 0.3)
        root = np.diag([0.02, 0.02, 0.045]) @ rng.normal(size=(3, 3))
        second = root @ root.T + 2e-4 * np.eye(3)
        inertia = pin.Inertia(
            mass, rng.normal(size=3) * [0.03, 0.03, 0.1], mass * (np.trace(second) * np.eye(3) - second)
        )
        model.appendBodyToJoint(body, inertia, pin.SE3.Identity())
    return model


def random_motion(joints, samples, rng):
    """Fourier series of five harmonics of 0.1 Hz over 20 s: q, v, a of shape (samples, joints)."""
    time_ = np.linspace(0.0, 20.0, samples)[:, None, None]
    omega = 0.2 * np.pi * np.arange(1, 6)[:, None]  # (5, 1)
    sine, cosine = 0.5 * rng.normal(size=(2, 5, joints)) / np.arange(1, 6)[:, None]
    phase = omega * time_  # (samples, 5, 1)
    q = (sine * np.sin(phase) + cosine * np.cos(phase)).sum(axis=1) + rng.uniform(-1.0, 1.0, joints)
    v = (omega * (sine * np.cos(phase) - cosine * np.sin(phase))).sum(axis=1)
    a = (-(omega**2) * (sine * np.sin(phase) + cosine * np.cos(phase))).sum(axis=1)
    return q, v, a


def regressor_rows(model, q, v, a):
    """Shape (samples, joints, 11 joints)."""
    data, joints = model.createData(), model.nv
    rows = np.zeros((len(q), joints, 11 * joints))
    for k in range(len(q)):
        rows[k, :, : 10 * joints] = pin.computeJointTorqueRegressor(model, data, q[k], v[k], a[k])
        rows[k, range(joints), range(10 * joints, 11 * joints)] = v[k]
    return rows


def model_file(truth, joints, rng):
    """A prior as a CAD file is: every link sheared and scaled by about 25 %, friction wrong by up to a factor two."""
    shear = np.eye(4) + 0.25 * rng.normal(size=(joints, 4, 4))
    root = np.linalg.cholesky(pseudo_inertia(truth[: 10 * joints].reshape(-1, 10))) @ shear
    bodies = parameters_from_pseudo_inertia(root @ root.transpose(0, 2, 1))
    return np.concatenate([bodies.ravel(), truth[10 * joints :] * rng.uniform(0.5, 2.0, joints)])


def random_case(joints, samples, noise, rng):
    """One experiment and its least-squares estimate, unseen directions left at the prior."""
    model = random_robot(joints, rng)
    q, v, a = random_motion(joints, samples, rng)
    links = [model.inertias[i].toDynamicParameters() for i in range(1, joints + 1)]
    truth = np.concatenate([*links, rng.uniform(0.05, 0.5, joints)])
    rows = regressor_rows(model, q, v, a)
    tau = rows @ truth
    size = tau.std(axis=0)
    tau = tau + noise * size * (0.7 * rng.normal(size=tau.shape) + 0.7 * np.tanh(20.0 * v))
    x, y = (rows / (noise * size)[:, None]).reshape(-1, 11 * joints), (tau / (noise * size)).ravel()
    prior = model_file(truth, joints, rng)
    scale = 1.0 / np.maximum(np.linalg.norm(x, axis=0), 1e-12)
    step = scale * np.linalg.lstsq(x * scale, y - x @ prior, rcond=3e-5)[0]
    return Case(x.T @ x, prior + step, prior, float(np.sum((y - x @ (prior + step)) ** 2)))


def infeasible_cases(joints, count, samples, noise, seed):
    """Experiments whose estimate is not consistent, and how many had to be drawn."""
    rng, cases, drawn = np.random.default_rng(seed), [], 0
    while len(cases) < count:
        case, drawn = random_case(joints, samples, noise, rng), drawn + 1
        estimate = case.estimate
        if not is_consistent(estimate[: 10 * joints].reshape(-1, 10)).all() or (estimate[10 * joints :] < 0).any():
            cases.append(case)
    return cases, drawn


def convex_optimum(case, joints):
    """Least data misfit of consistent parameters, as a fraction of the residual energy: optimum, bound, status."""
    basis = CONSISTENCY_BASIS[Consistency.FULL]
    roots = np.linalg.cholesky(pseudo_inertia(case.prior[: 10 * joints].reshape(-1, 10)))
    blocks = [
        parameters_from_pseudo_inertia(root @ basis @ root.T).T for root in roots
    ]  # the prior's links become unit ones
    change = block_diag(*blocks, np.diag(case.prior[10 * joints :]))
    triangle = np.array([basis[:, i, j] * (1.0 if i == j else 2**0.5) for j in range(4) for i in range(j + 1)])
    cone = sparse.block_diag([-triangle] * joints + [-np.eye(joints)], format="csc")
    offset = -cone @ np.linalg.solve(change, case.estimate)
    scale = 1e4 / case.residual_energy
    settings = clarabel.DefaultSettings()
    settings.verbose = settings.equilibrate_enable = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-9
    kinds = [clarabel.PSDTriangleConeT(4)] * joints + [clarabel.NonnegativeConeT(joints)]
    quadratic = sparse.csc_matrix(np.triu(2.0 * scale * change.T @ case.metric @ change))
    solution = clarabel.DefaultSolver(quadratic, np.zeros(11 * joints), cone, offset, kinds, settings).solve()
    return solution.obj_val / 1e4, solution.obj_val_dual / 1e4, str(solution.status)


def measure(joints, count, samples, noise, seed, prior_budget):
    """All figures of one size."""
    cases, drawn = infeasible_cases(joints, count, samples, noise, seed)
    began = time.perf_counter()
    problem = build_projection(columns(joints), prior_budget=prior_budget)
    project(problem, cases[0].estimate, cases[0].metric, cases[0].prior)  # IPOPT is set up at the first solve
    build = time.perf_counter() - began
    rows = []
    for case in cases:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            cpu = time.process_time()
            result = project(problem, case.estimate, case.metric, case.prior, residual_energy=case.residual_energy)
            cpu = time.process_time() - cpu
        optimum, bound, status = convex_optimum(case, joints)
        away = result.parameters - case.estimate
        misfit = away @ case.metric @ away / case.residual_energy
        rows.append(
            {
                "status": result.status.name,
                "solver": result.solver.value,
                "seconds": result.seconds,
                "cpu_seconds": cpu,
                "iterations": result.iterations,
                "misfit": misfit,
                "convex_optimum": optimum,
                "convex_bound": bound,
                "convex_status": status,
                "excess": misfit - optimum,
                "gap": result.gap,
                "prior_weight": result.prior_weight,
                "prior_cost": result.prior_cost,
                "consistent": bool(is_consistent(result.parameters[: 10 * joints].reshape(-1, 10)).all()),
                "warnings": [str(warning.message) for warning in caught],
            }
        )
        print(
            f"{11 * joints:4d} {rows[-1]['status']:12s} {rows[-1]['solver']:9s}{result.seconds:7.3f} s"
            f"{result.iterations:5d} it  misfit {misfit:.1e}  above optimum {misfit - optimum:+.1e}"
            f"  gap {result.gap:+.1e}"
            f"  weight {result.prior_weight:.0e}  {status}",
            file=sys.stderr,
        )
    seconds = [row["seconds"] for row in rows]
    certified = [row["status"] == ProjectionStatus.CERTIFIED.name for row in rows]
    return {
        "parameters": 11 * joints,
        "cases": count,
        "drawn": drawn,
        "build_seconds": build,
        "median_seconds": float(np.median(seconds)),
        "largest_seconds": max(seconds),
        "median_cpu_seconds": float(np.median([row["cpu_seconds"] for row in rows])),
        "median_iterations": float(np.median([row["iterations"] for row in rows])),
        "answers_by_ipopt": sum(row["solver"] == "ipopt" for row in rows),
        "certified": sum(certified),
        "largest_excess": max(row["excess"] for row in rows),
        "largest_gap": max(row["gap"] for row in rows),
        "all_consistent": all(row["consistent"] for row in rows),
        "rows": rows,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="where the figures are written")
    parser.add_argument("--joints", type=int, nargs="+", default=[7, 10])
    parser.add_argument("--cases", type=int, default=20, help="infeasible estimates of each size")
    parser.add_argument("--samples", type=int, default=1000)
    parser.add_argument("--noise", type=float, default=0.05, help="of each joint's torque")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--prior-budget", type=float, default=PRIOR_BUDGET, help="what the prior may cost the data")
    options = parser.parse_args()
    settings = options.cases, options.samples, options.noise, options.seed, options.prior_budget
    figures = [measure(joints, *settings) for joints in options.joints]
    for figure in figures:
        print(", ".join(f"{name} {value:.3g}" for name, value in figure.items() if name != "rows"))
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()

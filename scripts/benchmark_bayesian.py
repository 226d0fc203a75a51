"""Times Bayesian de-noising from moments against the same EM over rows.

    python scripts/benchmark_bayesian.py [--rows 500000] [--columns 110] [--redundant 50] [--json FILE]

One run of the paper's synthetic problem (§IV-A), as large as its arm's (110 features, 500 000 samples). From its
moments one start is fitted to convergence. Plain EM over the rows, vectorised in blocks, is timed for a few iterations
only; how many it would need for the same bound is counted with plain EM on moments, whose iterates are the same, and
the time is their product. Where plain EM does not get there in --em-iterations, that number stands in: the ratio is a
lower limit.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from synthetic_regression import Array, draw_problem

from casysid.estimation.bayesian import BayesianDenoising
from casysid.estimation.denoising import Start, denoise
from casysid.estimation.denoising_em import DenoisingModel, State
from casysid.estimation.standardise import standardise
from casysid.moments import Moments

BLOCK = 20_000
START = Start(0.2)
Result = TypeVar("Result")


def timed(function: Callable[[], Result], repeats: int = 1) -> tuple[Result, float]:
    """The result and the shortest wall time."""
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        result = function()
        best = min(best, time.perf_counter() - begin)
    return result, best


def em_over_rows(x: Array, y: Array, state: State, model: DenoisingModel) -> State:
    """One iteration as the appendix has it, <z> and <t> of every row being computed (Σzt with its right sign)."""
    wz, wx, psi_x, psi_z, var_z, var_x, psi_y = state
    n, d = x.shape
    K = 1.0 + (wx**2 + var_x) / psi_x + (wz**2 + var_z) / psi_z
    M = psi_z + wz**2 / (1.0 + (wx**2 + var_x) / psi_x + var_z / psi_z)
    cov_z = np.diag(M) - np.outer(M, M) / (psi_y + M.sum())
    gain = wz / (psi_z * K)
    zz, zt, tt, xt, residual = np.zeros(d), np.zeros(d), np.zeros(d), np.zeros(d), 0.0
    for begin in range(0, n, BLOCK):
        rows, output = x[begin : begin + BLOCK], y[begin : begin + BLOCK]
        z = np.outer(output, cov_z.sum(axis=0) / psi_y) + (rows * (wx / psi_x * gain)) @ cov_z
        t = z * gain + rows * (wx / (psi_x * K))
        zz += (z * z).sum(axis=0)
        zt += (z * t).sum(axis=0)
        tt += (t * t).sum(axis=0)
        xt += (rows * t).sum(axis=0)
        residual += float(((output - z.sum(axis=1)) ** 2).sum())
    var = np.diag(cov_z)
    zz, zt, tt = zz + n * var, zt + n * var * gain, tt + n * (1.0 / K + gain**2 * var)
    alpha = model.relevance(wz**2 + var_z + wx**2 + var_x)
    var_z, var_x = 1.0 / (tt / psi_z + alpha), 1.0 / (tt / psi_x + alpha)
    wz, wx = var_z / psi_z * zt, var_x / psi_x * xt
    return State(
        wz,
        wx,
        (model.energy - 2.0 * wx * xt + (wx**2 + var_x) * tt) / n,
        (zz - 2.0 * wz * zt + (wz**2 + var_z) * tt) / n,
        var_z,
        var_x,
        (residual + n * cov_z.sum()) / n,
    )


def plain_em(model: DenoisingModel, state: State, target: float, limit: int) -> tuple[int, float]:
    """Iterations until the bound reaches ``target``, ``limit`` at most, and the last bound."""
    for iteration in range(limit + 1):
        expected = model.expect(state)
        if expected.bound >= target or iteration == limit:
            break
        state = model.maximise(state, expected)
    return iteration, expected.bound


def measure(
    rows: int, columns: int, redundant: int, em_iterations: int, slow_iterations: int
) -> dict[str, float | bool]:
    train = draw_problem(np.random.default_rng(0), rows, 2.0, 5.0, redundant, dimensions=columns).train
    moments, pass_seconds = timed(lambda: Moments.from_rows(train.x, train.y, blocks=20))
    estimator = BayesianDenoising(starts=(START,))
    _, estimate_seconds = timed(lambda: estimator.estimate(moments), 3)
    problem = standardise(moments)
    scale = estimator.scale(problem)
    normal = scale.apply(problem.normal)
    posterior, fit_seconds = timed(lambda: denoise(normal, prior=estimator.prior, starts=[START]), 5)

    model = DenoisingModel(normal, estimator.prior)
    unit = problem.target_rms * problem.noise_std[0]  # rows as the model sees them
    x, y = train.x * (problem.scale / unit), train.y * (scale.output / unit)
    slow = fast = START.state(model)
    begin = time.perf_counter()
    for _ in range(slow_iterations):
        slow = em_over_rows(x, y, slow, model)
    slow_seconds = (time.perf_counter() - begin) / slow_iterations
    for _ in range(slow_iterations):
        fast = model.maximise(fast, model.expect(fast))
    target = posterior.bound - 1e-9 * abs(posterior.bound)
    (needed, reached), moment_seconds = timed(lambda: plain_em(model, START.state(model), target, em_iterations))
    return {
        "rows": rows,
        "columns": columns,
        "redundant": redundant,
        "seconds_moments": pass_seconds,
        "seconds_estimate": estimate_seconds,
        "seconds_fit": fit_seconds,
        "fit_iterations": len(posterior.bounds) - 1,
        "fit_evaluations": posterior.evaluations,
        "bound": posterior.bound,
        "smallest_gain_of_bound": float(np.diff(posterior.bounds).min()),
        "seconds_per_iteration_over_rows": slow_seconds,
        "seconds_per_iteration_on_moments": moment_seconds / max(needed, 1),
        "largest_difference_rows_and_moments": max(
            float(np.max(np.abs(a - b) / np.max(np.abs(b)))) for a, b in zip(slow, fast, strict=True)
        ),
        "plain_em_iterations": needed,
        "plain_em_reached_the_bound": bool(reached >= target),
        "plain_em_bound_missing": posterior.bound - reached,
        "seconds_over_rows_extrapolated": slow_seconds * needed,
        "speed_up": slow_seconds * needed / fit_seconds,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=500_000)
    parser.add_argument("--columns", type=int, default=110)
    parser.add_argument("--redundant", type=int, default=50)
    parser.add_argument("--em-iterations", type=int, default=20_000, help="of plain EM on moments at most")
    parser.add_argument("--slow-iterations", type=int, default=3, help="of EM over rows")
    parser.add_argument("--json", type=Path, help="file to write the figures to")
    options = parser.parse_args()
    figures = measure(options.rows, options.columns, options.redundant, options.em_iterations, options.slow_iterations)
    for name, value in figures.items():
        print(f"{name:36s} {value:.6g}" if isinstance(value, float) else f"{name:36s} {value}")
    if options.json:
        temporary = options.json.with_name(options.json.name + ".part")
        temporary.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
        os.replace(temporary, options.json)


if __name__ == "__main__":
    main()

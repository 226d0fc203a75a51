"""Time from samples to moments: Pinocchio's regressor in a Python loop, and casysid by both routes, side by side.

    python scripts/benchmark_moments.py [--samples 1000000] [--repeats 3] [--json FILE]

Arms of 7 and 10 joints with random placements and axes. The loop stacks rows with friction columns and takes one dense
product for all joints, with one and with two BLAS threads, whichever is faster; casysid takes one for each joint and
block. All routes take turns in one process, and the best of each counts, so that other load on the machine weighs on
all alike. Peak memory is that of a process of its own that holds ``--samples`` samples of the larger arm and their
moments.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from threadpoolctl import threadpool_limits

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.dynamics import Regressor, build_regressor, bulk
from casysid.robot import Robot

LOOP_SAMPLES, REPLAY_SAMPLES, CHUNK = 20_000, 100_000, 2_000
WIDTH = 0.01  # of the Coulomb columns, as in casysid's default


def random_arm(joints: int) -> Robot:
    """A serial chain of revolute joints with random placements and axes."""
    rng = np.random.default_rng(joints)
    model = pin.Model()
    for k in range(joints):
        axis = rng.normal(size=3)
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(scale=0.3, size=3))
        joint = model.addJoint(k, pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis)), place, f"joint_{k + 1}")
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.full(3, 0.1), 0.1 * np.eye(3)), pin.SE3.Identity())
    return Robot.from_pin(model)


def random_log(robot: Robot, samples: int) -> Array:
    """Positions, velocities, accelerations and torques, shape (4, samples, nv)."""
    return np.random.default_rng(0).normal(size=(4, samples, robot.nv))


def loop_moments(robot: Robot, q: Array, v: Array, a: Array, tau: Array) -> Array:
    """Pooled moments as one writes them with Pinocchio: a loop over samples, a dense product for each chunk of rows."""
    model, data, n = robot.model, robot.model.createData(), robot.nv
    rigid = 10 * n
    rows = np.zeros((CHUNK, n, rigid + 4 * n + 1))
    diagonal, gram = np.arange(n), np.zeros((rows.shape[2], rows.shape[2]))
    for start in range(0, len(q), CHUNK):
        part = slice(start, start + CHUNK)
        for k, state in enumerate(zip(q[part], v[part], a[part], strict=True)):
            rows[k, :, :rigid] = pin.computeJointTorqueRegressor(model, data, *state)
        for block, values in enumerate((v[part], np.tanh(v[part] / WIDTH), np.ones_like(v[part]), a[part])):
            rows[:, diagonal, rigid + block * n + diagonal] = values
        rows[:, :, -1] = tau[part]
        stacked = rows.reshape(-1, rows.shape[2])
        gram += stacked.T @ stacked
    return gram


def routes(robot: Robot, samples: int) -> dict[str, tuple[int, Callable[[], object]]]:
    """What is compared: samples and a run of each route."""
    log = random_log(robot, samples)
    replayed, compiled = build_regressor(robot), build_regressor(dataclasses.replace(robot))  # nothing shared
    found = bulk.FIND_FROM, bulk.COMPILE_FROM
    bulk.FIND_FROM = bulk.COMPILE_FROM = math.inf  # type: ignore[assignment]
    _ = replayed.equations  # made while compiling is out of reach
    bulk.FIND_FROM, bulk.COMPILE_FROM = 0, 0
    accumulate_moments(compiled, *log[:, :100])  # compiled before the clock starts
    bulk.FIND_FROM, bulk.COMPILE_FROM = found

    def loop(blas_threads: int) -> Callable[[], object]:
        def run() -> object:
            with threadpool_limits(blas_threads, user_api="blas"):
                return loop_moments(robot, *log[:, :LOOP_SAMPLES])

        return run

    def ours(regressor: Regressor, count: int, threads: int) -> Callable[[], object]:
        return lambda: accumulate_moments(regressor, *log[:, :count], threads=threads)

    table: dict[str, tuple[int, Callable[[], object]]] = {
        f"pinocchio loop, {k} BLAS threads": (LOOP_SAMPLES, loop(k)) for k in (1, 2)
    }
    for threads in (1, 2):
        count = min(REPLAY_SAMPLES, samples)
        table[f"casysid replay, {threads} threads"] = count, ours(replayed, count, threads)
        if compiled.equations.route == "compiled":
            table[f"casysid compiled, {threads} threads"] = samples, ours(compiled, samples, threads)
    return table


def compare(robot: Robot, samples: int, repeats: int) -> dict[str, tuple[float, float]]:
    """Best elapsed and best processor time (of all threads) of each route [µs per sample]."""
    table = routes(robot, samples)
    best = dict.fromkeys(table, (math.inf, math.inf))
    for _ in range(repeats):
        for name, (count, run) in table.items():
            start = time.perf_counter(), time.process_time()
            run()
            spent = time.perf_counter() - start[0], time.process_time() - start[1]
            best[name] = min(best[name][0], 1e6 * spent[0] / count), min(best[name][1], 1e6 * spent[1] / count)
    return best


def peak_memory(samples: int) -> float:
    """Peak resident memory [GB] of a process that holds a log of the 10-joint arm and sums it."""
    command = [sys.executable, __file__, "--hold", "--samples", str(samples)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def hold(samples: int) -> None:
    """Sum one long log and print the peak memory of this process [GB]."""
    robot = random_arm(10)
    accumulate_moments(build_regressor(robot), *random_log(robot, samples))
    unit = 1 if sys.platform == "darwin" else 1024  # bytes
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--hold", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.hold:
        hold(arguments.samples)
        return
    result: dict[str, object] = {"samples": arguments.samples, "peak_memory_gb": peak_memory(arguments.samples)}
    for joints in (7, 10):
        times = compare(random_arm(joints), arguments.samples, arguments.repeats)
        loop, loop_cpu = (min(t[k] for name, t in times.items() if "loop" in name) for k in (0, 1))
        print(f"\n{joints} joints, µs/sample{'elapsed':>18}{'times faster':>14}{'processor':>12}{'times less':>12}")
        for name, (wall, cpu) in times.items():
            print(f"  {name:<32}{wall:>8.2f}{loop / wall:>14.1f}{cpu:>12.2f}{loop_cpu / cpu:>12.1f}")
        result[f"{joints} joints"] = {name: {"elapsed": wall, "processor": cpu} for name, (wall, cpu) in times.items()}
    print(f"\npeak memory, 10 joints, {arguments.samples} samples: {result['peak_memory_gb']:.2f} GB")
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()

"""What the threads of BLAS cost: one identification with OMP_NUM_THREADS unset and set to 1, in turns.

    python scripts/benchmark_threads.py [ROBOT [LOG ...]] [--pairs 5] [--duration 20] [--json FILE]

Every run is a process of its own: ``casysid identify ROBOT LOG ... --split 0.6``. Without logs the robot is simulated.
The processor's seconds of all threads count: other load on the machine hardly weighs on them. A first run, in which
kernels are compiled, does not count.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from casysid.bundled import find_model
from casysid.robot import Robot
from casysid.simulation import PD, ComputedTorque, ControlModel, Plant, PlantSettings, design_sinusoids, simulate

RATE = 500.0
"""Of the simulated log [Hz]."""
VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")


@dataclass(frozen=True)
class Spent:
    """Seconds of one run, or a median of several."""

    cpu: float
    wall: float


def simulated_log(robot: Robot, duration: float, path: Path) -> Path:
    """The robot under computed torque along sinusoids, as a log file."""
    plant = Plant(robot, PlantSettings())
    control = ComputedTorque(ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters))
    motion = design_sinusoids(robot, duration=duration, seed=0)
    return simulate(plant, control, motion, rate=RATE, duration=duration).recording.write(path)


def identify(robot: str, logs: Sequence[Path], threads: Mapping[str, str]) -> Spent:
    """One identification in a process of its own, in an environment with these settings of threads and no others."""
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "casysid", "identify", robot, *map(str, logs), "--split", "0.6"]
        used, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        done = subprocess.run(
            [*command, "--out", folder],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env={**environment, **threads},
        )
        wall, now = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr.decode()}")
    return Spent(now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime, wall)


def measure(robot: str, logs: Sequence[Path], pairs: int) -> dict[str, list[Spent]]:
    """Runs of either kind, taking turns."""
    kinds = {"unset": {}, "1": {"OMP_NUM_THREADS": "1"}}
    identify(robot, logs, {})
    runs: dict[str, list[Spent]] = {kind: [] for kind in kinds}
    for pair in range(pairs):
        for kind in sorted(kinds, reverse=bool(pair % 2)):
            runs[kind].append(identify(robot, logs, kinds[kind]))
    return runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", nargs="?", default="head", help="a bundled model's name or a file; default: head")
    parser.add_argument("logs", nargs="*", type=Path, metavar="LOG", help="recordings; default: one is simulated")
    parser.add_argument("--pairs", type=int, default=5, help="of runs; default: 5")
    parser.add_argument("--duration", type=float, default=20.0, help="of the simulated log [s]; default: 20")
    parser.add_argument("--json", type=Path, help="write the figures to this file as well")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        logs = options.logs or [
            simulated_log(
                Robot.from_file(find_model(options.robot)), options.duration, Path(folder) / "simulated.parquet"
            )
        ]
        runs = measure(options.robot, logs, options.pairs)
    print(f"{'OMP_NUM_THREADS':<18}{'CPU [s]':>10}{'elapsed [s]':>14}   medians of {options.pairs}")
    for kind, several in runs.items():
        cpu, wall = (statistics.median(getattr(run, name) for run in several) for name in ("cpu", "wall"))
        print(f"{kind:<18}{cpu:>10.2f}{wall:>14.2f}")
    ratios = [many.cpu / one.cpu for many, one in zip(runs["unset"], runs["1"], strict=True)]
    print(f"CPU, unset over 1: {statistics.median(ratios):.3f} ({min(ratios):.3f} to {max(ratios):.3f})")
    if options.json:
        content = {kind: [vars(run) for run in several] for kind, several in runs.items()}
        options.json.write_text(json.dumps({"runs": content, "ratio": statistics.median(ratios)}, indent=2) + "\n")


if __name__ == "__main__":
    main()

"""Whether an identification depends on anything but its data: the same logs under other circumstances, compared.

    python scripts/check_invariance.py [ROBOT ...] [--duration 60] [--rate 1000] [--logs 3]

Every run is a process of its own, ``casysid identify``, and every number of its ``result.json`` but the seconds must be
the same to the last bit: for another seed of hashes, another working folder, the log's columns in another order,
OMP_NUM_THREADS unset, 1 and 2, compiled kernels made anew, found, and impossible. Several logs in another order may
move parameters and predicted torques by 1e-9 of their size. Ends with 1 if anything moves further.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from casysid import identify
from casysid.arrays import Array
from casysid.bundled import find_model
from casysid.identification import IdentificationResult
from casysid.readers.writing import write_columns
from casysid.recording import Source, open_recordings, read_recording
from casysid.robot import Robot
from casysid.simulation import PD, ComputedTorque, ControlModel, Plant, PlantSettings, design_sinusoids, simulate

ORDER = 1e-9
"""By which the order of logs may move an answer, relative."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")
SECONDS = "seconds"


@dataclass(frozen=True)
class Circumstance:
    """How a run differs from the first.

    Attributes:
        name: In words.
        variables: Of its environment; None takes one away.
        folder: In which it works, under the folder of all.
        log: Which file it reads.
    """

    name: str
    variables: Mapping[str, str | None] = field(default_factory=dict)
    folder: str = "here"
    log: str = "log.csv"


def circumstances(home: Path) -> Iterator[Circumstance]:
    """Each beside the first; caches are folders in ``home``."""
    for seed in ("1", "4242"):
        yield Circumstance(f"PYTHONHASHSEED={seed}", {"PYTHONHASHSEED": seed})
    yield Circumstance("another working folder", folder="another folder/of this")
    yield Circumstance("columns in another order", log="permuted.csv")
    yield Circumstance("OMP_NUM_THREADS unset", {"OMP_NUM_THREADS": None})
    yield Circumstance("OMP_NUM_THREADS=2", {"OMP_NUM_THREADS": "2"})
    for state in ("made anew", "found"):
        yield Circumstance(f"kernels {state}", {"XDG_CACHE_HOME": str(home / "cache")})
    (home / "file").touch()
    yield Circumstance("kernels not to be kept", {"XDG_CACHE_HOME": str(home / "file")})
    (home / "bin").mkdir(exist_ok=True)
    yield Circumstance("no compiler", {"XDG_CACHE_HOME": str(home / "none"), "PATH": str(home / "bin")})


def run(home: Path, robot: str, one: Circumstance) -> dict[str, object]:
    """The numbers and words of ``result.json``, without seconds."""
    folder = home / one.folder
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(home / one.log, folder / "log.csv")
    wanted = {"PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "1", "XDG_CACHE_HOME": str(home / "first"), **one.variables}
    environment = {key: value for key, value in os.environ.items() if key not in THREADS}
    environment |= {key: value for key, value in wanted.items() if value is not None}
    command = [sys.executable, "-m", "casysid", "identify", robot, "log.csv", "--split", "0.6", "--out", "out"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{one.name}: {' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return dict(leaves(json.loads((folder / "out" / "result.json").read_text())))


def leaves(value: object, name: str = "") -> Iterator[tuple[str, object]]:
    """Everything that is no list and no table, by its place, without seconds; numbers as they are written."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key != SECONDS:
                yield from leaves(inner, f"{name}/{key}")
    elif isinstance(value, list):
        for place, inner in enumerate(value):
            yield from leaves(inner, f"{name}/{place}")
    else:
        yield name, repr(value)


def differences(one: Mapping[str, object], other: Mapping[str, object]) -> list[str]:
    """Places that only one has, or that differ."""
    return [name for name in dict.fromkeys([*one, *other]) if one.get(name) != other.get(name)]


def simulated(robot: Robot, duration: float, rate: float, count: int) -> Iterator[Source]:
    """Logs of the robot under computed torque along sinusoids."""
    plant = Plant(robot, PlantSettings())
    control = ComputedTorque(ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters))
    for seed in range(count):
        motion = design_sinusoids(robot, duration=duration, seed=seed)
        yield simulate(plant, control, motion, rate=rate, duration=duration, seed=seed).recording


def write_logs(robot: Robot, home: Path, options: argparse.Namespace) -> list[Path]:
    """One log twice, the second time with its columns backwards; and several."""
    (log,) = simulated(robot, options.duration, options.rate, 1)
    columns = log.columns()
    write_columns(home / "log.csv", columns)
    write_columns(home / "permuted.csv", dict(reversed(columns.items())))
    short = simulated(robot, options.duration / options.logs, options.rate, options.logs)
    return [one.write(home / f"{place}.npz") for place, one in enumerate(short)]


def moved(robot: Robot, logs: Sequence[Source]) -> tuple[float, float]:
    """How far orders of logs move parameters, against the largest of their kind, and torques, against their norm."""
    motion = design_sinusoids(robot, duration=5.0, seed=1000).sample(np.arange(0.0, 5.0, 0.01))
    first = identify(robot, logs)
    size = sizes(first)
    torque = first.predict_torque(motion.q, motion.v, motion.a)
    orders = list(itertools.permutations(logs))[1:]
    parameters = torques = 0.0
    for order in orders[:: max(len(orders) // 3, 1)]:
        other = identify(robot, order)
        if other.parameters.shape != first.parameters.shape:
            return np.inf, np.inf
        parameters = max(parameters, float(np.max(np.abs(other.parameters - first.parameters) / size)))
        left = other.predict_torque(motion.q, motion.v, motion.a) - torque
        torques = max(torques, float(np.linalg.norm(left) / np.linalg.norm(torque)))
    return parameters, torques


def sizes(result: IdentificationResult) -> Array:
    """Of each parameter the largest of its unit, shape (p,)."""
    size = dict[str, float]()
    for one, value in zip(result.regressor.parameters, np.abs(result.parameters), strict=True):
        size[one.unit] = max(size.get(one.unit, 0.0), float(value))
    return np.array([max(size[one.unit], np.finfo(float).tiny) for one in result.regressor.parameters])


def check(name: str, options: argparse.Namespace) -> bool:
    """Print a line for each circumstance, and whether nothing moved."""
    robot, calm = Robot.from_file(find_model(name)), True
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        paths = write_logs(robot, home, options)
        first = run(home, name, Circumstance("first"))
        for one in circumstances(home):
            apart = differences(first, run(home, name, one))
            calm &= not apart
            found = "the same" if not apart else f"{len(apart)} of {len(first)} differ: {', '.join(apart[:3])}"
            print(f"{name}  {one.name:28s}  {found}", flush=True)
        kept = len(list((home / "cache").rglob("*.so")))
        print(f"{name}  compiled kernels that were kept: {kept}")
        for where, logs in (
            ("in memory", [read_recording(path, robot) for path in paths]),
            ("in files", open_recordings(paths, robot)),
        ):
            parameters, torques = moved(robot, logs)
            calm &= max(parameters, torques) <= ORDER
            print(
                f"{name}  {len(paths)} logs {where}, orders: parameters {parameters:.1e}, torques {torques:.1e}",
                flush=True,
            )
    return calm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="*", default=["two_link.urdf", "scara.xml"], help="bundled models")
    parser.add_argument("--duration", type=float, default=150.0, help="of the log, and of several together [s]")
    parser.add_argument("--rate", type=float, default=1000.0, help="of the logs [Hz]")
    parser.add_argument("--logs", type=int, default=3, help="of which the order is changed")
    options = parser.parse_args()
    sys.exit(0 if all([check(name, options) for name in options.robots]) else 1)


if __name__ == "__main__":
    main()

"""What a recording costs when many are identified together: seconds, bytes moved, and that the answer is the same.

Writes recordings of a fleet of simulated arms into a temporary folder, identifies them with a local cluster of workers
and, in this process alone, with ``identify``; then once more as a fleet, one model for each machine.

    python scripts/benchmark_many.py --recordings 200 --machines 10 --workers 2
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from casysid.bundled import find_model
from casysid.dynamics import build_regressor
from casysid.identification import Settings, identify
from casysid.identification.many import identify_fleet, identify_many, open_workers
from casysid.readers.writing import write_columns
from casysid.recording import open_recordings
from casysid.robot import Robot
from casysid.simulation import design_sinusoids

RATE = 200.0
NOISE = 0.02
"""Of the torque, as a share of its standard deviation."""
SENSOR = 1e-4
"""Noise of the positions [rad]: an encoder of 16 bits."""
SPREAD = 0.1
"""Of the machines' viscous friction about the usual one, as a share of it."""


def main() -> None:
    options = parsed()
    robot = Robot.from_file(find_model(options.robot))
    settings = Settings(choose_friction=options.friction == "auto")
    with tempfile.TemporaryDirectory() as folder:
        logs = Path(folder)
        size, truth = write_fleet(logs, robot, options)
        found: dict[str, object] = {"recordings": options.recordings, "rows_each": options.rows, "log_bytes": size}
        clock: dict[str, float] = {}
        with timed(clock, "many_fleet_and_start"), open_workers("local", workers=options.workers) as workers:
            with timed(clock, "many"):
                many = identify_many(robot, logs, settings, scheduler=workers)
            found |= {f"many_{name}": value for name, value in vars(workers.traffic).items()}
            moved = workers.traffic.sent + workers.traffic.received
            found["bytes_a_recording"] = round(moved / options.recordings)
            found["bytes_received_a_recording"] = round(workers.traffic.received / options.recordings)
            found["share_of_log_bytes"] = moved / size
            with timed(clock, "fleet"):
                fleet = identify_fleet(robot, logs, "machine", settings, scheduler=workers)
        with timed(clock, "alone"):
            alone = identify(robot, open_recordings(sorted(logs.iterdir()), robot), settings)
    found["seconds"] = {name: round(value, 3) for name, value in clock.items()}
    found["stages"] = {name: round(value, 3) for name, value in many.seconds.items()}
    found["seconds_a_recording_many"] = clock["many"] / options.recordings
    found["seconds_a_recording_alone"] = clock["alone"] / options.recordings
    found["moments_bytes"] = sum(one.nbytes for one in many.moments.squares)
    size_of = np.maximum(np.abs(alone.parameters), 1e-3 * np.abs(alone.parameters).max())
    found["largest_relative_difference"] = float(np.max(np.abs(many.parameters - alone.parameters) / size_of))
    found["error_difference"] = abs(many.train.relative - alone.train.relative)
    k = fleet.quantities.index(f"viscous of {robot.dofs[0]}")
    found["machines"] = len(fleet.machines)
    found["covered"] = sum(
        one.answer.low[k] <= truth[int(one.name)] <= one.answer.high[k] for one in fleet.machines
    ) / len(fleet.machines)
    found["between_found"] = None if fleet.differences[k] is None else fleet.differences[k].between
    found["between_true"] = float(np.std(truth, ddof=1))
    print(json.dumps(found, indent=2))


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="two_link.urdf", help="bundled model")
    parser.add_argument("--recordings", type=int, default=200, help="logs in all")
    parser.add_argument("--machines", type=int, default=10, help="machines they are of")
    parser.add_argument("--rows", type=int, default=4000, help="samples of each, at 200 Hz")
    parser.add_argument("--workers", type=int, default=2, help="local processes")
    parser.add_argument("--format", default="parquet", choices=("parquet", "csv", "npz"), help="of the logs")
    parser.add_argument("--friction", default="plain", choices=("plain", "auto"), help="as of casysid identify")
    return parser.parse_args()


def write_fleet(folder: Path, robot: Robot, options: argparse.Namespace) -> tuple[int, np.ndarray]:
    """Logs, whose bytes in all and whose machines' viscous friction of the first joint are returned."""
    random, regressor = np.random.default_rng(0), build_regressor(robot)
    share, size = 1.0 + SPREAD * random.standard_normal(options.machines), 0
    for k in range(options.recordings):
        machine, stamps = k % options.machines, np.arange(options.rows) / RATE
        usual = {"viscous": 0.4 * share[machine], "coulomb": 0.3, "armature": 0.01}
        theta = [usual.get(one.kind, value) for one, value in zip(regressor.parameters, regressor.prior, strict=True)]
        motion = design_sinusoids(robot, duration=options.rows / RATE, seed=k).sample(stamps)
        torque = regressor.predict(np.array(theta), motion.q, motion.v, motion.a, time=stamps)
        torque += NOISE * torque.std(axis=0) * random.standard_normal(torque.shape)
        columns = {"time": stamps, "machine": np.full(options.rows, float(machine))}
        sensed = motion.channels + SENSOR * random.standard_normal(motion.channels.shape)
        columns |= {f"q_{name}": sensed[:, j] for j, name in enumerate(robot.channels)}
        columns |= {f"tau_{name}": torque[:, j] for j, name in enumerate(robot.dofs)}
        size += write_columns(folder / f"{k:06d}.{options.format}", columns).stat().st_size
    return size, 0.4 * share


@contextmanager
def timed(clock: dict[str, float], name: str):
    """Wall time of what is done inside."""
    start = time.perf_counter()
    yield
    clock[name] = time.perf_counter() - start


if __name__ == "__main__":
    main()

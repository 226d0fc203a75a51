"""Record a bundled robot in simulation, identify it, and compare with the truth that only the simulator knows.

    python scripts/run_demo.py --out out/demo [--robot head] [--duration 20] [--seed 0]

Writes DIR/result.json, the identified model and report.html.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from casysid.arrays import Array
from casysid.bundled import find_model
from casysid.identification import IdentificationResult, identify
from casysid.identification.output import write_result
from casysid.report import write_report
from casysid.robot import Robot
from casysid.simulation import PD, ComputedTorque, ControlModel, Plant, SimulatedRun, design_sinusoids, simulate

RATE = 420.0  # [Hz], that of the head in Ting et al. (2006)


def record(plant: Plant, duration: float, seed: int) -> SimulatedRun:
    """A run along random sinusoids, the robot driven by what its file says."""
    controller = ComputedTorque(ControlModel.from_robot(plant.robot), PD.tuned(plant.robot, plant.parameters))
    motion = design_sinusoids(plant.robot, duration=duration, seed=seed)
    return simulate(plant, controller, motion, rate=RATE, duration=duration, seed=seed)


def relative_error(result: IdentificationResult, parameters: Array, run: SimulatedRun) -> float:
    """Error of the torque that parameters predict along the true motion, against the true torque."""
    predicted = result.regressor.predict(parameters, run.q, run.v, run.a)
    return float(np.linalg.norm(predicted - run.tau) / np.linalg.norm(run.tau))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--robot", default="head", help="a bundled model or a file")
    parser.add_argument("--duration", type=float, default=20.0, help="of each recording [s]")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    console = Console(stderr=True)
    plant = Plant(Robot.from_file(find_model(options.robot)))
    with console.status("recording the simulated robot"):
        train, unseen = (record(plant, options.duration, 2 * options.seed + k) for k in range(2))
    with console.status("identifying"):
        result = identify(plant.robot, train.recording, held_out=[unseen.recording])
    write_result(result, options.out)
    write_report(result, options.out / "report.html")
    table = Table("parameters", "torque error on an unseen motion", title=f"{plant.robot.name}: against the truth")
    for name, parameters in (
        ("the model file's", result.regressor.prior),
        ("identified", result.parameters),
        ("the true ones", plant.parameters),
    ):
        table.add_row(name, f"{relative_error(result, parameters, unseen):.2%}")
    console.print(table)
    for name in ("result.json", "report.html"):
        print(options.out / name)


if __name__ == "__main__":
    main()

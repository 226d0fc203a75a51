"""One identification with defaults by stages: seconds of the processor, smoothings and passes over the data.

    python scripts/benchmark_stages.py [ROBOT] [--duration 60] [--rate 1000] [--runs 3] [--json FILE]

The robot is simulated under computed torque along sinusoids. Everything is chosen by the data and nothing is written.
A first run, in which kernels are compiled, does not count; figures are medians.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
import warnings
from pathlib import Path

from casysid.bundled import find_model
from casysid.errors import CasysidWarning
from casysid.identification import Settings, prepare
from casysid.identification.pipeline import solve
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.simulation import PD, ComputedTorque, ControlModel, Plant, PlantSettings, design_sinusoids, simulate


def simulated(robot: Robot, duration: float, rate: float) -> Recording:
    """The robot under computed torque along sinusoids."""
    plant = Plant(robot, PlantSettings())
    control = ComputedTorque(ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters))
    motion = design_sinusoids(robot, duration=duration, seed=0)
    return simulate(plant, control, motion, rate=rate, duration=duration).recording


def run(robot: Robot, recording: Recording) -> dict[str, float]:
    """Seconds of the processor by stage, and how often the data were read."""
    began, settings = time.process_time(), Settings()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CasysidWarning)
        preparation = prepare(robot, recording, settings)
        middle = time.process_time()
        result = solve(preparation, settings)
    done = time.process_time()
    choices = result.choices
    return {
        "choices and moments": middle - began,
        "estimate, projection, check": done - middle,
        "all": done - began,
        "smoothings": float(choices.smoothings),
        "passes for choices": float(choices.passes),
        "kinds of friction joined": float(len(choices.friction.chosen)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", nargs="?", default="head", help="a bundled model's name or a file; default: head")
    parser.add_argument("--duration", type=float, default=60.0, help="of the log [s]; default: 60")
    parser.add_argument("--rate", type=float, default=1000.0, help="of the log [Hz]; default: 1000")
    parser.add_argument("--runs", type=int, default=3, help="that count; default: 3")
    parser.add_argument("--json", type=Path, help="write the figures to this file as well")
    options = parser.parse_args()
    robot = Robot.from_file(find_model(options.robot))
    recording = simulated(robot, options.duration, options.rate)
    runs = [run(robot, recording) for _ in range(options.runs + 1)][1:]
    figures = {name: statistics.median(one[name] for one in runs) for name in runs[0]}
    for name, figure in figures.items():
        print(f"{name:<28}{figure:>8.2f}")
    if options.json:
        options.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()

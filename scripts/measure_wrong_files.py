"""Does a placeholder file, or one in wrong units, end where a good file of the same robot ends?

    python scripts/measure_wrong_files.py [--seeds 3000-3049] [--json FILE]

Every seed is an experiment of ``scripts/population`` (mechanism, friction, log and its faults) of at most six joints,
identified twice with defaults: with a good file, every link's mass, inertia and centre of mass off by up to 10 %, and
with the same spoilt in one of the ways of :data:`WAYS`, taken in turn. The error is ``‖τ̂ - τ‖ / ‖τ‖`` at the noise-free
truth of a fresh motion; said is the share of seeds where the spoilt file's is at most 1.5 times the good one's, and
where clock and gains were taken as with the good file.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded

import argparse
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from population.candidate import Answer, ask
from population.experiments import draw_experiment
from population.files import perturbed
from population.rivals import relative_error

from casysid.inertia import inertial_parameters, mass_properties
from casysid.robot import Robot

GOOD, WORSE, MOST_JOINTS = 0.1, 1.5, 6
Bodies = np.ndarray


def scaled(bodies: Bodies, mass: float = 1.0, center: float = 1.0, inertia: float = 1.0) -> Bodies:
    """Bodies whose numbers are in other units."""
    body = mass_properties(bodies)
    return inertial_parameters(mass * body.mass, center * body.center_of_mass, inertia * body.inertia)


def one_of(spoil: Callable[[Bodies], Bodies]) -> Callable[[Bodies, np.random.Generator], Bodies]:
    """At one link alone."""

    def at_one(bodies: Bodies, rng: np.random.Generator) -> Bodies:
        link, spoilt = int(rng.integers(len(bodies))), bodies.copy()
        spoilt[link] = spoil(bodies)[link]
        return spoilt

    return at_one


def all_of(spoil: Callable[[Bodies], Bodies]) -> Callable[[Bodies, np.random.Generator], Bodies]:
    """At all links."""
    return lambda bodies, rng: spoil(bodies)


def same_inertia(bodies: Bodies, inertia: float) -> Bodies:
    """Masses and centres of mass as they are, one number for every moment of inertia."""
    body = mass_properties(bodies)
    return inertial_parameters(body.mass, body.center_of_mass, np.tile(inertia * np.eye(3), (len(bodies), 1, 1)))


def all_alike(bodies: Bodies, mass: float, inertia: float) -> Bodies:
    """One ball at every joint."""
    return np.tile(inertial_parameters(mass, np.zeros(3), inertia * np.eye(3)), (len(bodies), 1))


UNITS = {
    "mass in g": {"mass": 1e3},
    "mass and inertia in g": {"mass": 1e3, "inertia": 1e3},
    "centre of mass in mm": {"center": 1e3},
    "inertia in kg mm²": {"inertia": 1e6},
    "inertia in g mm²": {"inertia": 1e9},
    "lengths in mm": {"center": 1e3, "inertia": 1e6},
}
WAYS = {
    "identity inertias": all_of(lambda bodies: same_inertia(bodies, 1.0)),
    "inertias 0.01": all_of(lambda bodies: same_inertia(bodies, 0.01)),
    "1 kg, identity": all_of(lambda bodies: all_alike(bodies, 1.0, 1.0)),
    "0.01 kg, 0.01 kg m²": all_of(lambda bodies: all_alike(bodies, 0.01, 0.01)),
    "1 kg, 0.001 kg m²": all_of(lambda bodies: all_alike(bodies, 1.0, 1e-3)),
    **{
        f"{name} {where}": spread(lambda bodies, factors=factors: scaled(bodies, **factors))
        for name, factors in UNITS.items()
        for where, spread in (("everywhere", all_of), ("at one link", one_of))
    },
}


def spoilt(good: Robot, way: str, seed: int) -> Robot:
    """The same file, wrong in a way."""
    bodies = WAYS[way](good.inertial_parameters.reshape(-1, 10), np.random.default_rng([seed, 1]))
    return good.with_parameters(inertial_parameters=bodies.ravel())


def judge(seed: int) -> dict | None:
    """Both answers of a seed; None of robots with more joints."""
    experiment = draw_experiment(seed)
    if experiment.mechanism.robot.nv > MOST_JOINTS:
        return None
    way, truth = list(WAYS)[seed % len(WAYS)], experiment.mechanism.robot
    bodies = perturbed(np.random.default_rng([seed, 0]), truth.inertial_parameters.reshape(-1, 10), GOOD)
    good = truth.with_parameters(inertial_parameters=bodies.ravel(), armature=np.zeros(truth.nv))
    record = {"seed": seed, "way": way, "joints": truth.nv, "faults": list(experiment.faults.names)}
    for name, file in (("good", good), ("spoilt", spoilt(good, way, seed))):
        answer: Answer = ask(file, experiment.recording)
        record[name] = {
            "error": relative_error(answer.torque(*experiment.fresh), experiment.fresh_torque),
            "clock": answer.clock,
            "quasi_static": answer.quasi_static,
            "gains": None if answer.gains is None else np.asarray(answer.gains).tolist(),
        }
    return record


def same_corrections(record: dict) -> bool:
    """Whether clock and gains were touched with the one file where they were with the other."""
    good, bad = record["good"], record["spoilt"]
    clocks = abs(bad["clock"] / good["clock"] - 1.0) < 0.1 and good["quasi_static"] == bad["quasi_static"]
    return bool(clocks and (good["gains"] is None) == (bad["gains"] is None))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="3000-3049", help="first-last")
    parser.add_argument("--json", type=Path, help="write the records there")
    options = parser.parse_args()
    first, last = map(int, options.seeds.split("-"))
    records = []
    for seed in range(first, last + 1):
        record = judge(seed)
        if record is None:
            continue
        records.append(record)
        ratio = record["spoilt"]["error"] / record["good"]["error"]
        same = "" if same_corrections(record) else f"  corrections differ: {record['good']} {record['spoilt']}"
        print(
            f"seed {seed}  {record['way']:36s} {record['joints']} joints  good {record['good']['error']:.4f}  "
            f"spoilt {record['spoilt']['error']:.4f}  ratio {ratio:.2f}  {record['faults']}{same}",
            flush=True,
        )
        if options.json:
            options.json.write_text(json.dumps(records, indent=1) + "\n")
    ratios = np.array([record["spoilt"]["error"] / record["good"]["error"] for record in records])
    within, kept = np.mean(ratios <= WORSE), np.mean([same_corrections(record) for record in records])
    print(
        f"{len(records)} files: {within:.1%} within {WORSE:g} times the good file's error, {kept:.1%} corrected alike"
    )


if __name__ == "__main__":
    main()

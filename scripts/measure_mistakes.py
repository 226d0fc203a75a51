"""Are a turned base, compensated gravity and exchanged columns named, in random experiments with known truth?

    python scripts/measure_mistakes.py tilted|compensated|permuted|clean [--seeds 5000-5049] [--json FILE]

Experiments of ``scripts/population`` without wrong clocks or negated torques, read as ``identify`` reads them.
*Tilted*: the file's gravity points along a random direction. *Compensated*: gravity is taken out of the torques.
*Permuted*: columns of four to seven joints in a random order, three in ten with q and tau negated. *Clean*: nothing is
wrong, and whatever is named is wrong. ``sure`` is what the log can tell of gravity's direction, the larger of two
standard errors [degrees] at the true bodies; a direction is counted where that is at most :data:`TOLD` and the file is
no placeholder. Orders are counted where every joint moves and the file is no placeholder. One line a seed; a file is
continued.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded

import argparse
import dataclasses
import json
import time
import warnings
from pathlib import Path

import numpy as np
from benchmark_population import seeds_of
from population.experiments import Experiment, draw_experiment
from population.spoiling import spoilt

from casysid.identification import choose_band
from casysid.identification.mistakes import Mistake, find_mistakes
from casysid.identification.mistakes.gravity import GravityFit, angle_between
from casysid.identification.mistakes.samples import pick_samples
from casysid.identification.passes import Passes
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.robot.likely_bodies import believed

TOLD, WANTED = 1.5, 3.0
"""[degrees]: standard error of the direction where it is asked for, and how near it has to be."""
FEWEST, MOST = 4, 7
"""Joints whose columns are exchanged."""
STILL = 1e-3
"""[rad/s, m/s]."""
KINDS = ("tilted", "compensated", "permuted", "clean")


def judge(seed: int, kind: str) -> dict | None:
    """What was named; None where the seed is not asked."""
    experiment = draw_experiment(seed)
    joints = experiment.mechanism.robot.nv
    wrong = {"clock", "sign"} & set(experiment.faults.names)
    if wrong or (kind == "permuted" and (not FEWEST <= joints <= MOST or experiment.file_error == "placeholder")):
        return None
    file, log, order = experiment.file, experiment.recording, ""
    if kind == "permuted":
        log, order = permuted(log, np.random.default_rng([seed, 99]))
    elif kind != "clean":
        file, log = spoilt(experiment, kind)
    began = time.process_time()
    found = mistakes(believed(file, []).robot, log)
    record = {"seed": seed, "kind": kind, "joints": joints, "file": experiment.file_error}
    record |= {"faults": list(experiment.faults.names), "seconds": time.process_time() - began}
    record |= {"found": [one.words for one in found], **asked(experiment)}
    true = np.array(experiment.mechanism.robot.gravity)
    turned = [one for one in found if one.kind.name == "GRAVITY_TURNED"]
    return record | {
        "off": angle_between(np.array(turned[0].gravity), true) if turned else None,
        "absent": any(one.kind.name == "GRAVITY_ABSENT" for one in found),
        "order": bool(order) and any(order in (one.words, *one.alternatives) for one in found),
    }


def motions_of(robot: Robot, log: Recording) -> tuple:
    """As ``identify`` looks for mistakes in them."""
    band = choose_band([log])
    return Passes(robot, [log], band).sparse_motions, band.cutoff


def mistakes(robot: Robot, log: Recording) -> tuple[Mistake, ...]:
    """That are named."""
    return find_mistakes(robot, *motions_of(robot, log))


def permuted(log: Recording, rng: np.random.Generator) -> tuple[Recording, str]:
    """The log with its columns exchanged, and the words that name it."""
    joints = len(log.dofs)
    order = np.arange(joints)
    while (order == np.arange(joints)).all():
        order = rng.permutation(joints)
    sign = rng.choice([-1.0, 1.0], joints, p=[0.3, 0.7])
    position, torque = np.empty_like(log.position), np.empty_like(log.torque)
    position[:, order], torque[:, order] = log.position * sign, log.torque * sign
    moved = [k for k in range(joints) if order[k] != k or sign[k] < 0.0]
    names = [f"{log.dofs[order[k]]}{' with q and tau negated' if sign[k] < 0.0 else ''}" for k in moved]
    told = ", ".join(f"{log.dofs[k]} is logged as {name}" for k, name in zip(moved, names, strict=True))
    words = f"the columns look permuted, q and tau alike: {told}"
    return dataclasses.replace(log, position=position, torque=torque), words


def asked(experiment: Experiment) -> dict:
    """How sure a log can be of gravity's direction, what it holds of gravity, and whether every joint moves."""
    true = experiment.mechanism.robot
    motions, cutoff = motions_of(true, experiment.recording)
    fit = GravityFit(true, pick_samples(true, motions, cutoff))
    v = np.concatenate([motion.v for motion in motions])
    return {"sure": fit.direction_error(fit.file), "moves": bool((v.std(axis=0) > STILL).all())}


def show(records: list[dict], kind: str) -> None:
    """Shares of what was named."""
    honest = [one for one in records if one["file"] != "placeholder"]
    told = [one for one in honest if one["sure"] <= TOLD]
    match kind:
        case "tilted":
            named = [one for one in told if one["off"] is not None]
            near = [one for one in named if one["off"] <= WANTED]
            print(f"{len(told)} of {len(records)} logs tell the direction: {len(named)} named, {len(near)} within 3°")
        case "compensated":
            print(f"{len(told)} of {len(records)} logs tell gravity: {sum(one['absent'] for one in told)} named")
        case "permuted":
            moving = [one for one in honest if one["moves"]]
            right = sum(one["order"] for one in moving)
            print(f"{len(moving)} of {len(records)} logs have all joints moving: {right} orders named")
        case _:
            accused = [one for one in records if one["found"]]
            print(f"{len(accused)} of {len(records)} accused", *(f"\n  {one}" for one in accused))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--seeds", type=seeds_of, default=seeds_of("5000-5049"), help="A-B, both included")
    parser.add_argument("--json", type=Path, help="one record a seed; seeds that it has are not measured again")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    records = json.loads(options.json.read_text()) if options.json and options.json.exists() else []
    known = {one["seed"] for one in records}
    for seed in options.seeds:
        if seed not in known:
            record = judge(seed, options.kind) or {"seed": seed, "skipped": True}
            records.append(record)
            if not record.get("skipped"):
                print(record, flush=True)
            if options.json:
                options.json.write_text(json.dumps(records) + "\n")
    show([one for one in records if not one.get("skipped")], options.kind)


if __name__ == "__main__":
    main()

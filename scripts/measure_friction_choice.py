"""How often kinds of friction are recognised in simulated recordings, and how often one is chosen that is not there.

    python scripts/measure_friction_choice.py [--robot head] [--seeds 5] [--recordings 2] [--share 0.1] [--json FILE]

Every trial gives one joint, a different one for each seed, one kind of friction more than viscous, Coulomb, offset and
armature. Its torque is a share of the joint's whole; on top comes noise of the torque, part of it slow. Friction before
sliding is part of the usual model and is not counted.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.signal import lfilter

from casysid.arrays import Array
from casysid.bundled import find_model
from casysid.dynamics import (
    DEFAULT_FRICTION,
    AsymmetricViscous,
    Coupling,
    FrictionColumn,
    LoadedCoulomb,
    PowerViscous,
    Regressor,
    Spring,
    Stribeck,
    build_regressor,
    with_width,
)
from casysid.identification import Settings, choose_band
from casysid.identification.passes import Passes
from casysid.identification.tuning.candidates import gather_candidates
from casysid.identification.tuning.friction_selection import FrictionChoice, select_friction
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.simulation import Reference, design_sinusoids

KINDS = (
    "plain", "stribeck", "power_viscous", "viscous_asymmetry", "stiffness", "loaded_coulomb", "coupling",
)  # fmt: skip
WIDTH, RATE, DURATION = 0.01, 200.0, 30.0
SLOW_NOISE, FAST_NOISE, MEMORY = 0.01, 0.02, 0.98
POSITION_NOISE = 2e-5  # rad


def column_of(kind: str, joint: str, speed: float) -> FrictionColumn:
    match kind:
        case "stribeck":
            return Stribeck(WIDTH, {joint: 0.2 * speed})
        case "power_viscous":
            return PowerViscous(WIDTH, {joint: 0.5})
        case "viscous_asymmetry":
            return AsymmetricViscous((joint,))
        case "stiffness":
            return Spring((joint,))
    return LoadedCoulomb(WIDTH, (joint,))


def simulate(
    robot: Robot, kind: str, seed: int, share: float, recordings: int = 1
) -> tuple[tuple[Recording, ...], str]:
    """Recordings of one machine, and the joint that has the kind."""
    samples = np.arange(int(DURATION * RATE)) / RATE
    motions = [
        design_sinusoids(robot, duration=DURATION, seed=1000 * k + seed, band=(0.1, 1.0)).sample(samples)
        for k in range(recordings)
    ]
    dof = seed % robot.nv
    joint, neighbour = robot.dofs[dof], robot.dofs[dof - 1 if dof else 1]
    friction, couplings = with_width(DEFAULT_FRICTION, WIDTH), []
    if kind == "coupling":
        couplings = [Coupling((neighbour, joint) if dof else (joint, neighbour), (1.0, 1.0), ("viscous", "coulomb"))]
    elif kind != "plain":
        friction = (*friction, column_of(kind, joint, float(motions[0].v[:, dof].std())))
    regressor = build_regressor(robot, friction, couplings)
    theta = coefficients(regressor, motions[0], dof, share)
    rng = np.random.default_rng(seed)
    return tuple(record(regressor, theta, motion, samples, rng) for motion in motions), joint


def coefficients(regressor: Regressor, motion: Reference, dof: int, share: float) -> Array:
    """The machine's parameters: ordinary friction in proportion to the rigid torque, and the kind's share of it."""
    robot, state = regressor.robot, (motion.q, motion.v, motion.a)
    base = build_regressor(robot, with_width(DEFAULT_FRICTION, WIDTH))
    theta, count = np.array(regressor.prior), len(base.names)
    bodies = np.where(np.arange(count) < robot.inertial_parameters.size, base.prior, 0.0)
    rigid = base.predict(bodies, *state).std(axis=0)
    places = {name: k for k, name in enumerate(regressor.names)}
    for k, name in enumerate(robot.dofs):
        theta[places[f"{name}.viscous"]] = 0.3 * rigid[k] / motion.v[:, k].std()
        theta[places[f"{name}.coulomb"]] = 0.15 * rigid[k]
    if len(theta) > count:
        theta[count:] = share * rigid[dof] / regressor.evaluate(*state)[:, dof, count:].std(axis=0)
    return theta


def record(regressor: Regressor, theta: Array, motion: Reference, time: Array, rng: np.random.Generator) -> Recording:
    """The motion with noise, and its torque with noise of which a part is slow."""
    torque = regressor.predict(theta, motion.q, motion.v, motion.a)
    slow = np.sqrt(1.0 - MEMORY**2) * lfilter([1.0], [1.0, -MEMORY], rng.normal(size=torque.shape), axis=0)
    noise = SLOW_NOISE * slow + FAST_NOISE * rng.normal(size=torque.shape)
    return Recording(
        channels=regressor.robot.channels,
        dofs=regressor.robot.dofs,
        time=time,
        position=motion.channels + POSITION_NOISE * rng.normal(size=motion.channels.shape),
        torque=torque + noise * torque.std(axis=0),
    )


def judge(choice: FrictionChoice, kind: str, joint: str) -> tuple[bool, int]:
    """Whether the kind was found at its joint, and how many others were chosen."""
    hits = [one for one in choice.chosen if one.kind == kind and joint in one.joints]
    return bool(hits), len(choice.chosen) - len(hits)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="head")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--recordings", type=int, default=1, help="Of the same machine, each with its own motion.")
    parser.add_argument("--share", type=float, default=0.1, help="The kind's torque over the rigid body's.")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    robot = Robot.from_file(find_model(options.robot))
    settings = Settings(threads=1)
    figures, table = {}, Table("kind", "found", "others chosen", "of candidates", "CPU [s]", title=robot.name)
    for kind in options.kinds.split(","):
        found, others, asked, seconds = 0, 0, 0, 0.0
        for seed in range(options.seeds):
            recordings, joint = simulate(robot, kind, seed, options.share, options.recordings)
            started = time.process_time()
            passes = Passes(robot, recordings, choose_band(recordings), threads=1)
            choice = select_friction(gather_candidates(passes, settings), settings)
            seconds += time.process_time() - started
            hit, wrong = judge(choice, kind, joint)
            found, others, asked = found + hit, others + wrong, asked + choice.asked
        shown = "–" if kind == "plain" else f"{found}/{options.seeds}"
        table.add_row(kind, shown, str(others), str(asked), f"{seconds / options.seeds:.2f}")
        figures[kind] = {"found": found, "others": others, "asked": asked, "trials": options.seeds}
    Console().print(table)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

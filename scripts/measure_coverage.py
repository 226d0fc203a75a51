"""How often 95 % intervals hold the truth: many simulated recordings, each identified, each compared with what is true.

    python scripts/measure_coverage.py --recordings 200 --json FILE [--robots two_link,cylindrical] [--dry]

Every recording has its own motion, its own noise and its own wrong model file (masses, centres of mass, inertias and
friction off by some 20 %), so that staying at the file's values is not rewarded. Coloured noise is added to the logged
torques; positions have noise and steps, and are smoothed and differentiated.

What no column of the regressor stands for is a bias and no matter of intervals, and is left out: stiction, cables,
torques that are logged later than positions, and torques that jump between samples (motors are made slower than the
controller's period). Dry friction, whose change of sign the regressor has by a smooth function only, is left out too;
``--dry`` puts it back.
"""

from __future__ import annotations

import argparse
import json
import os
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.signal import lfilter

from casysid.arrays import Array
from casysid.bundled import find_model
from casysid.dynamics import DEFAULT_FRICTION, Armature, Coulomb, FrictionColumn
from casysid.estimation import WeightedLeastSquares
from casysid.identification import IdentificationResult, Settings, prepare, solve, torque_band
from casysid.inertia import inertial_parameters, mass_properties
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.simulation import (
    PD,
    Actuation,
    ComputedTorque,
    ControlModel,
    Mechanics,
    Plant,
    PlantSettings,
    Sensing,
    design_sinusoids,
    simulate,
)
from casysid.validation.truth import true_coefficients

DURATION, RATE, CUTOFF = 12.0, 250.0, 8.0  # [s], [Hz], [Hz]
NOISE_SHARE, NOISE_MEMORY = 0.01, 0.05  # of the torque scale; [s]
FILE_ERROR = 0.2
UNSEEN_SEED = 1_000_000
KINDS = ("base parameters", "masses", "friction", "held-out torque")


@dataclass(frozen=True, eq=False)
class Case:
    """A robot to record, and what is identified of it.

    Attributes:
        plant: The machine, with the truth.
        friction: Columns of the regressor beside the rigid bodies.
    """

    plant: Plant
    friction: tuple[FrictionColumn, ...]


def cylindrical() -> Robot:
    """A column that turns, a carriage that rises, an arm that reaches out: two masses can be known by themselves."""
    model = pin.Model()
    model.name = "cylindrical"
    kinds = (pin.JointModelRZ(), pin.JointModelPZ(), pin.JointModelPX())
    limits = ((60.0, 3.0, 2.0), (250.0, 1.0, 0.4), (100.0, 1.5, 0.4))  # effort, velocity, half range
    masses = (15.0, 6.0, 4.0)
    centers = ((0.03, 0.02, 0.3), (0.05, -0.04, 0.1), (0.25, 0.02, 0.05))
    for k, (kind, name) in enumerate(zip(kinds, ("turn", "lift", "reach"), strict=True)):
        effort, velocity, reach = limits[k]
        bounds = [np.array([value]) for value in (effort, velocity, -reach, reach)]
        joint = model.addJoint(k, kind, pin.SE3.Identity(), name, *bounds)
        body = pin.Inertia(masses[k], np.array(centers[k]), masses[k] * np.diag([0.012, 0.03, 0.025]))
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    return Robot.from_pin(model, name="cylindrical")


@cache
def case_of(name: str, dry: bool = False) -> Case:
    """The cases by name: a bundled robot, or the cylindrical one, which has no rotors, so that masses stand alone."""
    alone = name == "cylindrical"
    robot = cylindrical() if alone else Robot.from_file(find_model(f"{name}.urdf"))
    mechanics = Mechanics(stiction=1.0, cable_pull=0.0, coulomb_friction=dry, armature=not alone)
    left_out = (() if dry else (Coulomb,)) + ((Armature,) if alone else ())
    return Case(
        Plant(
            robot, PlantSettings(mechanics=mechanics, sensing=Sensing(torque_delay=0.0), actuation=Actuation(lag=0.008))
        ),
        tuple(column for column in DEFAULT_FRICTION if not isinstance(column, left_out)),
    )


def record(case: Case, seed: int) -> Recording:
    """A short recording along a motion of its own, with coloured noise on its torques."""
    plant = case.plant
    control = ComputedTorque(
        ControlModel.from_robot(plant.robot, plant.parameters), PD.tuned(plant.robot, plant.parameters)
    )
    motion = design_sinusoids(plant.robot, duration=DURATION, seed=seed)
    run = simulate(plant, control, motion, rate=RATE, duration=DURATION, seed=seed)
    noise = coloured_noise(run.recording.torque.shape, np.random.default_rng([seed, 1]))
    return replace(run.recording, torque=run.recording.torque + NOISE_SHARE * plant.torque_scale * noise)


def coloured_noise(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Stationary noise of variance one that forgets with the memory's time constant, shape (N, joints)."""
    memory = np.exp(-1.0 / (RATE * NOISE_MEMORY))
    drive = np.sqrt(1.0 - memory**2) * rng.standard_normal(shape)
    drive[0] /= np.sqrt(1.0 - memory**2)
    return np.asarray(lfilter([1.0], [1.0, -memory], drive, axis=0))


def wrong_file(robot: Robot, rng: np.random.Generator) -> Robot:
    """The robot as a file has it that is off by about a fifth everywhere, but describes possible bodies."""
    body = mass_properties(robot.inertial_parameters.reshape(-1, 10))
    factor = partial(rng.uniform, 1.0 - FILE_ERROR, 1.0 + FILE_ERROR)
    size = np.sqrt(np.trace(body.inertia, axis1=1, axis2=2) / (2.0 * np.maximum(body.mass, 1e-9)))
    center = body.center_of_mass + FILE_ERROR * size[:, None] * rng.uniform(-1.0, 1.0, (len(size), 3))
    parameters = inertial_parameters(
        body.mass * factor(len(size)), center, body.inertia * factor(len(size))[:, None, None]
    )
    return robot.with_parameters(
        inertial_parameters=parameters.ravel(),
        damping=robot.damping * factor(robot.nv),
        dry_friction=robot.dry_friction * factor(robot.nv),
    )


def settings_of(case: Case) -> dict[str, Settings]:
    """The ways to identify that are compared: without physics or prior, and the pipeline's default."""
    common = Settings(cutoff=CUTOFF, friction=case.friction, threads=1)
    return {
        "least squares": replace(common, method=WeightedLeastSquares(), consistency=None),
        "empirical Bayes, projected": common,
    }


@cache
def unseen_recording(name: str, dry: bool) -> Recording:
    """What torque bands are compared with: a motion that no model was fitted to."""
    return record(case_of(name, dry), UNSEEN_SEED)


def examine(name: str, dry: bool, seed: int) -> dict[str, dict[str, list[float]]]:
    """One recording: shares of truths within their intervals, by way of identification and kind."""
    warnings.simplefilter("ignore")
    case = case_of(name, dry)
    recording = record(case, seed)
    file = wrong_file(case.plant.robot, np.random.default_rng([seed, 2]))
    ways = settings_of(case)
    preparation = prepare(file, recording, ways["empirical Bayes, projected"], held_out=[unseen_recording(name, dry)])
    return {way: covered(solve(preparation, settings), case.plant) for way, settings in ways.items()}


def covered(result: IdentificationResult, plant: Plant) -> dict[str, list[float]]:
    """Whether each interval holds the truth, by kind; of held-out torque the share of samples within the band."""
    truth, base, sure = true_coefficients(plant, result.regressor), result.structural.transform, result.uncertainty
    quantile, inertial = sure.quantile(), 10 * len(result.robot.links)
    spread = quantile * np.sqrt(np.einsum("rp,pq,rq->r", base, sure.covariance, base))
    combination = np.abs(base @ (result.parameters - truth)) <= spread
    lower, upper = sure.interval()
    inside = (lower <= truth) & (truth <= upper)
    told = np.isfinite(sure.std)
    masses = np.flatnonzero(told[:inertial:10]) * 10
    friction = [
        k for k, parameter in enumerate(result.regressor.parameters) if k >= inertial and parameter.kind != "armature"
    ]
    return {
        "base parameters": combination.astype(float).tolist(),
        "masses": inside[masses].astype(float).tolist(),
        "friction": inside[[k for k in friction if told[k]]].astype(float).tolist(),
        "held-out torque": band_coverage(result),
    }


def band_coverage(result: IdentificationResult) -> list[float]:
    """Share of the held-out averages within the 95 % band of predicted torque, by joint."""
    (motion,), unseen = result.held_out_motions, result.held_out
    assert unseen is not None
    error = np.abs(unseen.measured[0] - unseen.predictions[0])
    band = [np.interp(unseen.times[0], motion.time, width) for width in torque_band(result, motion).T]
    return np.asarray(np.mean(error <= np.column_stack(band), axis=0)).tolist()


def summarise(found: list[dict[str, dict[str, list[float]]]]) -> dict[str, dict[str, object]]:
    """Coverage by way and kind, and parameter by parameter."""
    summary: dict[str, dict[str, object]] = {}
    for way in found[0]:
        rows = {kind: np.array([one[way][kind] for one in found]) for kind in KINDS}
        summary[way] = {
            kind: {"coverage": float(values.mean()) if values.size else None, "each": values.mean(axis=0).tolist()}
            for kind, values in rows.items()
        }
    return summary


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=int, default=200)
    parser.add_argument("--robots", default="two_link,cylindrical", help="bundled names, and cylindrical")
    parser.add_argument("--dry", action="store_true", help="with dry friction")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    console, began, content = Console(stderr=True), time.perf_counter(), {}
    table = Table("robot", "way", *KINDS, title=f"95 % intervals that hold the truth, {options.recordings} recordings")
    for name in options.robots.split(","):
        with ProcessPoolExecutor(options.processes) as pool:
            runs = pool.map(partial(examine, name, options.dry), range(options.recordings), chunksize=5)
            found = list(track(runs, name, options.recordings, console=console))
        content[name] = summarise(found)
        for way, kinds in content[name].items():
            shares = [kinds[kind]["coverage"] for kind in KINDS]  # type: ignore[index]
            table.add_row(name, way, *("-" if share is None else f"{share:.1%}" for share in shares))
    console.print(table)
    if options.json:
        figures = {"recordings": options.recordings, "dry_friction": options.dry, "robots": content}
        part = options.json.with_name(options.json.name + ".part")
        part.write_text(json.dumps({**figures, "seconds": time.perf_counter() - began}, indent=2) + "\n")
        os.replace(part, options.json)
        print(options.json)


if __name__ == "__main__":
    main()

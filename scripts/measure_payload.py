"""How well payloads are found, and whether their intervals hold: simulated arms with friction and noise.

    python scripts/measure_payload.py [--joints 6] [--seeds 10] [--first 0] [--duration 40] [--alone]

Each seed draws an arm of six or seven joints, a payload of 0.5 to 3 kg within 15 cm of the last link's frame, a model
file (every link scaled by 0.7 to 1.3), a motion with the payload and one without, and noise. Told are errors of the
mass [%] and the centre of mass [mm], and how many of the 95 % intervals hold the truth. ``--alone`` uses the recordings
with the payload and the true file only.
"""

from __future__ import annotations

import argparse

import numpy as np
import pinocchio as pin

from casysid.inertia import inertial_parameters, mass_properties
from casysid.payload import identify_payload
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.simulation import PD, ComputedTorque, ControlModel, Plant, PlantSettings, design_sinusoids, simulate

RATE = 500.0  # [Hz]
AXES = {6: "ZYYZYZ", 7: "ZYZYZYZ"}
EFFORT = (400.0, 400.0, 250.0, 150.0, 80.0, 60.0, 40.0)  # [N m]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--duration", type=float, default=40.0)
    parser.add_argument("--joints", type=int, choices=sorted(AXES), default=6)
    parser.add_argument("--alone", action="store_true")
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.seeds)
    held = [trial(given.joints, seed, given.duration, given.alone) for seed in seeds]
    errors, inside = np.array([one[0] for one in held]), np.array([one[1] for one in held])
    print(f"{given.joints} joints, {len(held)} seeds; worst error, mean error, intervals that hold the truth")
    for k, (word, places) in enumerate((("mass [%]", slice(0, 1)), ("centre of mass [mm]", slice(1, 4)))):
        shares = errors[:, k].max(), errors[:, k].mean(), inside[:, places].mean()
        print(f"{word:<20} {shares[0]:.2f}  {shares[1]:.2f}  {shares[2]:.0%}")
    print(f"{'inertia':<20} {inside[:, 4:].mean():.0%}")


def draw_arm(rng: np.random.Generator, joints: int) -> Robot:
    """A serial arm whose axes turn by right angles, of bodies that are balls of points around their middle."""
    model = pin.Model()
    for k, axis in enumerate(AXES[joints]):
        length = rng.uniform(0.1, 0.35)
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, length]) if k else np.zeros(3))
        joint = getattr(pin, f"JointModelR{axis}")()
        bounds = [np.array([limit]) for limit in (EFFORT[k], 2.5, -2.5, 2.5)]
        model.addJoint(k, joint, place, f"joint_{k + 1}", *bounds)
        points = rng.normal(scale=0.06, size=(12, 3)) + np.array([0.0, 0.0, 0.15])
        mass, centre = 6.0 * 0.75**k, points.mean(axis=0)
        second = mass * np.cov(points.T)
        model.appendBodyToJoint(
            k + 1, pin.Inertia(mass, centre, np.trace(second) * np.eye(3) - second), pin.SE3.Identity()
        )
    return Robot.from_pin(model, name="arm")


def trial(joints: int, seed: int, duration: float, alone: bool) -> tuple[tuple[float, float], np.ndarray]:
    """Errors of mass [%] and centre of mass [mm], and which of the ten quantities are in their intervals."""
    rng = np.random.default_rng(seed)
    robot = draw_arm(rng, joints)
    mass, centre = rng.uniform(0.5, 3.0), rng.uniform(-0.15, 0.15, 3)
    A = rng.normal(scale=0.04, size=(3, 3))
    second = mass * (A @ A.T + 1e-4 * np.eye(3))
    truth = inertial_parameters(mass, centre, np.trace(second) * np.eye(3) - second)
    theta = robot.inertial_parameters.copy()
    theta[-10:] += truth
    loaded = robot.with_parameters(inertial_parameters=theta)
    file = np.repeat(rng.uniform(0.7, 1.3, len(robot.links)), 10) * robot.inertial_parameters
    known = robot if alone else robot.with_parameters(inertial_parameters=file)
    empty = () if alone else (record(robot, 1000 + seed, duration),)
    answer = identify_payload(known, record(loaded, 2000 + seed, duration), empty).payloads[0]
    low, high = answer.uncertainty.link_interval()
    real = mass_properties(truth)
    inertia = real.inertia
    wanted = np.array([mass, *centre, *(inertia[i, k] for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))])
    off = np.linalg.norm(answer.center_of_mass - centre)
    found = f"{answer.mass:.4f} ± {answer.mass_std:.4f} kg, centre off by {1e3 * off:.2f} mm"
    print(f"seed {seed}: {mass:.3f} kg found as {found}", flush=True)
    return (100 * abs(answer.mass / mass - 1), 1e3 * float(off)), (low[0] <= wanted) & (wanted <= high[0])


def record(robot: Robot, seed: int, duration: float) -> Recording:
    plant = Plant(robot, PlantSettings())
    control = ComputedTorque(ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters))
    motion = design_sinusoids(robot, duration=duration, seed=seed)
    return simulate(plant, control, motion, rate=RATE, duration=duration, seed=seed).recording


if __name__ == "__main__":
    main()

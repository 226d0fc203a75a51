"""What on-line identification costs and notices: simulated seven-joint arms with friction, coloured noise and a load.

    python scripts/measure_online.py [--seeds 3] [--first 0] [--rate 1000] [--mass 1.0]
    python scripts/measure_online.py --quiet 1200 --rate 200     # nothing happens: every word is a false alarm

Each seed draws an arm, bodies that are off by up to a quarter from its file, friction and a motion. After 20 s of
learning and 10 s more, the load is picked up, held for 18 s and put down. Told are what was said, with its delay, and
the processor time per second of samples, learning left out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np
from measure_payload import draw_arm
from scipy.signal import lfilter

from casysid import Online
from casysid.dynamics import Regressor, build_regressor
from casysid.inertia import inertial_parameters

PICKED, GONE, END = 30.0, 48.0, 60.0  # [s]
ENCODER = 5e-5  # [rad], standard deviation
WHITE, COLOURED, MEMORY = 0.03, 0.01, 0.5  # of each torque's root mean square; [s]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--mass", type=float, default=1.0)
    parser.add_argument("--quiet", type=float, help="seconds in which nothing happens")
    given = parser.parse_args()
    for seed in range(given.first, given.first + given.seeds):
        trial(seed, given.rate, given.mass, given.quiet)


def trial(seed: int, rate: float, mass: float, quiet: float | None) -> None:
    rng = np.random.default_rng(seed)
    robot = draw_arm(rng, 7)
    regressor = build_regressor(robot)
    theta = true_parameters(regressor, rng)
    loaded, links = theta.copy(), robot.inertial_parameters.size
    loaded[links - 10 : links] += inertial_parameters(mass, [0.02, -0.03, 0.08], np.diag([2e-3, 3e-3, 2e-3]))
    online, spent, began = Online(robot), 0.0, np.nan
    for t, q, v, a in motion(rng, robot.nv, quiet or END, rate):
        tau = regressor.predict(theta, q, v, a)
        if quiet is None and PICKED <= t[0] < GONE:
            tau = regressor.predict(loaded, q, v, a)
        tau += np.sqrt(np.mean(tau**2, axis=0)) * noise(rng, tau.shape, rate)
        was_ready, before = online.ready, time.process_time()
        for event in online.add(t, q + ENCODER * rng.normal(size=q.shape), tau):
            print(f"seed {seed}: {event}", flush=True)
        spent += (time.process_time() - before) * was_ready
        began = t[0] if online.ready and not was_ready else began
    share = spent / ((quiet or END) - began)
    print(f"seed {seed}: {online.verdict.headline}, {share:.1%} of a core, lag {online.lag:.2f} s", flush=True)


def true_parameters(regressor: Regressor, rng: np.random.Generator) -> np.ndarray:
    robot, theta = regressor.robot, regressor.prior.copy()
    theta[: robot.inertial_parameters.size] *= np.repeat(rng.uniform(0.8, 1.25, len(robot.links)), 10)
    size = np.geomspace(0.5, 0.05, robot.nv)
    for k, name in enumerate(regressor.names):
        joint, _, kind = name.rpartition(".")
        if kind in ("viscous", "coulomb"):
            theta[k] = size[robot.dofs.index(joint)] * rng.uniform(0.5, 1.5)
        elif kind == "armature":
            theta[k] = 0.05 * size[robot.dofs.index(joint)]
    return theta


def motion(rng: np.random.Generator, joints: int, duration: float, rate: float) -> Iterator[tuple[np.ndarray, ...]]:
    """Sums of five sines for each joint, in pieces of a twentieth of a second."""
    order = np.arange(1, 6)[:, None]
    w = 2 * np.pi * 0.1 * order * rng.uniform(0.8, 1.2, (5, joints))
    size, phase = 0.6 / order * rng.uniform(0.3, 1.0, (5, joints)), rng.uniform(0.0, 2 * np.pi, (5, joints))
    samples = max(int(rate / 20), 1)
    for first in range(0, int(duration * rate), samples):
        t = np.arange(first, first + samples) / rate
        angle = w * t[:, None, None] + phase
        q, v, a = size * np.sin(angle), size * w * np.cos(angle), -size * w**2 * np.sin(angle)
        yield t, q.sum(axis=1), v.sum(axis=1), a.sum(axis=1)


def noise(rng: np.random.Generator, shape: tuple[int, ...], rate: float) -> np.ndarray:
    keep = np.exp(-1.0 / (MEMORY * rate))
    slow = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=shape), axis=0)
    return WHITE * rng.normal(size=shape) + COLOURED * slow


if __name__ == "__main__":
    main()

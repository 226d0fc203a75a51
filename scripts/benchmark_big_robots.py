"""Seconds and peak memory of the command line for robots of very many joints.

    python scripts/benchmark_big_robots.py [--identify 60] [--info 200] [--seconds 30] [--option=--cutoff=5]

Random trees of revolute joints, at most twelve deep, moved by Fourier series; torque with friction and noise at 200 Hz.
``casysid identify`` and ``casysid info`` run as processes of their own, one after the other; seconds are of the
processor, memory is the largest resident set. ``--option`` is handed on to ``identify`` and may be repeated. A joint
count of zero leaves that command out.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import pyarrow as pa
import pyarrow.parquet as pq

DEPTH, NEIGHBOURS = 12, 8  # a link hangs on one of the last few, no more than so many deep
RATE = 200.0  # [Hz]
HARMONICS = np.arange(1, 6)  # of 0.1 Hz
POSITION_NOISE, TORQUE_NOISE = 1e-5, 0.02  # standard deviations [rad], [N m]
VISCOUS, COULOMB = 0.5, 0.3  # [N m s/rad], [N m]


def tree(joints: int, rng: np.random.Generator) -> str:
    """A URDF."""

    def inertial(mass: float, centre: np.ndarray) -> str:
        moments = " ".join(
            f'{name}="{mass * each:.5f}"'
            for name, each in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), (4e-3, 0, 0, 5e-3, 0, 3e-3), strict=True)
        )
        place = " ".join(f"{x:.3f}" for x in centre)
        return f'<inertial><origin xyz="{place}"/><mass value="{mass:.3f}"/><inertia {moments}/></inertial>'

    parts, depth = [f'<robot name="tree_{joints}"><link name="link_0">{inertial(5.0, np.zeros(3))}</link>'], [0]
    for k in range(1, joints + 1):
        parent = int(rng.choice([j for j in range(k) if depth[j] < DEPTH][-NEIGHBOURS:]))
        depth.append(depth[parent] + 1)
        place = " ".join(f"{x:.3f}" for x in rng.uniform(-0.15, 0.15, 3))
        turn = " ".join(f"{x:.4f}" for x in rng.choice([0.0, np.pi / 2, -np.pi / 2], 3))
        parts.append(
            f'<link name="link_{k}">{inertial(rng.uniform(0.2, 1.5), rng.uniform(-0.05, 0.05, 3))}</link>'
            f'<joint name="joint_{k}" type="revolute"><parent link="link_{parent}"/><child link="link_{k}"/>'
            f'<origin xyz="{place}" rpy="{turn}"/><axis xyz="0 0 1"/>'
            '<limit lower="-1.5" upper="1.5" effort="80" velocity="4"/></joint>'
        )
    return "".join(parts) + "</robot>"


def write_log(robot: Path, log: Path, seconds: float, rng: np.random.Generator) -> None:
    """Positions and torques of a motion, as Parquet."""
    model = pin.buildModelFromUrdf(str(robot))
    data, time_stamps, n = model.createData(), np.arange(0.0, seconds, 1.0 / RATE), model.nv
    w = 0.2 * np.pi * HARMONICS
    size = 0.15 * rng.normal(size=(n, len(w))) / HARMONICS
    phase = w * time_stamps[:, None, None] + rng.uniform(0.0, 2.0 * np.pi, (n, len(w)))  # (N, n, harmonics)
    q = np.sum(size * np.sin(phase), axis=2)
    v = np.sum(size * w * np.cos(phase), axis=2)
    a = -np.sum(size * w**2 * np.sin(phase), axis=2)
    rigid = np.array([pin.rnea(model, data, *state) for state in zip(q, v, a, strict=True)])
    torque = rigid + VISCOUS * v + COULOMB * np.tanh(v / 0.01) + TORQUE_NOISE * rng.normal(size=q.shape)
    q = q + POSITION_NOISE * rng.normal(size=q.shape)
    columns = {"time": time_stamps}
    columns |= {f"q_joint_{k + 1}": q[:, k] for k in range(n)}
    columns |= {f"tau_joint_{k + 1}": torque[:, k] for k in range(n)}
    pq.write_table(pa.table(columns), log)


def measured(command: list[str]) -> dict[str, float]:
    """Exit code, seconds and gigabytes of a command of casysid."""
    began = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "casysid", *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return {
        "exit code": process.returncode,
        "CPU [s]": round(usage.ru_utime + usage.ru_stime, 1),
        "wall [s]": round(time.perf_counter() - began, 1),
        "peak [GB]": round(usage.ru_maxrss * 1024 / 1e9, 2),
    }


def main() -> None:
    """Run both commands and print their table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--identify", type=int, default=60, metavar="JOINTS", help="of the tree that is identified")
    parser.add_argument("--info", type=int, default=200, metavar="JOINTS", help="of the tree that is looked into")
    parser.add_argument("--seconds", type=float, default=30.0, help="of the log")
    parser.add_argument(
        "--option", action="append", default=[], help="of casysid identify, such as --option=--cutoff=5"
    )
    parser.add_argument("--json", type=Path, help="write the figures here as well")
    options = parser.parse_args()
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        rng, place = np.random.default_rng(1), Path(folder)
        for command, joints in (("info", options.info), ("identify", options.identify)):
            if not joints:
                continue
            robot, log = place / f"tree_{joints}.urdf", place / f"tree_{joints}.parquet"
            robot.write_text(tree(joints, rng))
            arguments = [command, str(robot)]
            if command == "identify":
                write_log(robot, log, options.seconds, rng)
                arguments += [str(log), "--out", str(place / "out"), *options.option]
            results[f"{command}, {joints} joints"] = measured(arguments)
            print(f"{command}, {joints} joints: ", results[f"{command}, {joints} joints"], flush=True)
    if options.json:
        options.json.write_text(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()

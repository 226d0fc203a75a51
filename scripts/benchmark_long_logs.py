"""Memory and processor time of `casysid info` and `casysid identify` over the length of the log.

    python scripts/benchmark_long_logs.py [--rows 100000 1000000 10000000] [--commands info identify] [--json FILE]

For each length a log of an arm with seven joints at 1 kHz is written as Parquet (or as --format csv, csv.gz, npz) into
a temporary folder, which is deleted at the end, and each command is run on it by a process of its own. Its peak
resident memory and its processor time are those that the operating system counts. Both commands should stay below 700
MB whatever the length.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv as pa_csv
from pyarrow import parquet

RATE, JOINTS = 1000.0, 7
CHUNK = 1 << 17
LARGEST = 700e6
FORMATS = ("parquet", "csv", "csv.gz", "npz")

LINK = (
    '<link name="link{k}"><inertial><origin xyz="0 .02 .1"/><mass value="2"/>'
    '<inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="joint{k}" type="revolute"><parent link="link{before}"/><child link="link{k}"/>'
    '<origin xyz="0 0 .3"/><axis xyz="{axis}"/><limit lower="-2.9" upper="2.9" velocity="20" effort="90"/></joint>'
)


def write_arm(path: Path) -> Path:
    """Seven joints in a row, their axes in turn along and across the links."""
    axes = ["0 0 1", "0 1 0"]
    parts = [LINK.format(k=k + 1) + JOINT.format(k=k + 1, before=k, axis=axes[k % 2]) for k in range(JOINTS)]
    path.write_text(f'<robot name="arm"><link name="link0"/>{"".join(parts)}</robot>')
    return path


def tables(robot: Path, rows: int) -> Iterator[pa.Table]:
    """The log chunk by chunk: four sines a joint, torques of the model with friction, noise on both."""
    from casysid.dynamics import build_regressor
    from casysid.robot import Robot

    rng = np.random.default_rng(0)
    omega, phase = 2.0 * np.pi * rng.uniform(0.1, 1.2, (4, JOINTS)), rng.uniform(0.0, 2.0 * np.pi, (4, JOINTS))
    regressor = build_regressor(Robot.from_urdf(robot), friction=())
    names = ["time", *(f"q{k + 1}" for k in range(JOINTS)), *(f"tau{k + 1}" for k in range(JOINTS))]
    for first in range(0, rows, CHUNK):
        moments = np.arange(first, min(first + CHUNK, rows)) / RATE
        angle = omega * moments[:, None, None] + phase
        q, v, a = 0.3 * np.sin(angle), 0.3 * omega * np.cos(angle), -0.3 * omega**2 * np.sin(angle)
        q, v, a = (x.sum(axis=1) for x in (q, v, a))
        torque = regressor.predict(regressor.prior, q, v, a) + 2.0 * np.tanh(v / 0.02) + 1.5 * v
        torque += 0.2 * rng.normal(size=q.shape)
        q = q + 1e-5 * rng.normal(size=q.shape)
        yield pa.table([moments, *q.T, *torque.T], names=names)


def write_log(folder: Path, robot: Path, rows: int, kind: str) -> Path:
    """A log of so many rows."""
    path = folder / f"log{rows}.{kind}"
    parts = tables(robot, rows)
    if kind == "npz":
        whole = pa.concat_tables(parts)
        np.savez(path, **{name: whole.column(name).to_numpy() for name in whole.column_names})
        return path
    first = next(parts)
    with pa.output_stream(str(path), compression="gzip" if kind == "csv.gz" else None) as stream:
        opener = parquet.ParquetWriter if kind == "parquet" else pa_csv.CSVWriter
        with opener(stream, first.schema) as writer:
            for part in chain([first], parts):
                writer.write_table(part)
    return path


def measured(command: str, robot: Path, log: Path, folder: Path) -> dict[str, float]:
    """Peak memory [B], processor and wall time [s] of one command."""
    arguments = [sys.executable, "-m", "casysid", command, str(robot), str(log)]
    arguments += ["--out", str(folder / "result")] if command == "identify" else []
    begin = time.perf_counter()
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    said = process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 1):
        raise SystemExit(f"casysid {command} failed on {log}:\n{said}")
    unit = 1 if sys.platform == "darwin" else 1024
    return {
        "memory": used.ru_maxrss * unit,
        "cpu": used.ru_utime + used.ru_stime,
        "wall": time.perf_counter() - begin,
    }


def main() -> None:
    """Make the logs, run the commands, print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, nargs="+", default=[10**5, 10**6, 10**7], help="lengths of the logs")
    parser.add_argument("--commands", nargs="+", default=["info", "identify"], choices=["info", "identify"])
    parser.add_argument("--format", default="parquet", choices=FORMATS, help="of the logs")
    parser.add_argument("--folder", type=Path, help="where to make the temporary folder")
    parser.add_argument("--json", type=Path, help="where to write the figures")
    given = parser.parse_args()
    figures = []
    with tempfile.TemporaryDirectory(dir=given.folder) as name:
        folder = Path(name)
        robot = write_arm(folder / "arm.urdf")
        for rows in given.rows:
            log = write_log(folder, robot, rows, given.format)
            for command in given.commands:
                figure = {"command": command, "rows": rows} | measured(command, robot, log, folder)
                figures.append(figure)
                verdict = "" if figure["memory"] <= LARGEST else "  more than 700 MB"
                print(
                    f"{command:9s} {rows:>9d} rows  {figure['memory'] / 1e6:7.0f} MB  "
                    f"{figure['cpu']:7.1f} s CPU  {figure['wall']:7.1f} s{verdict}",
                    flush=True,
                )
            log.unlink()
    if given.json:
        given.json.write_text(json.dumps({"bytes_and_seconds": figures, "format": given.format}, indent=1) + "\n")


if __name__ == "__main__":
    main()

"""A designed motion as files: samples, coefficients, a ROS message, and words."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError, SolverError
from casysid.excitation.results import ExcitationDesign
from casysid.excitation.words import describe
from casysid.outputs import MANIFEST, Stage, run_folder, write_whole
from casysid.recording import Recording

MESSAGE_RATE = 100.0
"""Points per second of the ROS message; controllers interpolate between them [Hz]."""


def write_excitation(design: ExcitationDesign, directory: str | Path, *, rate: float | None = None) -> tuple[Path, ...]:
    """Write ``excitation.csv``, ``excitation.json``, ``joint_trajectory.yaml`` and ``excitation.txt``.

    The samples are time, ``q_``, ``v_``, ``a_`` and the torque ``tau_`` that the prior model expects, by joint, as
    :func:`casysid.recording.read_recording` reads them.

    Files of an earlier run there go, its pictures too; files of others stay.

    Args:
        design: Checked again before anything is written.
        directory: Made if it is not there.
        rate: Samples per second [Hz]; None takes the problem's.

    Returns:
        The files, the last one of which lists them.

    Raises:
        SolverError: The motion violates a limit; nothing is written. The message names who, when and by how much.
        ParameterError: The rate is not positive.
        OutputError: They cannot be written; the directory is as it was.
    """
    with run_folder(directory, identity_of(design)) as stage:
        files = add_excitation(design, stage, rate=rate)
    return *files, stage.home / MANIFEST


def add_excitation(design: ExcitationDesign, stage: Stage, *, rate: float | None = None) -> tuple[Path, ...]:
    """Write what :func:`write_excitation` writes to where a run's files wait; the paths that they will have."""
    rate = design.problem.rate if rate is None else rate
    if not (np.isfinite(rate) and rate > 0.0):
        raise ParameterError(f"write_excitation: rate must be a positive number of samples per second; got {rate}")
    recorded = int(np.ceil(rate * design.problem.series.period))
    for samples in (None, recorded):
        checked = design.check(samples)
        if not checked.passed:
            raise SolverError(
                f"excitation: the trajectory is not written, it violates {len(checked.violations)} limit(s), worst: "
                f"{checked.violations[0]}. Design it again"
            )
    sample_recording(design, rate).write(stage.folder / "excitation.csv")
    texts = {
        "excitation.json": _json(design),
        "joint_trajectory.yaml": "\n".join(_message(design, min(rate, MESSAGE_RATE))) + "\n",
        "excitation.txt": "\n".join(describe(design)) + "\n",
    }
    for name, text in texts.items():
        write_whole(stage.folder / name, text.encode(errors="backslashreplace"))
    return tuple(stage.home / name for name in ("excitation.csv", *texts))


def identity_of(design: ExcitationDesign) -> str:
    """What tells a motion from others: a digest of its coefficients."""
    return hashlib.sha256(_json(design).encode(errors="backslashreplace")).hexdigest()


def sample_recording(design: ExcitationDesign, rate: float) -> Recording:
    """All periods as samples at a rate [Hz], with the torque that the prior model expects."""
    trajectory, problem = design.trajectory, design.problem
    time = np.arange(int(np.floor(rate * trajectory.duration + 1e-9)) + 1) / rate
    motion = trajectory.motion(time)
    return Recording(
        channels=problem.robot.channels,
        dofs=problem.robot.dofs,
        time=time,
        position=motion.position,
        velocity=motion.velocity,
        acceleration=motion.acceleration,
        torque=expected_torque(design, time),
    )


def expected_torque(design: ExcitationDesign, time: Array) -> Array:
    """Of the prior model, at times (N,), shape (N, n)."""
    problem = design.problem
    return problem.information.regressor.predict(problem.parameters, *design.trajectory.state(time))


def coefficients(design: ExcitationDesign) -> dict[str, Any]:
    """The motion as numbers: ``q(t) = offset + Σ_k sine_k sin(k ω t) + cosine_k cos(k ω t)`` for each joint."""
    problem, trajectory = design.problem, design.trajectory
    sine, cosine = problem.series.coefficients(trajectory.coordinates)
    checked = design.check()
    return {
        "robot": problem.robot.name,
        "formula": "q(t) = offset + sum_k sine[k] sin(2 pi k t / period) + cosine[k] cos(2 pi k t / period), k = 1...",
        "period": problem.series.period,
        "periods": problem.periods,
        "harmonics": problem.series.harmonics,
        "status": design.status.value,
        "criterion": problem.criterion.name,
        "log_det": design.log_det,
        "condition_number": design.condition_number,
        "checked": {
            "samples": checked.samples,
            "passed": checked.passed,
            "tightest": [str(margin) for margin in checked.tightest],
        },
        "joints": {
            dof: {
                "start": float(trajectory.start[k]),
                "offset": float(trajectory.offset[k]),
                "sine": sine[k].tolist(),
                "cosine": cosine[k].tolist(),
            }
            for k, dof in enumerate(problem.robot.dofs)
        },
        "notes": list(problem.notes),
    }


def _message(design: ExcitationDesign, rate: float) -> Iterator[str]:
    """``trajectory_msgs/JointTrajectory`` as YAML."""
    trajectory, names = design.trajectory, design.problem.robot.dofs
    time = np.linspace(0.0, trajectory.duration, int(np.ceil(rate * trajectory.duration)) + 1)
    motion = trajectory.motion(time)
    yield f"joint_names: {json.dumps(list(names))}"
    yield "points:"
    for k, t in enumerate(time):
        nanoseconds = round(float(t) * 1e9)
        for letter, (name, values) in zip("-  ", _rows(motion, k), strict=True):
            yield f"{letter} {name}: [{', '.join(f'{x:.9g}' for x in values)}]"
        yield f"  time_from_start: {{sec: {nanoseconds // 10**9}, nanosec: {nanoseconds % 10**9}}}"


def _rows(motion: tuple[Array, ...], k: int) -> Iterator[tuple[str, Array]]:
    for name, values in zip(("positions", "velocities", "accelerations"), motion, strict=False):
        yield name, values[k]


def _json(design: ExcitationDesign) -> str:
    return json.dumps(coefficients(design), indent=1, ensure_ascii=False) + "\n"

"""A designed motion as files: samples, coefficients, a ROS message, and words."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError, SolverError
from casysid.excitation.design.result import ExcitationDesign
from casysid.excitation.design.summary import describe
from casysid.excitation.motion.fourier import Motion, state_of
from casysid.excitation.playing.collisions import CollisionCheck, check_collisions
from casysid.excitation.playing.played import PlayedMotion
from casysid.outputs import MANIFEST, Stage, run_folder, write_whole
from casysid.recording import Recording


def write_excitation(
    design: ExcitationDesign, directory: str | Path, *, rate: float | None = None, played: PlayedMotion | None = None
) -> tuple[Path, ...]:
    """Write ``excitation.csv``, ``excitation.json``, ``joint_trajectory.yaml`` and ``excitation.txt``.

    The samples are time, ``q_``, ``v_``, ``a_`` and the torque ``tau_`` that the prior model expects, by joint, as
    :func:`casysid.recording.read_recording` reads them. ``joint_trajectory.yaml`` is a ROS 2
    ``trajectory_msgs/JointTrajectory`` with the same samples.

    Files of an earlier run there go, its pictures too; files of others stay.

    Args:
        design: Checked again before anything is written.
        directory: Made if it is not there.
        rate: Samples per second, as the controller takes them [Hz]; None takes the problem's.
        played: With what leads to the motion and back (:func:`find_way`); None is the motion alone.

    Returns:
        The files, the last one of which lists them.

    Raises:
        SolverError: The motion violates a limit; nothing is written. The message names who, when and by how much.
        ParameterError: The rate is not positive.
        OutputError: They cannot be written; the directory is as it was.
    """
    with run_folder(directory, identity_of(design, played)) as stage:
        files = add_excitation(design, stage, rate=rate, played=played)
    return *files, stage.home / MANIFEST


def add_excitation(
    design: ExcitationDesign, stage: Stage, *, rate: float | None = None, played: PlayedMotion | None = None
) -> tuple[Path, ...]:
    """Write what :func:`write_excitation` writes to where a run's files wait; the paths that they will have."""
    rate = design.problem.rate if rate is None else rate
    if not (np.isfinite(rate) and rate > 0.0):
        raise ParameterError(f"write_excitation: rate must be a positive number of samples per second; got {rate}")
    played = PlayedMotion(design.trajectory) if played is None else played
    collisions = _checked(design, played, rate)
    time = _instants(rate, played)
    sample_recording(design, rate, played).write(stage.folder / "excitation.csv")
    lines = [*describe(design), *_ways(played)]
    if collisions is not None:
        lines.append(f"Checked on {collisions}.")
    texts = {
        "excitation.json": _json(design, played, collisions),
        "joint_trajectory.yaml": "\n".join(_message(design.problem.robot.dofs, time, played.motion(time))) + "\n",
        "excitation.txt": "\n".join(lines) + "\n",
    }
    for name, text in texts.items():
        write_whole(stage.folder / name, text.encode(errors="backslashreplace"))
    return tuple(stage.home / name for name in ("excitation.csv", *texts))


def _checked(design: ExcitationDesign, played: PlayedMotion, rate: float) -> CollisionCheck | None:
    """What the last check saw.

    Raises:
        SolverError: A limit is violated, or shapes of the file meet.
    """
    for samples in (None, int(np.ceil(rate * design.problem.series.period))):
        checked = design.check(samples)
        if not checked.passed:
            raise SolverError(
                f"excitation: the trajectory is not written, it violates {len(checked.violations)} limit(s), worst: "
                f"{checked.violations[0]}. Design it again"
            )
    collisions = check_collisions(design.problem, played)
    if collisions is not None and collisions.distance < 0.0:
        raise SolverError(
            f"excitation: the trajectory is not written: {collisions.nearest} meet by {-collisions.distance:.3g} m at "
            f"{collisions.instant:.4g} s in the file's own collision geometry. Design it again with another seed, or "
            "with more clearance"
        )
    return collisions


def identity_of(design: ExcitationDesign, played: PlayedMotion | None = None) -> str:
    """What tells a motion from others: a digest of its coefficients."""
    return hashlib.sha256(_json(design, played).encode(errors="backslashreplace")).hexdigest()


def sample_recording(design: ExcitationDesign, rate: float, played: PlayedMotion | None = None) -> Recording:
    """All that is played as samples at a rate [Hz], with the torque that the prior model expects."""
    played, problem = PlayedMotion(design.trajectory) if played is None else played, design.problem
    time = _instants(rate, played)
    motion = played.motion(time)
    return Recording(
        channels=problem.robot.channels,
        dofs=problem.robot.dofs,
        time=time,
        position=motion.position,
        velocity=motion.velocity,
        acceleration=motion.acceleration,
        torque=problem.information.regressor.predict(problem.parameters, *state_of(problem.robot, motion)),
    )


def _instants(rate: float, played: PlayedMotion) -> Array:
    return np.arange(int(np.floor(rate * played.duration + 1e-9)) + 1) / rate


def expected_torque(design: ExcitationDesign, time: Array) -> Array:
    """Of the prior model, at times (N,), shape (N, n)."""
    problem = design.problem
    return problem.information.regressor.predict(problem.parameters, *design.trajectory.state(time))


def _ways(played: PlayedMotion) -> Iterator[str]:
    """Sentences on what leads to the motion and back."""
    if played.approach is not None:
        end = played.begin + played.trajectory.duration
        by = f" by {len(played.approach.places) - 2} place(s) between" if len(played.approach.places) > 2 else ""
        yield f"From the present position{by} to the start until {played.begin:.4g} s, back from {end:.4g} s."


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


def _message(dofs: Sequence[str], time: Array, motion: Motion) -> Iterator[str]:
    """``trajectory_msgs/JointTrajectory`` of ROS 2 as YAML."""
    yield f"joint_names: {json.dumps(list(dofs))}"
    yield "points:"
    for t, *rows in zip(time, *motion[:3], strict=True):
        nanoseconds = round(float(t) * 1e9)
        for letter, name, values in zip("-  ", ("positions", "velocities", "accelerations"), rows, strict=True):
            yield f"{letter} {name}: [{', '.join(f'{x:.9g}' for x in values)}]"
        yield f"  time_from_start: {{sec: {nanoseconds // 10**9}, nanosec: {nanoseconds % 10**9}}}"


def _json(
    design: ExcitationDesign, played: PlayedMotion | None = None, collisions: CollisionCheck | None = None
) -> str:
    values = coefficients(design)
    if played is not None and played.approach is not None:
        way = {"places": played.approach.places.tolist(), "durations": played.approach.durations.tolist()}
        values["approach"] = {**way, "said": "from place to place by minimum jerk; the way back is the same"}
    if collisions is not None:
        values["collisions"] = dataclasses.asdict(collisions)
    return json.dumps(values, indent=1, ensure_ascii=False) + "\n"

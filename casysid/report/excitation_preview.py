"""The robot on its designed motion, to be looked at in a browser before it is played."""

from __future__ import annotations

import html
import json
from importlib import resources
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np

from casysid.arrays import Array
from casysid.excitation import Box, ExcitationDesign, HalfSpace, PlayedMotion, capsules_of
from casysid.excitation.constraints.keep_clear import ClearanceConstraint
from casysid.excitation.constraints.kinematics import Points
from casysid.excitation.constraints.obstacles import Obstacle
from casysid.excitation.playing.files import identity_of
from casysid.kinematics.frames import WORLD
from casysid.outputs import Stage, run_folder, write_whole
from casysid.threads import single_threaded

FRAMES_PER_SECOND = 25.0
"""As films have (PAL)."""
GRID_LINES = 5
"""Of a plane, on either side of its middle."""


def write_excitation_preview(
    design: ExcitationDesign, directory: str | Path, *, played: PlayedMotion | None = None
) -> Path:
    """Write ``preview.html``: the robot, as the capsules that keep their distance, moving; it needs no other file.

    Args:
        design: The motion.
        directory: Made if it is not there.
        played: With what leads to it and back; None is the motion alone.

    Raises:
        OutputError: It cannot be written, or the directory has the preview of another motion.
    """
    with run_folder(directory, identity_of(design, played), joining=True) as stage:
        return add_excitation_preview(design, stage, played=played)


@single_threaded()
def add_excitation_preview(design: ExcitationDesign, stage: Stage, *, played: PlayedMotion | None = None) -> Path:
    """Write ``preview.html`` to where a run's files wait; the path that it will have."""
    data = _scene(design, played or PlayedMotion(design.trajectory))
    name = html.escape(design.problem.robot.name)
    said = html.escape(" ".join(f"{note[0].upper()}{note[1:]}." for note in design.problem.notes))
    page = resources.files("casysid.report").joinpath("preview.html").read_text(encoding="utf-8")
    text = json.dumps(data, separators=(",", ":"))
    page = page.replace("TITLE", name).replace("SAID", said).replace("DATA", text)
    write_whole(stage.folder / "preview.html", page.encode(errors="backslashreplace"))
    return stage.home / "preview.html"


def _scene(design: ExcitationDesign, played: PlayedMotion) -> dict[str, Any]:
    problem = design.problem
    kept = [one for one in problem.constraints if isinstance(one, ClearanceConstraint)]
    capsules = kept[0].every.capsules if kept else capsules_of(problem.robot)
    obstacles = kept[0].every.obstacles if kept else ()
    time = np.arange(0.0, played.duration + 1e-9, 1.0 / FRAMES_PER_SECOND)
    points = Points(problem.robot)
    frames = points.frames(played.motion(time).position)
    joint = np.array([capsule.joint for capsule in capsules], dtype=np.intp)
    ends = [
        points.places(frames, joint, np.array([getattr(one, end) for one in capsules]).reshape(-1, 3))
        for end in ("start", "end")
    ]
    numbers = np.round(np.stack(ends, axis=-1).transpose(1, 2, 3, 0), 4)  # (N, capsules, 2, 3)
    corners = numbers.reshape(-1, 3) if numbers.size else np.zeros((1, 3))
    low, high = corners.min(axis=0), corners.max(axis=0)
    extent = max(float(np.linalg.norm(high - low)) / 2.0, 0.1)
    center = (low + high) / 2.0
    return {
        "step": 1.0 / FRAMES_PER_SECOND,
        "center": center.tolist(),
        "extent": extent,
        "capsules": [[round(one.radius, 4), one.joint if one.joint != WORLD else -1] for one in capsules],
        "frames": numbers.reshape(len(time), -1).tolist(),
        "lines": [np.round(line, 4).tolist() for one in obstacles for line in _lines(one, center, extent)],
    }


def _lines(obstacle: Obstacle, center: Array, extent: float) -> list[Array]:
    """What is drawn of an obstacle, each (2, 3): a box's edges, a grid on a plane."""
    if isinstance(obstacle, Box):
        corners = [np.array(one) for one in product(*zip(obstacle.lower, obstacle.upper, strict=True))]
        return [np.array(pair) for pair in combinations(corners, 2) if (pair[0] != pair[1]).sum() == 1]
    assert isinstance(obstacle, HalfSpace)
    middle = center - (obstacle.normal @ center - obstacle.offset) * obstacle.normal
    across = np.linalg.svd(obstacle.normal[None])[2][1:]
    lines = []
    for first, second in (across, across[::-1]):
        for k in range(-GRID_LINES, GRID_LINES + 1):
            side = middle + k * extent / GRID_LINES * first
            lines.append(np.array([side - extent * second, side + extent * second]))
    return lines

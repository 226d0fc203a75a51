"""A strip of pictures of the robot on its designed motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.excitation import Box, ExcitationDesign, capsules_of
from casysid.excitation.cartesian_blocks import ClearanceBlock
from casysid.excitation.kinematics import Kinematics
from casysid.excitation.output import identity_of
from casysid.outputs import Stage, run_folder
from casysid.report.pictures import figure_grid, write_png
from casysid.simulation.drawing import draw_capsules

INSTANTS = 8
"""Pictures in a strip."""


def write_excitation_preview(design: ExcitationDesign, directory: str | Path) -> Path:
    """Write ``preview.png``: the robot, as the capsules that keep their distance, at equal times over one period.

    Raises:
        MissingExtraError: This machine cannot draw; the message says what it lacks.
        OutputError: It cannot be written, or the directory has the preview of another motion.
    """
    with run_folder(directory, identity_of(design), joining=True) as stage:
        return add_excitation_preview(design, stage)


def add_excitation_preview(design: ExcitationDesign, stage: Stage) -> Path:
    """Write ``preview.png`` to where a run's files wait; the path that it will have.

    Raises:
        MissingExtraError: This machine cannot draw; the message says what it lacks.
    """
    time = design.problem.series.grid(INSTANTS)
    pictures = _pictures(design, time)
    canvas, axes = figure_grid(1.5 * INSTANTS, 1.75, INSTANTS)
    for ax, picture, t in zip(axes, pictures, time, strict=True):
        ax.imshow(picture)
        ax.set_axis_off()
        ax.set_title(f"{t:.2f} s", fontsize=8)
    write_png(canvas, stage.folder / "preview.png", dpi=110)
    return stage.home / "preview.png"


def _pictures(design: ExcitationDesign, time: Array) -> npt.NDArray[np.uint8]:
    problem = design.problem
    blocks = [block for block in problem.blocks if isinstance(block, ClearanceBlock)]
    capsules = blocks[0].every.capsules if blocks else capsules_of(problem.robot)
    obstacles = blocks[0].every.obstacles if blocks else ()
    kinematics = Kinematics(problem.robot)
    frames = kinematics.frames(design.trajectory.motion(time).position)
    joint = np.array([capsule.joint for capsule in capsules], dtype=np.intp)
    start = kinematics.points(frames, joint, np.array([capsule.start for capsule in capsules]))
    end = kinematics.points(frames, joint, np.array([capsule.end for capsule in capsules]))
    boxes = tuple((one.lower, one.upper) for one in obstacles if isinstance(one, Box))
    return draw_capsules(start, end, np.array([capsule.radius for capsule in capsules]), joint, boxes=boxes)

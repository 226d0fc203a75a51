"""Pictures of a designed motion: joints and torques within their limits, distances, spectrum, information."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from casysid.arrays import Array
from casysid.excitation import ExcitationDesign, information_groups
from casysid.excitation.playing.files import expected_torque, identity_of
from casysid.outputs import Stage, run_folder
from casysid.report.labels import as_label
from casysid.report.pictures import MEASURED, PREDICTED, RESIDUAL, figure, write_png
from casysid.threads import single_threaded

_POINTS = 1200


@single_threaded()
def write_excitation_pictures(design: ExcitationDesign, directory: str | Path) -> tuple[Path, ...]:
    """Write pictures of joints, torque, distances (if any are kept), spectrum and information as PNG files.

    Raises:
        OutputError: They cannot be written, or the directory has pictures of another motion.
    """
    with run_folder(directory, identity_of(design), joining=True) as stage:
        return add_excitation_pictures(design, stage)


@single_threaded()
def add_excitation_pictures(design: ExcitationDesign, stage: Stage) -> tuple[Path, ...]:
    """Write the pictures to where a run's files wait; the paths that they will have."""
    pictures = {
        "joints.png": joint_figure(design),
        "torque.png": torque_figure(design),
        "distances.png": distance_figure(design),
        "spectrum.png": spectrum_figure(design),
        "information.png": information_figure(design),
    }
    written = []
    for name, canvas in pictures.items():
        if canvas is not None:
            write_png(canvas, stage.folder / name, dpi=110)
            written.append(stage.home / name)
    return tuple(written)


def joint_figure(design: ExcitationDesign) -> Any:
    """Position and velocity of each joint as a share of their limits."""
    problem, (time, motion) = design.problem, _motion(design)
    dofs = problem.robot.dofs
    canvas, axes = figure(9.5, 1.0 + 1.1 * len(dofs), len(dofs))
    for k, (ax, dof) in enumerate(zip(axes, dofs, strict=True)):
        limits = problem.limits
        ax.plot(
            time, (motion.position[:, k] - limits.middle[k]) / limits.half_range[k], color=PREDICTED, label="position"
        )
        ax.plot(time, motion.velocity[:, k] / limits.velocity[k], color=MEASURED, linewidth=0.9, label="velocity")
        _limits(ax, 1.0)
        ax.set_ylabel(as_label(dof), fontsize=8)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=2, frameon=False, fontsize=8)
    axes[-1].set_xlabel("time [s], one period; shares of the limits")
    return canvas


def torque_figure(design: ExcitationDesign) -> Any:
    """Torque that the prior model expects, with its limits."""
    problem, (time, _) = design.problem, _motion(design)
    torque, dofs = expected_torque(design, time), problem.robot.dofs
    canvas, axes = figure(9.5, 1.0 + 1.1 * len(dofs), len(dofs))
    for k, (ax, dof) in enumerate(zip(axes, dofs, strict=True)):
        ax.plot(time, torque[:, k], color=PREDICTED)
        limit = problem.limits.torque[k]
        if np.isfinite(limit) and np.abs(torque[:, k]).max() > 0.4 * limit:
            _limits(ax, limit)
        ax.set_ylabel(as_label(dof), fontsize=8)
    axes[-1].set_xlabel("time [s], one period; torque [N m, N], limits drawn where they are near")
    return canvas


def distance_figure(design: ExcitationDesign) -> Any:
    """The six least distances, with what is to be kept; None when none are."""
    blocks = [one for one in design.problem.constraints if one.kind == "distance"]
    if not blocks:
        return None
    time, motion = _motion(design)
    block = blocks[0]
    values = block.measure(motion)
    canvas, (ax,) = figure(9.5, 3.2)
    for k in np.argsort(values.min(axis=0))[:6]:
        ax.plot(time, values[:, k], linewidth=0.9, label=as_label(block.labels[k]))
    ax.axhline(float(block.lower[0]), color=RESIDUAL, linewidth=1.0)
    ax.set_ylabel("distance [m]")
    ax.set_xlabel("time [s], one period")
    ax.legend(frameon=False, fontsize=7, loc="upper right")
    return canvas


def spectrum_figure(design: ExcitationDesign) -> Any:
    """Amplitude of each harmonic, joint by joint."""
    problem = design.problem
    sine, cosine = problem.series.coefficients(design.trajectory.coordinates)
    canvas, (ax,) = figure(7.0, 3.2)
    width = 0.8 / len(problem.robot.dofs)
    for k, dof in enumerate(problem.robot.dofs):
        amplitude = np.hypot(sine[k], cosine[k])
        ax.bar(
            np.arange(1, problem.series.harmonics + 1) + (k + 0.5) * width - 0.4, amplitude, width, label=as_label(dof)
        )
    ax.set_xticks(range(1, problem.series.harmonics + 1), [f"{f:.3g}" for f in problem.series.frequencies])
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("amplitude [rad, m]")
    ax.legend(frameon=False, fontsize=7, ncol=2)
    return canvas


def information_figure(design: ExcitationDesign) -> Any:
    """Expected standard deviation of each group of base parameters, before (if anything was known) and after."""
    groups = information_groups(design)
    canvas, (ax,) = figure(8.0, 1.2 + 0.17 * len(groups))
    place = np.arange(len(groups))[::-1]
    after = np.array([group.after for group in groups])
    ax.scatter(after, place, color=PREDICTED, s=16, zorder=3, label="with this motion")
    before = np.array([group.before for group in groups])
    if np.isfinite(before).any():
        ax.scatter(before, place, color=MEASURED, s=16, label="before")
        ax.legend(frameon=False, fontsize=8)
    ax.set_xscale("log")
    ax.set_yticks(place, [f"{as_label(group.owner)} {group.kind}" for group in groups], fontsize=6)
    ax.set_xlabel("expected standard deviation (1: the torque noise, for a parameter in usual motion)")
    return canvas


def _motion(design: ExcitationDesign) -> tuple[Array, Any]:
    time = np.linspace(0.0, design.problem.series.period, _POINTS)
    return time, design.trajectory.motion(time)


def _limits(ax: Any, limit: float) -> None:
    for side in (-limit, limit):
        ax.axhline(side, color=RESIDUAL, linewidth=0.8)

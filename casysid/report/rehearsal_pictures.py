"""Pictures of a rehearsal: torque, tracking before and after, identified against true parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from casysid.identification.output import identity_of
from casysid.outputs import Stage, run_folder
from casysid.report.labels import as_label
from casysid.report.pictures import MEASURED, MOST_POINTS, PREDICTED, RESIDUAL, figure, write_png
from casysid.report.tables import torque_unit
from casysid.threads import single_threaded
from casysid.validation import Rehearsal
from casysid.validation.tracking import position_error

COLOURS = {"file": RESIDUAL, "identified": PREDICTED, "true": MEASURED}
WORDS = {"file": "model file", "identified": "identified", "true": "true parameters"}
MOST_COMBINATIONS = 30
SHOWN_SECONDS = 12.0


@single_threaded()
def write_rehearsal_pictures(rehearsal: Rehearsal, directory: str | Path) -> tuple[Path, ...]:
    """Write ``torques.png``, ``tracking.png`` and ``parameters.png``, beside the rehearsal's other files; their paths.

    Raises:
        OutputError: They cannot be written, or the directory has pictures of another rehearsal.
    """
    with run_folder(directory, identity_of(rehearsal.result), joining=True) as stage:
        return add_rehearsal_pictures(rehearsal, stage)


@single_threaded()
def add_rehearsal_pictures(rehearsal: Rehearsal, stage: Stage) -> tuple[Path, ...]:
    """Write the pictures to where a run's files wait; the paths that they will have."""
    pictures = {
        "torques.png": rehearsed_torque_figure(rehearsal),
        "tracking.png": tracking_figure(rehearsal),
        "parameters.png": parameter_figure(rehearsal),
    }
    for name, canvas in pictures.items():
        write_png(canvas, stage.folder / name, dpi=120)
    return tuple(stage.home / name for name in pictures)


def rehearsed_torque_figure(rehearsal: Rehearsal) -> Any:
    """Torque as logged on the unseen motion, and as the model file and the identified parameters predict it."""
    result = rehearsal.result
    times = result.file.times[0]
    shown = _first_seconds(times)
    file, measured = result.file.predictions[0], result.file.measured[0]
    predicted = (result.held_out or result.train).predictions[0]
    dofs = result.robot.dofs
    canvas, axes = figure(9.5, 1.0 + 1.35 * len(dofs), len(dofs))
    for k, (ax, dof) in enumerate(zip(axes, dofs, strict=True)):
        time = times[shown]
        ax.plot(time, measured[shown, k], color=MEASURED, linewidth=2.2, label="measured")
        ax.plot(time, file[shown, k], color=RESIDUAL, linewidth=0.8, label="predicted by the model file")
        ax.plot(time, predicted[shown, k], color=PREDICTED, linewidth=1.0, label="predicted by identified parameters")
        ax.set_ylabel(f"{as_label(dof)}\n{torque_unit(result.robot, k)}", fontsize=8)
    _legend(axes[0])
    axes[-1].set_xlabel("time [s], motion never fitted")
    return canvas


def tracking_figure(rehearsal: Rehearsal) -> Any:
    """Position error under computed torque over time, by joint and by source of the parameters."""
    dofs = rehearsal.plant.robot.dofs
    canvas, axes = figure(9.5, 1.0 + 1.35 * len(dofs), len(dofs))
    for name, run in rehearsal.tracking_runs.items():
        shown = _first_seconds(run.reference.time)
        error = 1000.0 * position_error(rehearsal.plant, run)[shown]
        means = rehearsal.tracking[name].means()
        label = (
            f"{WORDS[name]}: RMS {1000.0 * means['position']:.3g}" if np.isfinite(means["position"]) else WORDS[name]
        )
        for k, ax in enumerate(axes):
            ax.plot(run.reference.time[shown], error[:, k], color=COLOURS[name], linewidth=1.0, label=label)
    for ax, dof in zip(axes, dofs, strict=True):
        ax.set_ylabel(f"{as_label(dof)}\nmrad, mm", fontsize=8)
    _legend(axes[0])
    axes[-1].set_xlabel("time [s], position error under computed torque")
    return canvas


def parameter_figure(rehearsal: Rehearsal) -> Any:
    """How far base parameters are from the truth, as the torque it makes; those first that the file has most wrong."""
    base = rehearsal.base
    before, after = (base.torque * (values - base.true) for values in (base.file, base.identified))
    order = np.argsort(-np.abs(before))[:MOST_COMBINATIONS][::-1]
    places = np.arange(len(order))
    interval = 1.96 * (base.torque * np.where(np.isfinite(base.std), base.std, 0.0))[order]
    canvas, (ax,) = figure(9.5, 1.2 + 0.24 * len(order))
    ax.axvline(0.0, color="#52606d", linewidth=0.8)
    ax.hlines(places, np.minimum(before, after)[order], np.maximum(before, after)[order], color="#e5e8eb", linewidth=3)
    ax.plot(before[order], places, "o", color=RESIDUAL, markersize=5, label="model file")
    ax.errorbar(
        after[order],
        places,
        xerr=interval,
        fmt="o",
        color=PREDICTED,
        markersize=4,
        linewidth=1.2,
        label="identified, with 95 % interval",
    )
    ax.set_yticks(places, [as_label(_short(base.names[k])) for k in order], fontsize=7)
    ax.set_xscale("symlog", linthresh=max(float(np.median(np.abs(before))), 1e-9))
    ax.set_xlabel("distance from the true value, as the RMS torque that it makes [N m]")
    _legend(ax)
    return canvas


def _first_seconds(time: Any) -> Any:
    """Indices of the first seconds, few enough to draw."""
    count = int(np.searchsorted(time, time[0] + SHOWN_SECONDS))
    return np.arange(0, count, max(1, count // MOST_POINTS))


def _short(name: str) -> str:
    """The leading parameter of a combination; dots for what joins it."""
    words = name.split(" ")
    return words[0] if len(words) == 1 else f"{words[0]} …"


def _legend(ax: Any) -> None:
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=3, frameon=False, fontsize=8)

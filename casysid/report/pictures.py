"""Pictures of an identification: measured and predicted torque, the choice of the cut-off."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np

from casysid.arrays import Array
from casysid.identification import IdentificationResult, torque_band
from casysid.outputs import whole_file
from casysid.report.labels import as_label
from casysid.report.tables import torque_unit
from casysid.signals import Motion

MEASURED, PREDICTED, RESIDUAL = "#9aa5b1", "#1f6feb", "#d1495b"
BAND = "#c9dcf8"
MOST_POINTS = 3000
MOST_ROWS = 100
"""Joints in one picture: four times as many are more dots than a PNG may have."""


def figure(width: float, height: float, rows: int = 1) -> tuple[Any, Any]:
    """A figure of its own, outside pyplot's global state, with ``rows`` axes above each other."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    canvas = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(canvas)
    axes = canvas.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for ax in axes:
        ax.spines[["top", "right"]].set_visible(False)
        ax.grid(color="#e5e8eb", linewidth=0.6)
        ax.set_axisbelow(True)
    return canvas, axes


def figure_grid(width: float, height: float, columns: int) -> tuple[Any, Any]:
    """A figure of its own with ``columns`` bare axes beside each other."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    canvas = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(canvas)
    return canvas, canvas.subplots(1, columns, squeeze=False)[0]


def torque_figure(result: IdentificationResult) -> Any:
    """Measured and predicted torque of each joint with its 95 % band, over the first held-out or else fitted motion."""
    error = result.held_out or result.train
    motion: Motion = (result.held_out_motions or result.train_motions)[0]
    time, measured, predicted = error.times[0], error.measured[0], error.predictions[0]
    band = torque_band(result, motion)
    band = np.column_stack([np.interp(time, motion.time, own) for own in band.T])
    pick = slice(None, None, max(1, len(time) // MOST_POINTS))
    dofs = result.robot.dofs[:MOST_ROWS]
    canvas, axes = figure(9.5, 1.0 + 1.35 * len(dofs), len(dofs))
    for k, (ax, dof) in enumerate(zip(axes, dofs, strict=True)):
        ax.plot(time[pick], measured[pick, k], color=MEASURED, linewidth=2.4, label="measured, low-passed")
        lower, upper = predicted[pick, k] - band[pick, k], predicted[pick, k] + band[pick, k]
        ax.fill_between(time[pick], lower, upper, color=BAND, linewidth=0.0, label="95 % band")
        ax.plot(time[pick], predicted[pick, k], color=PREDICTED, linewidth=1.0, label="predicted")
        ax.plot(time[pick], (measured - predicted)[pick, k], color=RESIDUAL, linewidth=0.7, label="difference")
        _limit(ax, measured[:, k], predicted[:, k])
        ax.set_ylabel(f"{as_label(dof)}\n{torque_unit(result.robot, k)}", fontsize=8)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=4, frameon=False, fontsize=8)
    axes[-1].set_xlabel("time [s]")
    canvas.align_ylabels(axes)
    return canvas


def write_png(canvas: Any, path: Path, *, dpi: float) -> None:
    """A figure as a PNG file, whole or not at all.

    Raises:
        OutputError: It cannot be written.
    """
    with whole_file(path) as stream:
        canvas.savefig(stream, format="png", dpi=dpi)


def inline_png(canvas: Any) -> str:
    """A figure as the text of a data URI."""
    buffer = io.BytesIO()
    canvas.savefig(buffer, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def _limit(ax: Any, measured: Array, predicted: Array) -> None:
    """Axis limits by what was measured, so that a wild prediction cannot hide it."""
    low, high = float(measured.min()), float(measured.max())
    low, high = min(low, 0.0), max(high, 0.0)
    room = 0.15 * max(high - low, 1e-9)
    inside = np.clip(predicted, low - 3 * room, high + 3 * room)
    ax.set_ylim(min(low, float(inside.min())) - room, max(high, float(inside.max())) + room)

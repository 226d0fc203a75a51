"""Tables of a rehearsal and of a model's validation on recordings."""

from __future__ import annotations

import numpy as np

from casysid.report.tables import Table, number, percent, torque_units
from casysid.validation import Rehearsal, Validation

WORDS = {"file": "the model file's", "identified": "identified", "true": "true"}


def validation_tables(validation: Validation) -> list[tuple[str, Table]]:
    """Torque error by joint, and by recording when there are several."""
    total = validation.total
    rows = [("all joints", percent(total.relative), percent(total.relative_unfiltered), "")]
    rows += [
        (dof, percent(float(relative)), "", number(float(rmse), 3))
        for dof, relative, rmse in zip(validation.robot.dofs, total.relative_by_joint, total.rmse, strict=True)
    ]
    cutoff = validation.cutoff.cutoff
    seen = "as logged" if cutoff is None else f"below {cutoff:.3g} Hz"
    header = ("joint", seen, "unfiltered torque", f"RMS error [{torque_units(validation.robot)}]")
    tables = [(f"Torque error of {validation.robot.source.name}", Table(header, tuple(rows)))]
    if len(validation.by_recording) > 1:
        each = tuple(
            (name, percent(error.relative), percent(error.relative_unfiltered), str(error.samples))
            for name, error in validation.by_recording
        )
        tables.append(("By recording", Table(("recording", seen, "unfiltered torque", "samples"), each)))
    return tables


def rehearsal_tables(rehearsal: Rehearsal) -> list[tuple[str, Table]]:
    """Torque and tracking by parameters' source, and how well the combinations were found."""
    return [
        ("On a motion never fitted, against the truth; means over joints", _outcome(rehearsal)),
        ("Position error under computed torque, RMS [mrad, mm]", _tracking(rehearsal)),
        ("Base parameters", _base(rehearsal)),
    ]


def _outcome(rehearsal: Rehearsal) -> Table:
    rows = []
    for name, error in rehearsal.torque_error.items():
        tracking = rehearsal.tracking[name]
        means = tracking.means()
        rows.append(
            (
                WORDS[name],
                percent(float(np.mean(error))),
                number(1000.0 * means["position"], 3),
                number(1000.0 * means["velocity"], 3),
                number(means["feedback"], 3) if tracking.completed else "FAILURE",
            )
        )
    header = ("parameters", "torque error", "position [mrad]", "velocity [mrad/s]", "feedback [N m]")
    return Table(header, tuple(rows))


def _tracking(rehearsal: Rehearsal) -> Table:
    columns = [1000.0 * tracking.position for tracking in rehearsal.tracking.values()]
    rows = tuple(
        (dof, *(number(float(column[k]), 3) for column in columns)) for k, dof in enumerate(rehearsal.plant.robot.dofs)
    )
    return Table(("joint", *(WORDS[name] for name in rehearsal.tracking)), rows)


def _base(rehearsal: Rehearsal) -> Table:
    base = rehearsal.base
    rows = (
        ("combinations that torque depends on", str(len(base.names))),
        ("truth within the 95 % interval", percent(base.coverage)),
        ("distance to the truth, over the model file's", percent(base.improvement())),
    )
    return Table(("", ""), rows)

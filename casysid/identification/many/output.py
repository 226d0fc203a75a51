"""A fleet on disk: ``fleet.json`` holds all, ``fleet.csv`` a line for each machine and quantity."""

from __future__ import annotations

import csv
import dataclasses
import io

from casysid.identification.many.fleet import Answer, Fleet, Machine
from casysid.identification.output import write_json
from casysid.outputs import Stage, write_whole

FLEET_FILES = ("fleet.json", "fleet.csv")
SIGNIFICANT = 0.01
"""Chance of equal machines below which a table says that they differ."""
HEADER = (
    "machine",
    "recordings",
    "quantity",
    "unit",
    "value",
    "std",
    "low",
    "high",
    "drift",
    "drift_low",
    "drift_high",
)


def add_fleet(fleet: Fleet, stage: Stage) -> None:
    """Write both files to where a run's files wait."""
    write_json(fleet_to_json(fleet), stage.folder / FLEET_FILES[0])
    lines = io.StringIO(newline="")
    table = csv.writer(lines, lineterminator="\n")
    table.writerow(HEADER)
    for machine in fleet.machines:
        for k, (name, unit) in enumerate(zip(fleet.quantities, fleet.units, strict=True)):
            drift, answer = machine.drifts[k], machine.answer
            figures = [float(column[k]) for column in (answer.values, answer.std, answer.low, answer.high)]
            slope = ["", "", ""] if drift is None else [drift.slope, drift.low, drift.high]
            table.writerow([machine.name, len(machine.recordings), name, unit, *figures, *slope])
    write_whole(stage.folder / FLEET_FILES[1], lines.getvalue().encode())


def fleet_to_json(fleet: Fleet) -> dict[str, object]:
    """Plain numbers, lists and words; drift is by recording."""
    return {
        "by": fleet.by,
        "robot": fleet.pooled.robot.name,
        "recordings": list(fleet.files),
        "units": dict(zip(fleet.quantities, fleet.units, strict=True)),
        "differences": _by_quantity(fleet, fleet.differences),
        "drift": _by_quantity(fleet, fleet.drifts),
        "parameters": list(fleet.pooled.regressor.names),
        "machines": {one.name: _machine_to_json(fleet, one) for one in fleet.machines},
    }


def fleet_rows(fleet: Fleet) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Header and rows of a table of how the machines differ: the standard deviation between them, the chance that
    equal machines scatter so much (a star where it is small), and change with the order of recordings.
    """
    header = ("quantity", "told by", "mean", "± between", "chance", "drift")
    rows = []
    for k, (name, unit, found) in enumerate(zip(fleet.quantities, fleet.units, fleet.differences, strict=True)):
        if found is None:
            continue
        chance = f"{found.chance:.2g}{' *' if found.chance < SIGNIFICANT else ''}"
        figures = f"{found.mean:.4g}", f"{found.between:.2g}", chance, _drift_words(fleet, k)
        rows.append((f"{name} [{unit}]", str(found.told), *figures))
    return header, tuple(rows)


def _drift_words(fleet: Fleet, quantity: int) -> str:
    """The slope over all recordings, or how many machines' slopes have intervals without zero."""
    moved = fleet.drifts[quantity]
    if moved is not None:
        return f"{moved.slope:.2g} ({moved.low:.2g} to {moved.high:.2g})"
    known = [drift for drift in (machine.drifts[quantity] for machine in fleet.machines) if drift is not None]
    drifting = sum(not drift.low <= 0.0 <= drift.high for drift in known)
    return f"{drifting} of {len(known)}" if known else ""


def _by_quantity(fleet: Fleet, found: tuple[object, ...]) -> dict[str, object]:
    return {
        name: None if one is None else dataclasses.asdict(one)  # type: ignore[call-overload]
        for name, one in zip(fleet.quantities, found, strict=True)
    }


def _machine_to_json(fleet: Fleet, machine: Machine) -> dict[str, object]:
    answer: Answer = machine.answer
    return {
        "recordings": list(machine.recordings),
        "status": answer.status,
        "relative_error": answer.relative_error,
        "quantities": {
            name: {
                "value": float(answer.values[k]),
                "std": float(answer.std[k]),
                "interval": [float(answer.low[k]), float(answer.high[k])],
            }
            for k, name in enumerate(fleet.quantities)
        },
        "drift": _by_quantity(fleet, machine.drifts),
        "parameters": answer.parameters.tolist(),
    }

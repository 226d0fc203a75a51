"""The tables that the screen and the HTML report share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

from casysid.dynamics import Coulomb
from casysid.dynamics.friction import force_unit, joint_directions
from casysid.identification import IdentificationResult
from casysid.identification.mistakes import Mistake
from casysid.identification.result import JOINT_KINDS, is_dry
from casysid.inertia import KINDS
from casysid.robot import Robot


@dataclass(frozen=True)
class Table:
    """A heading and rows of text.

    Attributes:
        header: Column titles.
        rows: Cells, as many as titles.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


MICROMETRES = 6
"""Decimals of a length in metres that mean anything."""


def number(value: float | None, digits: int = 4) -> str:
    """A number as people write it; a dash for what is not there or not known."""
    if value is None or math.isnan(value):
        return "–"
    return "∞" if math.isinf(value) else f"{value:.{digits}g}"


def as_sure(value: float, std: float, digits: int) -> str:
    """A number with no more digits than it is known by: ``~`` and two where nothing is known."""
    return number(value, digits) if math.isfinite(std) else f"~{number(value, 2)}"


def with_error(value: float | None, std: float | None) -> str:
    """A number and its standard error; a dash for what is not there."""
    if value is None:
        return number(None)
    if std is None or not math.isfinite(std):
        return f"~{number(value, 2)}"
    return f"{number(value, 3)} ± {number(std, 2)}"


def percent(value: float | None) -> str:
    """A share in per cent."""
    return "–" if value is None else f"{100.0 * value:.2f} %" if value < 10 else f"{value:.3g} ×"


def error_table(result: IdentificationResult) -> Table:
    """Relative torque error overall and by joint: fitted, held out, and of the file's own parameters."""
    held_out, train, file = result.held_out, result.train, result.file
    rows = [
        (
            "all joints",
            percent(train.relative),
            percent(held_out.relative if held_out else None),
            percent(file.relative),
            "",
        ),
        (
            "… unfiltered torque",
            percent(train.relative_unfiltered),
            percent(held_out.relative_unfiltered if held_out else None),
            percent(file.relative_unfiltered),
            "",
        ),
    ]
    rows += [
        (
            dof,
            percent(float(train.relative_by_joint[k])),
            percent(float(held_out.relative_by_joint[k]) if held_out else None),
            percent(float(file.relative_by_joint[k])),
            number(float((held_out or train).rmse[k]), 3),
        )
        for k, dof in enumerate(result.robot.dofs)
    ]
    header = ("joint", "fitted", "held out", "model file", f"RMS error [{torque_units(result.robot)}]")
    return Table(header, tuple(rows))


def mistake_table(mistakes: Sequence[Mistake]) -> Table:
    """What in a log contradicts the model file, and how well the file explains the torque either way."""
    rows = tuple(
        ("; or: ".join((one.words, *one.alternatives)), *(percent(share) for share in one.explained))
        for one in mistakes
    )
    return Table(("what looks wrong", "explained as logged", "explained if so corrected"), rows)


def torque_unit(robot: Robot, dof: int) -> str:
    """Unit of a degree of freedom's torque: N m or N; of a free-flyer's, which has no drive, N m."""
    direction = joint_directions(robot).get(dof)
    return "N m" if direction is None else force_unit(direction)


def torque_units(robot: Robot) -> str:
    """The units of a robot's torques, with commas between them."""
    return ", ".join(sorted({torque_unit(robot, dof) for dof in range(robot.nv)}, reverse=True))


def link_table(result: IdentificationResult) -> Table:
    """Mass and centre of mass with standard errors, principal figures of the inertia, and what can be known.

    What the data do not decide is marked by ``~`` and has two digits.
    """
    rows = []
    for link in result.links():
        centre = ", ".join(
            as_sure(round(float(value), MICROMETRES) + 0.0, float(std), 3)
            for value, std in zip(link.center_of_mass, link.center_of_mass_std, strict=True)
        )
        diagonal = ", ".join(
            as_sure(float(value), float(std), 3)
            for value, std in zip(link.inertia[:3], link.inertia_std[:3], strict=True)
        )
        mass = as_sure(link.mass, link.mass_std, 4)
        rows.append((link.name, mass, number(link.mass_std, 2), centre, diagonal, link.identifiable[0].value))
    header = ("link", "mass [kg]", "± std", "centre of mass [m]", "Ixx, Iyy, Izz at it [kg m²]", "mass identifiable")
    return Table(header, tuple(rows))


def source_table(result: IdentificationResult) -> Table:
    """Of every link, in words: which parameters can be known, which these recordings show, and what decided them."""
    rows = []
    for link in result.links():
        alike: dict[tuple[str, str], list[int]] = {}
        for k, words in enumerate(zip(link.identifiable, link.excitation, strict=True)):
            alike.setdefault((words[0].value, words[1].value), []).append(k)
        for (known, shown), places in alike.items():
            kinds = ", ".join(KINDS[k] for k in places)
            rows.append((link.name, kinds, known, shown, _range([float(link.by_data[k]) for k in places])))
    return Table(
        ("link", "parameters at its joint", "identifiable", "these recordings", "decided by the data"), tuple(rows)
    )


def _range(shares: list[float]) -> str:
    """Shares in per cent, from the smallest to the largest."""
    low, high = round(100.0 * min(shares)), round(100.0 * max(shares))
    return f"{low} %" if low == high else f"{low} … {high} %"


def drive_table(result: IdentificationResult) -> Table:
    """Viscous friction, offset and armature by joint and coupling, with standard errors; dry friction as one number."""
    table, std, dry = result.drive_parameters(), result.drive_std(), result.dry_friction()
    units: dict[str, set[str]] = {}
    for parameter in result.regressor.parameters[10 * len(result.robot.links) :]:
        units.setdefault(parameter.kind, set()).add(parameter.unit)
    there = {kind for row in table.values() for kind, value in row.items() if value is not None}
    usual = [kind for kind in JOINT_KINDS if kind in there and kind != Coulomb.kind]
    rows = tuple(
        (owner, number(dry[owner], 3), *(with_error(row.get(kind), std[owner].get(kind)) for kind in usual))
        for owner, row in table.items()
    )
    titles = [f"{kind} [{', '.join(sorted(units.get(kind, {''})))}]" for kind in usual]
    return Table(("joint", f"dry [{torque_units(result.robot)}]", *titles), rows)


def further_drive_table(result: IdentificationResult) -> Table:
    """All other friction and transmission, a parameter a row; what is within its standard error of zero is left out."""
    first = 10 * len(result.robot.links)
    shown = zip(result.regressor.parameters, result.parameters, result.uncertainty.std, strict=True)
    rows = tuple(
        (parameter.owner, parameter.kind, with_error(float(value), float(std)), parameter.unit)
        for parameter, value, std in islice(shown, first, None)
        if parameter.kind not in JOINT_KINDS and not is_dry(parameter.kind) and abs(value) > std
    )
    return Table(("joint", "further friction and transmission", "value", "unit"), rows)


def choice_table(result: IdentificationResult) -> Table:
    """What the data added to friction, with the held-out error of its joints in cross-validation."""
    rows = tuple(
        (" and ".join(one.joints), one.words, percent(one.error_before), percent(one.error_after))
        for one in result.friction.chosen
    )
    return Table(("joint", "added by the data", "held-out error without", "and with"), rows)

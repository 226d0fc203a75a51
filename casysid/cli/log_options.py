"""Options that say what a log does not: units, columns, and the side of the gears that its torques are of."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from casysid.recording import Declared

UnitsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--units",
        metavar="QUANTITY=UNIT",
        help="Of the logs' columns, such as position=deg, velocity=rpm, torque=mNm, time=ms. Repeatable.",
    ),
]
MapOption = Annotated[
    Path | None,
    typer.Option("--map", metavar="FILE", help="TOML that names the logs' columns; casysid info LOG prints one."),
]
ConstantOption = Annotated[
    list[str] | None,
    typer.Option(
        "--motor-constant",
        metavar="[JOINT=]NUMBER",
        help="The logs' torques are motor currents [A]; torque is current times this [N m/A]. Repeatable.",
    ),
]
GearOption = Annotated[
    list[str] | None,
    typer.Option(
        "--gear",
        metavar="[JOINT=]RATIO",
        help="The logs' torques are of the motors; the joints' are so many times them.",
    ),
]
EfficiencyOption = Annotated[
    list[str] | None,
    typer.Option("--efficiency", metavar="[JOINT=]SHARE", help="Of the gears, above 0 and at most 1. Repeatable."),
]


def declared_of(
    units: list[str] | None,
    columns: Path | None,
    constant: list[str] | None,
    gear: list[str] | None,
    efficiency: list[str] | None,
) -> Declared:
    """What the command line says of the logs; options come before the map's file."""
    from casysid.recording import Declared, parse_drive, parse_units, read_map

    said = Declared(
        units=parse_units(units or []),
        motor_constant=parse_drive("--motor-constant", "constant", constant),
        gear=parse_drive("--gear", "gear", gear),
        efficiency=parse_drive("--efficiency", "efficiency", efficiency),
    )
    return said if columns is None else said.over(read_map(columns))

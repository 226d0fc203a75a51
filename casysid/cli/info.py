"""``casysid info``: what a robot and a recording hold, before anything is computed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from casysid.cli.log_options import (
    ConstantOption,
    EfficiencyOption,
    GearOption,
    MapOption,
    UnitsOption,
    declared_of,
)
from casysid.cli.options import FloatingOption, GravityOption, LockOption, RobotArgument, load_robot


def info(
    robot: RobotArgument,
    log: Annotated[Path | None, typer.Argument(metavar="[LOG]", help="A recording to look into.")] = None,
    units: UnitsOption = None,
    columns: MapOption = None,
    motor_constant: ConstantOption = None,
    gear: GearOption = None,
    efficiency: EfficiencyOption = None,
    gravity: GravityOption = None,
    lock: LockOption = None,
    floating_base: FloatingOption = False,
) -> None:
    """Show what ROBOT and LOG hold: joints, limits, masses, base parameters; rate, ranges, gaps, noise, map of columns.

    LOG alone in the place of ROBOT shows what its columns seem to be.
    """
    from casysid.cli.console import speaking

    with speaking():
        from rich.console import Console
        from rich.text import Text

        from casysid.cli.console import printable, rich_table
        from casysid.recording import draft_map, is_log, open_recording
        from casysid.recording.held_joints import warn_of_held_joints
        from casysid.report.overview import recording_tables, robot_tables

        said = declared_of(units, columns, motor_constant, gear, efficiency)
        if log is None and is_log(Path(robot)):
            print_map(draft_map(Path(robot)), "What the columns seem to be; with ROBOT before LOG it is known")
            return
        model = load_robot(robot, gravity, lock, floating_base)
        console = Console()
        name, source = printable(model.name), printable(str(model.source))
        console.print(Text.assemble((name, "bold"), f"  {source}"), highlight=False)
        tables = robot_tables(model)
        if log is not None:
            recording = open_recording(log, model, said)
            tables += recording_tables(model, recording)
            warn_of_held_joints([log], model)
        for title, table in tables:
            console.print(rich_table(title, table.header, table.rows))
            console.print()
        if log is not None:
            print_map(recording.column_map, "Columns, as --map FILE takes them")


def print_map(text: str, title: str) -> None:
    """A map of columns as it can be copied to a file."""
    from casysid.cli.console import printable

    typer.echo(f"# {title}:")
    typer.echo("\n".join(printable(line) for line in text.splitlines()))

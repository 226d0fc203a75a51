"""``casysid info``: what a robot and a recording hold, before anything is computed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from casysid.cli.options import FloatingOption, GravityOption, LockOption, RobotArgument, load_robot


def info(
    robot: RobotArgument,
    log: Annotated[Path | None, typer.Argument(metavar="[LOG]", help="A recording to look into.")] = None,
    gravity: GravityOption = None,
    lock: LockOption = None,
    floating_base: FloatingOption = False,
) -> None:
    """Show what ROBOT and LOG hold: joints, limits, masses, base parameters; rate, ranges, gaps, noise."""
    from casysid.cli.console import speaking

    with speaking():
        from rich.console import Console
        from rich.text import Text

        from casysid.cli.console import printable, rich_table
        from casysid.recording import open_recording
        from casysid.recording.held_joints import warn_of_held_joints
        from casysid.report.overview import recording_tables, robot_tables

        model = load_robot(robot, gravity, lock, floating_base)
        console = Console()
        name, source = printable(model.name), printable(str(model.source))
        console.print(Text.assemble((name, "bold"), f"  {source}"), highlight=False)
        tables = robot_tables(model)
        if log is not None:
            tables += recording_tables(model, open_recording(log, model))
            warn_of_held_joints([log], model)
        for title, table in tables:
            console.print(rich_table(title, table.header, table.rows))
            console.print()

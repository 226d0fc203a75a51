"""``casysid pose``: where a frame is at given joint positions."""

from __future__ import annotations

from typing import Annotated

import typer

from casysid.cli.options import FloatingOption, LockOption, RobotArgument, load_robot


def pose(
    robot: RobotArgument,
    positions: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[POSITION...]",
            help="Of all joints in the model's order [rad, m], or JOINT=POSITION of some. Default: zeros.",
        ),
    ] = None,
    frame: Annotated[
        str | None, typer.Option(help="Link, site, camera or joint of the file; default: a table of all.")
    ] = None,
    degrees: Annotated[bool, typer.Option("--degrees", help="Angles are given in degrees.")] = False,
    lock: LockOption = None,
    floating_base: FloatingOption = False,
) -> None:
    """Show where a frame of ROBOT is: position, rotation, rank of its Jacobian, manipulability, centre of mass."""
    from casysid.cli.console import rich_table, say, speaking

    with speaking() as voice:
        from rich.console import Console

        from casysid.cli.positions import configuration_from_words
        from casysid.kinematics import Kinematics
        from casysid.report.pose_tables import frame_tables, mass_tables, pose_tables
        from casysid.robot.coordinates import channels_from_configuration

        model = load_robot(robot, None, lock, floating_base)
        kinematics, q = Kinematics(model), configuration_from_words(model, positions or [], degrees=degrees)
        tables = frame_tables(kinematics, q) if frame is None else pose_tables(kinematics, frame, q)
        console = Console()
        for title, table in tables + mass_tables(kinematics, q):
            console.print(rich_table(title, table.header, table.rows))
            console.print()
        channels = channels_from_configuration(model, q[None])[0]
        outside = (channels < model.position_lower) | (channels > model.position_upper)
        for name in (name for name, out in zip(model.channels, outside, strict=True) if out):
            say(voice, f"note: joint {name} is outside its limits")

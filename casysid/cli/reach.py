"""``casysid reach``: joint positions at which a frame is where it should be."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from casysid.cli.options import FloatingOption, LockOption, RobotArgument, load_robot
from casysid.cli.ranges import check_options, checked

if TYPE_CHECKING:
    from casysid.reaching import Target

Triple = tuple[float, float, float]


def reach(
    robot: RobotArgument,
    frame: Annotated[str, typer.Option(help="Link, site, camera or joint of the file.")],
    at: Annotated[Triple | None, typer.Option(metavar="X Y Z", help="Position of its origin in the world [m].")] = None,
    rpy: Annotated[
        Triple | None, typer.Option(metavar="ROLL PITCH YAW", help="Its rotation as URDF has it [rad]; default: any.")
    ] = None,
    look_at: Annotated[
        Triple | None, typer.Option(metavar="X Y Z", help="A point that an axis of the frame points at [m].")
    ] = None,
    axis: Annotated[Triple, typer.Option(metavar="X Y Z", help="That axis; cameras of MJCF look along 0 0 -1.")] = (
        0.0,
        0.0,
        1.0,
    ),
    degrees: Annotated[bool, typer.Option("--degrees", help="Angles are given in degrees.")] = False,
    start: Annotated[
        str | None, typer.Option(metavar="Q1,Q2,...", help="Posture to start from and to stay near [rad, m].")
    ] = None,
    rest: Annotated[
        str | None, typer.Option(metavar="Q1,Q2,...", help="Of all postures that do, one near this [rad, m].")
    ] = None,
    clearance: Annotated[
        float | None, typer.Option(help="Keep links this far from each other and from obstacles [m]; default: no care.")
    ] = None,
    floor: Annotated[float | None, typer.Option(help="Height of a floor to stay above [m].")] = None,
    box: Annotated[
        list[str] | None, typer.Option(metavar="X1,Y1,Z1,X2,Y2,Z2", help="An obstacle [m]. Repeatable.")
    ] = None,
    lock: LockOption = None,
    floating_base: FloatingOption = False,
) -> None:
    """Find joint positions of ROBOT at which a frame has a pose; exit code 1 where none was found."""
    from casysid.cli.console import SOLVER_FAILED, rich_table, say, speaking

    with speaking() as voice:
        from rich.console import Console

        from casysid.cli.excite import obstacles_of
        from casysid.cli.positions import configuration_from_words
        from casysid.reaching import InverseKinematics
        from casysid.report.pose_tables import reach_tables, reach_words

        check_options(floor=floor, clearance=clearance)
        model = load_robot(robot, None, lock, floating_base)
        targets = _targets(frame, at, rpy, look_at, axis, degrees)
        begin, home = (
            None if text is None else configuration_from_words(model, text.split(","), degrees=degrees)
            for text in (start, rest)
        )
        solver, obstacles = InverseKinematics(model), obstacles_of(floor, [], box or [])
        is_free = clearance is None and not obstacles
        if rest is None and is_free:
            answer = solver.reach(*targets, start=begin)
        else:
            answer = solver.reach_clear(
                *targets,
                start=begin,
                rest=home,
                obstacles=obstacles,
                capsules=() if is_free else None,
                margin=clearance or 0.0,
            )
        console = Console()
        for title, table in reach_tables(solver.kinematics, targets, answer):
            console.print(rich_table(title, table.header, table.rows))
            console.print()
        for line in reach_words(answer):
            say(voice, line)
    if not answer.success:
        sys.exit(SOLVER_FAILED)


def _targets(
    frame: str, at: Triple | None, rpy: Triple | None, look_at: Triple | None, axis: Triple, degrees: bool
) -> list[Target]:
    import numpy as np

    from casysid.errors import ParameterError
    from casysid.kinematics import rotation_from_rpy
    from casysid.reaching import LookAt, PoseTarget

    for option, values in (("--at", at), ("--rpy", rpy), ("--look-at", look_at), ("--axis", axis)):
        for value in values or ():
            checked(option, value)
    targets: list[Target] = []
    if at is not None or rpy is not None:
        angles = None if rpy is None else np.deg2rad(rpy) if degrees else np.array(rpy)
        targets.append(
            PoseTarget(
                frame=frame,
                position=None if at is None else np.array(at),
                rotation=None if angles is None else rotation_from_rpy(angles),
            )
        )
    if look_at is not None:
        targets.append(LookAt(frame=frame, point=np.array(look_at), axis=np.array(axis)))
    if not targets:
        raise ParameterError("reach: wanted something to reach: --at X Y Z, --rpy ROLL PITCH YAW or --look-at X Y Z")
    return targets

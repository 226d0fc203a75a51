"""Arguments that several verbs share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from casysid.robot import Robot

RobotArgument = Annotated[
    str, typer.Argument(metavar="ROBOT", help="URDF or MJCF file, or the name of a bundled model.")
]
LogsArgument = Annotated[list[Path], typer.Argument(metavar="LOG...", help="Recordings: CSV, CSV.gz, Parquet or NPZ.")]
GravityOption = Annotated[
    tuple[float, float, float] | None,
    typer.Option("--gravity", metavar="X Y Z", help="Gravity in the base frame [m/s²]; default: the model's."),
]
LockOption = Annotated[
    list[str] | None, typer.Option("--lock", metavar="JOINT=VALUE", help="Hold a joint fixed [rad or m]. Repeatable.")
]
FloatingOption = Annotated[
    bool, typer.Option("--floating-base", help="The base is free to move (six more degrees of freedom).")
]


def load_robot(
    name: str, gravity: tuple[float, float, float] | None, lock: list[str] | None, floating_base: bool
) -> Robot:
    """The robot of the command line's arguments."""
    from casysid.bundled import find_model
    from casysid.robot import Robot

    return Robot.from_file(find_model(name), gravity=gravity, floating_base=floating_base, locked=_locked(lock or []))


def _locked(pairs: list[str]) -> dict[str, float]:
    from casysid.errors import ParameterError

    locked = {}
    for pair in pairs:
        joint, _, value = pair.partition("=")
        try:
            locked[joint] = float(value)
        except ValueError as error:
            raise ParameterError(
                f"--lock wants JOINT=VALUE with a number, such as gripper=0.02; got {pair!r}"
            ) from error
    return locked

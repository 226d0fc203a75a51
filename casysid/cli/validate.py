"""``casysid validate``: a model file's own parameters judged on recordings."""

from __future__ import annotations

import dataclasses
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
from casysid.cli.options import (
    FlipOption,
    FloatingOption,
    GravityOption,
    LockOption,
    LogsArgument,
    RobotArgument,
    load_robot,
)
from casysid.cli.ranges import check_options


def validate(
    robot: RobotArgument,
    logs: LogsArgument,
    result: Annotated[
        Path | None,
        typer.Option(
            "--result",
            metavar="FILE",
            help="A result.json or its folder: its drives, and how it read recordings, which URDF cannot hold.",
        ),
    ] = None,
    flip: FlipOption = None,
    cutoff: Annotated[
        float | None, typer.Option(help="Low-pass cut-off [Hz]; default: the result's, else chosen by the data.")
    ] = None,
    units: UnitsOption = None,
    columns: MapOption = None,
    motor_constant: ConstantOption = None,
    gear: GearOption = None,
    efficiency: EfficiencyOption = None,
    gravity: GravityOption = None,
    lock: LockOption = None,
    floating_base: FloatingOption = False,
    out: Annotated[Path, typer.Option(help="Folder for validation.json.")] = Path("validated"),
) -> None:
    """Predict the torque of recordings by ROBOT's own parameters; nothing is fitted."""
    from casysid.cli.console import progress_bar, rich_table, speaking, tell_path

    with speaking() as console:
        from casysid.identification.output import write_json
        from casysid.outputs import check_run_folder
        from casysid.recording import read_recordings
        from casysid.report.validation_tables import validation_tables
        from casysid.validation import EarlierResult, read_earlier_result
        from casysid.validation import validate as run

        check_options(cutoff=cutoff)
        check_run_folder(out, ["validation.json"])
        said = declared_of(units, columns, motor_constant, gear, efficiency)
        model = load_robot(robot, gravity, lock, floating_base)
        recordings = read_recordings(logs, model, said)
        earlier = read_earlier_result(result) if result else EarlierResult()
        if flip:
            earlier = dataclasses.replace(earlier, flip=tuple(flip))
        with progress_bar(console) as progress:
            validation = run(model, recordings, earlier=earlier, cutoff=cutoff, progress=progress)
        with console.run_folder(out, joining=True) as stage:
            write_json(validation.to_json(), stage.folder / "validation.json")
        for title, table in validation_tables(validation):
            console.print(rich_table(title, table.header, table.rows))
            console.print()
        tell_path(out / "validation.json")

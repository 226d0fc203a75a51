"""``casysid payload``: what a robot holds."""

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
from casysid.cli.options import (
    CutoffOption,
    DelayOption,
    FlipOption,
    FloatingOption,
    FrictionOption,
    FrictionWord,
    GravityOption,
    LockOption,
    RobotArgument,
    TimeScaleOption,
    load_recordings,
    load_robot,
    make_settings,
)

FILES = ("payload.json",)


def payload(
    robot: RobotArgument,
    with_: Annotated[
        list[str],
        typer.Option(
            "--with", metavar="[NAME=]LOG", help="A recording with the payload, of several by NAME. Repeatable."
        ),
    ],
    without: Annotated[
        list[Path] | None,
        typer.Option(
            "--without", metavar="LOG", help="A recording without any; none: the file's links are taken. Repeatable."
        ),
    ] = None,
    link: Annotated[
        str | None, typer.Option(metavar="NAME", help="Link or frame that holds it; default: the last link.")
    ] = None,
    mass: Annotated[
        list[str] | None,
        typer.Option(metavar="[NAME=]KG", help="Its mass, if weighed: the torques' scale follows. Repeatable."),
    ] = None,
    flip: FlipOption = None,
    cutoff: CutoffOption = None,
    time_scale: TimeScaleOption = None,
    delay: DelayOption = "auto",
    friction: FrictionOption = FrictionWord.AUTO,
    units: UnitsOption = None,
    columns: MapOption = None,
    motor_constant: ConstantOption = None,
    gear: GearOption = None,
    efficiency: EfficiencyOption = None,
    gravity: GravityOption = None,
    lock: LockOption = None,
    floating_base: FloatingOption = False,
    out: Annotated[Path, typer.Option(help="Folder for payload.json.")] = Path("payload"),
) -> None:
    """Identify what ROBOT holds, from recordings with it and without: mass, centre of mass, inertia."""
    from casysid.cli.console import progress_bar, rich_table, say, speaking, tell_path

    with speaking() as console:
        from casysid.cli.options import ConsistencyChoice
        from casysid.identification.output import write_json
        from casysid.outputs import check_run_folder
        from casysid.payload import identify_payload
        from casysid.report.payload_tables import payload_tables

        check_run_folder(out, FILES)
        settings = make_settings(
            "empirical-bayes", ConsistencyChoice.FULL, cutoff, None, time_scale, delay, None, friction, flip
        )
        said = declared_of(units, columns, motor_constant, gear, efficiency)
        model = load_robot(robot, gravity, lock, floating_base)
        groups = {name: load_recordings(model, logs, None, None, said)[0] for name, logs in _by_name(with_).items()}
        empty = load_recordings(model, without, None, None, said)[0] if without else ()
        with progress_bar(console) as progress:
            result = identify_payload(
                model,
                groups,
                empty,
                link=link,
                known_mass=_masses(mass or [], list(groups)),
                settings=settings,
                progress=progress,
            )
        with console.run_folder(out, claims=FILES) as stage:
            write_json(result.to_json(), stage.folder / "payload.json")
        for title, table in payload_tables(result):
            console.print(rich_table(title, table.header, table.rows))
            console.print()
        for one in result.payloads:
            if one.torque_scale:
                value, error = one.torque_scale.value, one.torque_scale.std
                say(
                    console,
                    f"the known mass of '{one.name}' says: logged torques are {value:.4g} ± {error:.2g} times the true "
                    f"ones; motor constants times {1.0 / value:.4g} make them right",
                )
        tell_path(out / "payload.json")


def _by_name(given: list[str]) -> dict[str, list[Path]]:
    """Files by the name before their ``=``; a file that is there under the whole text is meant by it."""
    groups: dict[str, list[Path]] = {}
    for text in given:
        name, equals, path = text.partition("=")
        named = bool(equals and name) and not Path(text).exists()
        groups.setdefault(name if named else "payload", []).append(Path(path if named else text))
    return groups


def _masses(given: list[str], names: list[str]) -> dict[str, float]:
    from casysid.cli.ranges import checked
    from casysid.errors import ParameterError

    masses = {}
    for text in given:
        name, equals, value = text.rpartition("=")
        try:
            kilograms = float(value)
        except ValueError as error:
            raise ParameterError(
                f"--mass wants a number of kg, or NAME=KG, such as --mass 1.2 or --mass gripper=0.9; got {text!r}"
            ) from error
        if not equals and len(names) > 1:
            raise ParameterError(
                f"--mass wants NAME=KG where there are several payloads, {', '.join(names)}; got {text!r}"
            )
        masses[name if equals else names[0]] = checked("--mass", kilograms)
    return masses

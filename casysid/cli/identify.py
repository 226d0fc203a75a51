"""``casysid identify``: parameters from recordings."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from casysid.cli.gravity import in_its_gravity, is_auto
from casysid.cli.known_facts import KeepOption, LinkMassOption, TotalMassOption, known_facts
from casysid.cli.log_options import (
    ConstantOption,
    EfficiencyOption,
    GearOption,
    MapOption,
    UnitsOption,
    declared_of,
)
from casysid.cli.options import (
    AccelerationNoiseOption,
    ByOption,
    ConsistencyChoice,
    ConsistencyOption,
    CouplingOption,
    CutoffOption,
    DelayOption,
    FlipOption,
    FloatingOption,
    FoldersArgument,
    FrictionOption,
    FrictionWord,
    GravityOption,
    HeldOutOption,
    LockOption,
    PositionNoiseOption,
    RobotArgument,
    SchedulerOption,
    SplitOption,
    TimeScaleOption,
    VelocityNoiseOption,
    load_recordings,
    load_robot,
    make_settings,
    noise_levels,
)
from casysid.cli.ranges import check_options
from casysid.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

    from casysid.identification import IdentificationResult, Settings
    from casysid.identification.many import Fleet
    from casysid.identification.verdict import Word
    from casysid.recording import Declared
    from casysid.robot import Robot


FILES = (
    *("result.json", "identified.urdf", "identified.xml", "drive.yaml"),
    *("model.json", "model.npz", "moments.npz", "report.html"),
    *("fleet.json", "fleet.csv"),
)
STYLES = {"accepted": "bold green", "doubtful": "bold yellow", "rejected": "bold red"}
SMALLEST_RUN = 2**15
"""Less than any run takes: that of two joints, without a choice of the low-pass, takes 108 kB [bytes]."""


def identify(
    robot: RobotArgument,
    logs: FoldersArgument,
    held_out: HeldOutOption = None,
    split: SplitOption = None,
    scheduler: SchedulerOption = None,
    by: ByOption = None,
    method: Annotated[str, typer.Option(help="Estimator; 'casysid compare' lists them.")] = "empirical-bayes",
    consistency: ConsistencyOption = ConsistencyChoice.FULL,
    flip: FlipOption = None,
    cutoff: CutoffOption = None,
    time_scale: TimeScaleOption = None,
    delay: DelayOption = "auto",
    coupling: CouplingOption = None,
    noise_position: PositionNoiseOption = None,
    noise_velocity: VelocityNoiseOption = None,
    noise_acceleration: AccelerationNoiseOption = None,
    friction: FrictionOption = FrictionWord.AUTO,
    units: UnitsOption = None,
    columns: MapOption = None,
    motor_constant: ConstantOption = None,
    gear: GearOption = None,
    efficiency: EfficiencyOption = None,
    mass_total: TotalMassOption = None,
    mass: LinkMassOption = None,
    keep: KeepOption = None,
    gravity: GravityOption = None,
    lock: LockOption = None,
    floating_base: FloatingOption = False,
    export_inconsistent: Annotated[
        bool, typer.Option("--export-inconsistent", help="Write the model file even if no body can have its inertias.")
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder for result.json, the identified model and report.html.")] = Path(
        "identified"
    ),
) -> None:
    """Identify the inertial and friction parameters of ROBOT from recordings.

    Exit codes: 0 accepted, 3 doubtful (usable for some purposes; reasons are told), 4 rejected; 1 the solver failed,
    2 bad input.
    """
    from casysid.cli.console import SOLVER_FAILED, progress_bar, rich_table, say, speaking, tell_path

    with speaking() as console:
        from casysid.estimation import Status
        from casysid.identification import identify as run
        from casysid.identification.many.output import add_fleet, fleet_rows
        from casysid.identification.output import add_result, identity_of
        from casysid.outputs import check_run_folder
        from casysid.readers.table import holds_logs
        from casysid.report import add_report
        from casysid.report.summary import Origin

        check_run_folder(out, FILES, SMALLEST_RUN)
        noise = noise_levels(noise_position, noise_velocity, noise_acceleration)
        settings = make_settings(method, consistency, cutoff, coupling, time_scale, delay, noise, friction, flip)
        said = declared_of(units, columns, motor_constant, gear, efficiency)
        model = load_robot(robot, None if is_auto(gravity) else gravity, lock, floating_base)
        settings = dataclasses.replace(settings, knowledge=known_facts(model, mass_total, mass, keep))
        many = scheduler is not None or by is not None or any(map(holds_logs, logs))
        fitted, unseen = ([], []) if many else load_recordings(model, logs, held_out, split, said)
        fleet = None
        if is_auto(gravity):
            if many:
                raise ParameterError(
                    "--gravity auto looks at logs named one by one; give the vector for folders of them"
                )
            model, found = in_its_gravity(model, fitted)
            say(console, found)
        with progress_bar(console) as progress:
            if many:
                result, fleet = _run_many(model, logs, settings, held_out, split, said, scheduler, by, progress)
            else:
                result = run(model, fitted, settings, held_out=unseen, progress=progress)
            progress("write", 0.0)
            with console.run_folder(out, identity_of(result), claims=FILES) as stage:
                notes = add_result(result, stage, export_inconsistent=export_inconsistent)
                add_report(
                    result, stage, Origin.of([model.source, *logs, *(held_out or [])], ["casysid", *sys.argv[1:]])
                )
                if fleet is not None:
                    add_fleet(fleet, stage)
        word = tell_result(console, result, notes)
        if fleet is not None:
            console.print(rich_table("Differences between machines", *fleet_rows(fleet)))
        tell_path(out / "result.json")
    sys.exit(word.exit_code if result.status is Status.CONVERGED else SOLVER_FAILED)


def _run_many(
    robot: Robot,
    logs: list[Path],
    settings: Settings,
    held_out: list[Path] | None,
    split: float | None,
    said: Declared,
    scheduler: str | None,
    by: str | None,
    progress: Callable[[str, float], None],
) -> tuple[IdentificationResult, Fleet | None]:
    """The answer of many recordings, and the machines where they are told apart."""
    from casysid.identification.many import identify_fleet, identify_many

    options: dict[str, Any] = dict(
        held_out=held_out or (), split=split, declared=said, scheduler=scheduler, progress=progress
    )
    check_options(split=split)
    if by is None:
        return identify_many(robot, logs, settings, **options), None
    fleet = identify_fleet(robot, logs, by, settings, **options)
    return fleet.pooled, fleet


def tell_result(console: Console, result: IdentificationResult, notes: tuple[str, ...]) -> Word:
    """The tables, the verdict, and what else a person should know."""
    from casysid.cli.console import rich_table, say
    from casysid.identification.verdict import judge
    from casysid.report import drive_table, error_table, further_drive_table, link_table, noise_table

    for title, table in (
        ("Torque error", error_table(result)),
        ("Friction and drive", drive_table(result)),
        ("Beside it", further_drive_table(result)),
        ("Links", link_table(result)),
    ):
        if not table.rows:
            continue
        console.print(rich_table(title, table.header, table.rows))
        console.print()
    if result.choices.equations:
        say(console, result.choices.equations)
    say(console, f"torque delay: {result.delay.reason}")
    if noise := noise_table(result):
        console.print(rich_table("Noise of the measured motion", noise.header, noise.rows))
        console.print()
    verdict = judge(result)
    say(console, verdict.headline, style=STYLES[verdict.headline])
    friction = [one.sentence for one in result.friction.chosen]
    for line in (*verdict.reasons, *verdict.remarks, *friction, *notes):
        say(console, f"  · {line}")
    return verdict.word

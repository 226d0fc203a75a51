"""``casysid identify``: parameters from recordings."""

from __future__ import annotations

import enum
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from casysid.cli.options import FloatingOption, GravityOption, LockOption, LogsArgument, RobotArgument, load_robot

if TYPE_CHECKING:
    from rich.console import Console

    from casysid.identification import IdentificationResult, Settings
    from casysid.recording import Recording
    from casysid.robot import Robot


class ConsistencyChoice(enum.StrEnum):
    """Words of ``--consistency``."""

    NONE = "none"
    INERTIA = "inertia"
    FULL = "full"


def identify(
    robot: RobotArgument,
    logs: LogsArgument,
    held_out: Annotated[
        list[Path] | None,
        typer.Option("--held-out", metavar="LOG", help="A recording to predict, never fitted. Repeatable."),
    ] = None,
    split: Annotated[
        float | None, typer.Option(help="Fit on this first share of each recording's time, hold out the rest.")
    ] = None,
    method: Annotated[str, typer.Option(help="Estimator: ols, wls or ridge.")] = "ridge",
    consistency: Annotated[
        ConsistencyChoice, typer.Option(help="Physical laws that the answer is made to obey.")
    ] = ConsistencyChoice.FULL,
    cutoff: Annotated[float | None, typer.Option(help="Low-pass cut-off [Hz]; default: chosen by the data.")] = None,
    coupling: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT+JOINT", help="A motor that turns with the sum of two joints' motions. Repeatable."),
    ] = None,
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
    """Identify the inertial and friction parameters of ROBOT from recordings."""
    from casysid.cli.console import SOLVER_FAILED, progress_bar, speaking

    with speaking() as console:
        from casysid.estimation import Status
        from casysid.identification import identify as run
        from casysid.identification.output import write_result
        from casysid.report import write_report

        settings = _settings(method, consistency, cutoff, coupling or [])
        model = load_robot(robot, gravity, lock, floating_base)
        fitted, unseen = _read(model, logs, held_out or [], split)
        with progress_bar(console) as progress:
            result = run(model, fitted, settings, held_out=unseen, progress=progress)
            progress("write", 0.0)
            notes = write_result(result, out, export_inconsistent=export_inconsistent)
            write_report(result, out / "report.html")
        _print(console, result, notes)
        typer.echo(str(out / "result.json"))
    if result.status is not Status.CONVERGED:
        sys.exit(SOLVER_FAILED)


def _settings(method: str, consistency: ConsistencyChoice, cutoff: float | None, couplings: list[str]) -> Settings:
    from casysid.dynamics import Coupling
    from casysid.estimation import estimator_by_name
    from casysid.identification import Settings
    from casysid.inertia import Consistency

    return Settings(
        method=estimator_by_name(method),
        consistency=None if consistency is ConsistencyChoice.NONE else Consistency(consistency.value),
        cutoff=cutoff,
        couplings=tuple(
            Coupling(joints=(names := tuple(text.split("+"))), weights=(1.0,) * len(names)) for text in couplings
        ),
    )


def _read(
    robot: Robot, logs: list[Path], held_out: list[Path], split: float | None
) -> tuple[list[Recording], list[Recording]]:
    from casysid.errors import ParameterError
    from casysid.recording import read_recordings

    fitted, unseen = list(read_recordings(logs, robot)), list(read_recordings(held_out, robot))
    if split is None:
        return fitted, unseen
    if not 0.0 < split < 1.0:
        raise ParameterError(f"--split wants a share of time between 0 and 1, such as 0.6; got {split}")
    halves = [recording.split(split) for recording in fitted]
    return [first for first, _ in halves], [second for _, second in halves] + unseen


def _print(console: Console, result: IdentificationResult, notes: tuple[str, ...]) -> None:
    from casysid.cli.console import rich_table
    from casysid.identification.verdict import judge
    from casysid.report import drive_table, error_table, link_table

    for title, table in (
        ("Torque error", error_table(result)),
        ("Friction and drive", drive_table(result)),
        ("Links", link_table(result)),
    ):
        console.print(rich_table(title, table.header, table.rows))
        console.print()
    verdict = judge(result)
    console.print(f"[bold {'green' if verdict.accepted else 'red'}]{verdict.headline}[/]")
    for line in (*verdict.reasons, *verdict.remarks, *notes):
        console.print(f"  · {line}", markup=False, soft_wrap=True)

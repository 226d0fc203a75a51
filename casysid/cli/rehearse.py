"""``casysid rehearse``: the whole experiment in simulation, where the truth is known."""

from __future__ import annotations

import enum
import sys
from pathlib import Path
from typing import Annotated

import typer

from casysid.cli.identify import FILES, SMALLEST_RUN
from casysid.cli.options import FloatingOption, GravityOption, LockOption, RobotArgument, load_robot
from casysid.cli.ranges import check_options, check_samples


class ExcitationChoice(enum.StrEnum):
    """Words of ``--excitation``."""

    SINUSOIDS = "sinusoids"
    DESIGNED = "designed"


def rehearse(
    robot: RobotArgument,
    seed: Annotated[int, typer.Option(help="Of the hidden truth, the motions and the noise.")] = 0,
    duration: Annotated[float, typer.Option(help="Of the recording to fit, and of the one held out [s].")] = 30.0,
    rate: Annotated[float, typer.Option(help="Of controller and log [Hz].")] = 500.0,
    excitation: Annotated[
        ExcitationChoice,
        typer.Option(help="Of the recording to fit: random sinusoids, or the motions that casysid excite designs."),
    ] = ExcitationChoice.SINUSOIDS,
    method: Annotated[str | None, typer.Option(help="Estimator, as in casysid identify.")] = None,
    gravity: GravityOption = None,
    lock: LockOption = None,
    floating_base: FloatingOption = False,
    out: Annotated[Path, typer.Option(help="Folder for rehearsal.json, pictures, report and identified model.")] = Path(
        "rehearsed"
    ),
) -> None:
    """Rehearse the identification of ROBOT on a simulated machine that differs from its file."""
    from casysid.cli.console import SOLVER_FAILED, progress_bar, rich_table, say, speaking, tell_path

    with speaking() as console:
        from casysid.estimation import Status, estimator_by_name
        from casysid.identification import Settings
        from casysid.identification.output import identity_of
        from casysid.outputs import check_run_folder
        from casysid.report import add_report
        from casysid.report.rehearsal_pictures import add_rehearsal_pictures
        from casysid.report.validation_tables import rehearsal_tables
        from casysid.validation import Excitation, RehearsalSettings
        from casysid.validation import rehearse as run
        from casysid.validation.output import add_rehearsal

        check_options(of="rehearse", seed=seed, duration=duration, rate=rate)
        check_samples(duration, rate)
        check_run_folder(out, (*FILES, "rehearsal.json"), SMALLEST_RUN)
        identification = Settings(method=estimator_by_name(method)) if method else Settings()
        settings = RehearsalSettings(
            duration=duration,
            rate=rate,
            seed=seed,
            excitation=Excitation(excitation.value),
            identification=identification,
        )
        model = load_robot(robot, gravity, lock, floating_base)
        with progress_bar(console) as progress:
            rehearsal = run(model, settings, progress)
            progress("write", 0.0)
            with console.run_folder(out, identity_of(rehearsal.result), claims=FILES) as stage:
                notes = add_rehearsal(rehearsal, stage)
                add_report(rehearsal.result, stage)
                pictures = add_rehearsal_pictures(rehearsal, stage)
        for title, table in rehearsal_tables(rehearsal):
            console.print(rich_table(title, table.header, table.rows))
            console.print()
        for line in (*notes, *(f"picture: {path}" for path in pictures)):
            say(console, f"  · {line}")
        tell_path(out / "rehearsal.json")
    if rehearsal.result.status is not Status.CONVERGED:
        sys.exit(SOLVER_FAILED)

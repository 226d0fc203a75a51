"""``casysid run``: an experiment from its file."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer


def run(
    experiment: Annotated[
        Path, typer.Argument(metavar="EXPERIMENT", help="TOML file: robot, recordings with roles, settings, outputs.")
    ],
    out: Annotated[Path | None, typer.Option(help="Folder to write to instead of the file's.")] = None,
) -> None:
    """Carry out the experiment that a TOML file describes; beside the result is the file as it was run.

    Exit codes as of identify.
    """
    from casysid.cli.console import SOLVER_FAILED, progress_bar, rich_table, speaking, tell_path

    with speaking() as console:
        import dataclasses

        from casysid.cli.identify import SMALLEST_RUN, tell_result
        from casysid.estimation import Status
        from casysid.experiment import read_experiment, run_experiment
        from casysid.experiment.running import EXPERIMENT_FILE, FILES
        from casysid.outputs import check_run_folder
        from casysid.report.payload_tables import payload_tables

        asked = read_experiment(experiment)
        if out is not None:
            asked = dataclasses.replace(asked, outputs={**asked.outputs, "folder": str(out.resolve())})
        check_run_folder(asked.outputs["folder"], FILES, SMALLEST_RUN)
        with progress_bar(console) as progress:
            outcome = run_experiment(asked, progress=progress, folder=console.run_folder)
        word = tell_result(console, outcome.result, outcome.notes)
        for title, table in payload_tables(outcome.payloads) if outcome.payloads else []:
            console.print(rich_table(title, table.header, table.rows))
            console.print()
        tell_path(outcome.folder / EXPERIMENT_FILE)
    sys.exit(word.exit_code if outcome.result.status is Status.CONVERGED else SOLVER_FAILED)

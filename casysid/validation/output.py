"""A rehearsal on disk."""

from __future__ import annotations

from pathlib import Path

from casysid.identification.output import add_result, identity_of, write_json
from casysid.outputs import Stage, run_folder
from casysid.validation.rehearsal import Rehearsal


def write_rehearsal(rehearsal: Rehearsal, directory: str | Path) -> tuple[str, ...]:
    """Write ``rehearsal.json`` and all that an ordinary identification writes.

    Returns:
        What a person should know about the identified model, one sentence each.

    Raises:
        OutputError: They cannot be written; the directory is as it was.
    """
    with run_folder(directory, identity_of(rehearsal.result)) as stage:
        return add_rehearsal(rehearsal, stage)


def add_rehearsal(rehearsal: Rehearsal, stage: Stage) -> tuple[str, ...]:
    """Write what :func:`write_rehearsal` writes to where a run's files wait; returns what it returns."""
    notes = add_result(rehearsal.result, stage)
    write_json(rehearsal.to_json(), stage.folder / "rehearsal.json")
    return notes

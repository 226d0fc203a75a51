"""A rehearsal and a validation on disk."""

from __future__ import annotations

from pathlib import Path

from casysid.identification.output import write_json, write_result
from casysid.validation.rehearsal import Rehearsal


def write_rehearsal(rehearsal: Rehearsal, directory: str | Path) -> tuple[str, ...]:
    """Write ``rehearsal.json`` and all that an ordinary identification writes.

    Returns:
        What a person should know about the identified model, one sentence each.
    """
    folder = Path(directory)
    notes = write_result(rehearsal.result, folder)
    write_json(rehearsal.to_json(), folder / "rehearsal.json")
    return notes

"""Names in messages, and tables that are too wide to be a recording."""

from __future__ import annotations

from collections.abc import Sequence

from casysid.errors import RecordingError

MOST_COLUMNS = 10_000
"""A table with more is no recording: 1000 joints (the most of any model here) of 10 quantities each."""
LONGEST_NAME = 80
"""Letters of a column's name that a message shows."""


def listing(names: Sequence[str], most: int = 16) -> str:
    """Names for a message, the first ``most`` of them, long ones cut short."""
    more = f", ... ({len(names)} in all)" if len(names) > most else ""
    shown = (name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 3]}..." for name in names[:most])
    return ", ".join(shown) + more


def refuse_too_many(columns: int, source: str) -> None:
    """Nothing, if a table of so many columns can be a recording.

    Raises:
        RecordingError: It cannot.
    """
    if columns > MOST_COLUMNS:
        raise RecordingError(
            f"{source}: {columns} columns, at most {MOST_COLUMNS} are read; rows are samples, so transpose a matrix "
            "that has them as columns"
        )

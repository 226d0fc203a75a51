"""What the columns of a log seem to be, where no robot is at hand."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from casysid.readers.clock import find_clock
from casysid.readers.mapping import toml
from casysid.readers.table import open_table
from casysid.readers.words import meaning_of, without_unit, words_of

QUANTITIES = ("position", "velocity", "acceleration", "torque", "current")


def draft(path: Path) -> str:
    """The text of a map to edit.

    Raises:
        RecordingError: If the file cannot be read.
    """
    table = open_table(path)
    clock = find_clock(table.names, table.labels.units)
    groups: dict[tuple[str, bool], list[str]] = defaultdict(list)
    for name in table.names:
        found = meaning_of(words_of(without_unit(name)[0]))
        if found is not None and (clock is None or name not in clock.columns):
            groups[found[0].quantity, found[0].commanded].append(name)
    lines = [] if clock is None else [f"time = {toml(clock.columns[0] if len(clock.columns) == 1 else clock.columns)}"]
    for quantity in QUANTITIES:
        measured, commanded = groups[quantity, False], groups[quantity, True]
        word = "# current" if quantity == "current" else quantity
        if measured or commanded:
            lines.append(f"{word} = {toml(measured or commanded)}")
        if measured and commanded:
            lines.append(f"# commanded {quantity} = {toml(commanded)}")
    used = {name for names in groups.values() for name in names} | set(() if clock is None else clock.columns)
    others = [name for name in table.names if name not in used]
    return "\n".join([*lines, *([f"# others: {toml(others)}"] if others else [])]) + "\n"

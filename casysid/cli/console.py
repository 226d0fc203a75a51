"""How the command line speaks: progress, warnings and errors on stderr, exit codes."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable
from rich.text import Text

from casysid.cli.bug_report import INTERNAL_FAULT, describe_fault
from casysid.errors import CasysidError
from casysid.outputs import Stage, run_folder

BAD_INPUT = 2
SOLVER_FAILED = 1
INTERRUPTED = 130


class Voice(Console):
    """A console on stderr that remembers what has been written, for whoever interrupts."""

    def __init__(self) -> None:
        super().__init__(stderr=True)
        self._written: list[Path] = []

    @contextmanager
    def run_folder(self, directory: Path, identity: str = "", **options: Any) -> Iterator[Stage]:
        """As :func:`casysid.outputs.run_folder`; says when it has to wait."""

        def wait(sentence: str) -> None:
            say(self, sentence)

        with run_folder(directory, identity, waiting=wait, written=self.wrote, **options) as stage:
            yield stage

    def wrote(self, place: Path) -> None:
        """Files have been written there."""
        self._written.append(place)

    @property
    def interruption(self) -> str:
        """What is to be said when the run is interrupted."""
        done = f"the files in {self._written[-1]} are complete" if self._written else "nothing was written"
        return f"interrupted; {done}"


@contextmanager
def speaking() -> Iterator[Voice]:
    """A console on stderr; casysid's errors become one message and exit code 2, warnings one line each.

    Ctrl-C ends with exit code 130. What is nobody's bad input is a fault of casysid: exit code 70.
    """
    console = Voice()
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                yield console
            finally:
                _tell_warnings(console, caught)
    except CasysidError as error:
        console.print(Text.assemble(("error:", "bold red"), f" {printable(str(error))}"), soft_wrap=True)
        sys.exit(BAD_INPUT)
    except KeyboardInterrupt:
        say(console, console.interruption)
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        raise
    except Exception as error:
        message = printable(describe_fault(error))
        console.print(Text.assemble(("internal error:", "bold red"), f" {message}"), soft_wrap=True)
        sys.exit(INTERNAL_FAULT)


def tell_path(path: Path) -> None:
    """The path alone on stdout, in the bytes that it has on the disk."""
    import typer

    typer.echo(os.fsencode(path))


@contextmanager
def progress_bar(console: Console) -> Iterator[Callable[[str, float], None]]:
    """A bar that names the stage at work."""
    columns = (
        TextColumn("{task.description:<12}"),
        BarColumn(bar_width=32),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        tasks: dict[str, int] = {}

        def tell(stage: str, share: float) -> None:
            if stage not in tasks:
                for task in tasks.values():
                    bar.update(task, completed=1.0)  # type: ignore[arg-type]
                tasks[stage] = bar.add_task(stage, total=1.0)
            bar.update(tasks[stage], completed=share)  # type: ignore[arg-type]

        yield tell


def rich_table(title: str, header: tuple[str, ...], rows: tuple[tuple[str, ...], ...]) -> RichTable:
    """A table for the terminal: first column to the left, numbers to the right."""
    table = RichTable(
        title=Text(printable(title)),
        title_justify="left",
        title_style="bold",
        header_style="dim",
        box=None,
        pad_edge=False,
    )
    for k, name in enumerate(header):
        table.add_column(Text(printable(name)), justify="left" if k == 0 else "right", no_wrap=k == 0, overflow="fold")
    for row in rows:
        table.add_row(*(Text(printable(cell)) for cell in row))
    return table


def say(console: Console, text: str, *, style: str = "") -> None:
    """A line, whatever names are in it."""
    console.print(Text(printable(text), style), soft_wrap=True)


def _tell_warnings(console: Console, caught: list[warnings.WarningMessage]) -> None:
    for text in dict.fromkeys(str(one.message) for one in caught):
        console.print(Text.assemble(("warning:", "yellow"), f" {printable(text)}"), soft_wrap=True)


def printable(text: str) -> str:
    """Text as a terminal may be sent it: names from files and of files cannot colour it, move about or break it."""
    return "".join(
        letter if letter.isprintable() or letter == "\n" else letter.encode("unicode_escape", "replace").decode()
        for letter in text
    )

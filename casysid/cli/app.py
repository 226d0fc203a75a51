"""The ``casysid`` command and its verbs."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from casysid.cli.bug_report import INTERNAL_FAULT, describe_fault
from casysid.cli.compare import compare
from casysid.cli.excite import excite
from casysid.cli.gravity import CommandWithGravity
from casysid.cli.identify import identify
from casysid.cli.info import info
from casysid.cli.payload import payload
from casysid.cli.pose import pose
from casysid.cli.reach import reach
from casysid.cli.rehearse import rehearse
from casysid.cli.run import run
from casysid.cli.validate import validate

app = typer.Typer(
    name="casysid",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    help=(
        "Identify robot dynamics: from a URDF or MJCF and a log of joint positions and torques to a model "
        "a controller can trust."
    ),
    epilog="Exit codes: 0 done, 1 a solver failed but the result was written, 2 bad input or no place to write to, "
    "3 what was identified is doubtful, 4 it is rejected, 70 a fault of casysid, 130 interrupted.",
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from casysid import __version__

        typer.echo(f"casysid {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


app.command(
    cls=CommandWithGravity,
    epilog="Examples: casysid identify arm.urdf excite.csv --split 0.6 --out identified  ·  "
    "casysid identify arm.xml run1.csv run2.parquet --held-out run3.csv",
)(identify)
app.command(epilog="Example: casysid compare arm.urdf excite.csv --split 0.6 --methods wls,ridge,lasso")(compare)
app.command(
    epilog="Examples: casysid excite arm.urdf --out excite  ·  casysid excite head --out next --log earlier.csv"
)(excite)
app.command(
    epilog="Examples: casysid payload arm.urdf --without empty.csv --with gripper.csv  ·  "
    "casysid payload arm.urdf --without empty.csv --with box=a.csv --with tool=b.csv --mass tool=1.2"
)(payload)
app.command(epilog="Examples: casysid rehearse head  ·  casysid rehearse arm.urdf --duration 20 --out rehearsal")(
    rehearse
)
app.command(epilog="Example: casysid run experiment.toml  ·  casysid run run/experiment.toml --out again")(run)
app.command(epilog="Example: casysid validate identified/identified.urdf other.csv")(validate)
app.command(epilog="Examples: casysid info arm.urdf  ·  casysid info arm.urdf excite.csv.gz")(info)
app.command(
    context_settings={"ignore_unknown_options": True},  # negative positions look like options
    epilog="Examples: casysid pose arm.urdf --frame tool 0.1 -0.5 0.3  ·  casysid pose arm.urdf elbow=-0.5",
)(pose)
app.command(
    epilog="Examples: casysid reach arm.urdf --frame tool --at 0.4 0 0.3  ·  casysid reach arm.urdf --frame tool "
    "--at 0.4 0 0.3 --rpy 0 1.57 0 --clearance 0.01 --floor 0"
)(reach)


def main() -> None:
    """Run the command line.

    A fault outside of the verbs, which see to their own, ends in one message and exit code 70 as well.
    """
    try:
        app()
    except Exception as error:
        print(f"internal error: {describe_fault(error)}", file=sys.stderr)
        sys.exit(INTERNAL_FAULT)

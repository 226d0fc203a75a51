"""``casysid compare``: every estimator side by side on one pass over the data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from casysid.cli.log_options import (
    ConstantOption,
    EfficiencyOption,
    GearOption,
    MapOption,
    UnitsOption,
    declared_of,
)
from casysid.cli.options import (
    ConsistencyChoice,
    ConsistencyOption,
    CouplingOption,
    CutoffOption,
    DelayOption,
    FlipOption,
    FloatingOption,
    FrictionOption,
    FrictionWord,
    GravityOption,
    HeldOutOption,
    LockOption,
    LogsArgument,
    RobotArgument,
    SplitOption,
    TimeScaleOption,
    load_recordings,
    load_robot,
    make_settings,
)

if TYPE_CHECKING:
    from casysid.identification import Comparison
    from casysid.report import Table


def compare(
    robot: RobotArgument,
    logs: LogsArgument,
    held_out: HeldOutOption = None,
    split: SplitOption = None,
    methods: Annotated[str, typer.Option(help="Names with commas between them, or all.")] = "all",
    consistency: ConsistencyOption = ConsistencyChoice.FULL,
    flip: FlipOption = None,
    cutoff: CutoffOption = None,
    time_scale: TimeScaleOption = None,
    delay: DelayOption = "auto",
    coupling: CouplingOption = None,
    friction: FrictionOption = FrictionWord.AUTO,
    units: UnitsOption = None,
    columns: MapOption = None,
    motor_constant: ConstantOption = None,
    gear: GearOption = None,
    efficiency: EfficiencyOption = None,
    gravity: GravityOption = None,
    lock: LockOption = None,
    floating_base: FloatingOption = False,
    out: Annotated[Path | None, typer.Option(help="Write the figures to this JSON file.")] = None,
) -> None:
    """Compare every estimator on the same recordings of ROBOT."""
    from casysid.cli.console import progress_bar, speaking, tell_path

    with speaking() as console:
        from rich.console import Console

        from casysid.cli.console import rich_table, say
        from casysid.estimation import ESTIMATORS, estimator_by_name
        from casysid.identification import compare as run
        from casysid.identification import prepare
        from casysid.identification.output import write_json
        from casysid.outputs import check_output_file

        if out is not None:
            check_output_file(out)
        names = [kind.name for kind in ESTIMATORS] if methods == "all" else methods.split(",")
        estimators = [estimator_by_name(name) for name in names]
        settings = make_settings(
            "empirical-bayes", consistency, cutoff, coupling, time_scale, delay, friction=friction, flip=flip
        )
        said = declared_of(units, columns, motor_constant, gear, efficiency)
        model = load_robot(robot, gravity, lock, floating_base)
        fitted, unseen = load_recordings(model, logs, held_out, split, said)
        with progress_bar(console) as progress:
            noise_too = any(one.needs_input_noise for one in estimators)
            preparation = prepare(model, fitted, settings, held_out=unseen, noise_too=noise_too, progress=progress)
            comparison = run(preparation, estimators, settings, progress=progress)
        table = comparison_table(comparison)
        Console().print(rich_table("Torque error, best first", table.header, table.rows))
        say(console, f"torque delay: {preparation.choices.delay.reason}")
        for name, reason in comparison.failures.items():
            say(console, f"{name} failed: {reason}")
        if out is not None:
            write_json(comparison.to_json(), out)
            console.wrote(out)
            tell_path(out)


def comparison_table(comparison: Comparison) -> Table:
    """One row a method."""
    from casysid.report.tables import Table, number, percent

    rows = []
    for name in comparison.ranked():
        result = comparison.results[name]
        error = result.held_out or result.train
        rows.append(
            (
                name,
                percent(result.train.relative),
                percent(result.held_out.relative if result.held_out else None),
                percent(result.unconstrained.relative),
                "yes" if result.is_physically_consistent else "no",
                str(result.estimate.rank),
                number(result.seconds["estimate"] + result.seconds["projection"], 2),
                *(percent(float(value)) for value in error.relative_by_joint),
            )
        )
    dofs = next(iter(comparison.results.values())).robot.dofs if comparison.results else ()
    header = ("method", "fitted", "held out", "unconstrained", "consistent", "rank", "seconds", *dofs)
    return Table(header, tuple(rows))

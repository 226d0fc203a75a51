"""``casysid excite``: the motion to record."""

from __future__ import annotations

import enum
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from casysid.cli.log_options import (
    ConstantOption,
    EfficiencyOption,
    GearOption,
    MapOption,
    UnitsOption,
    declared_of,
)
from casysid.cli.options import GravityOption, LockOption, RobotArgument, load_robot
from casysid.cli.ranges import check_options, check_samples, numbers

if TYPE_CHECKING:
    from collections.abc import Callable

    from casysid.excitation import (
        Box,
        ExcitationDesign,
        ExcitationProblem,
        FourierSeries,
        HalfSpace,
        JointLimits,
        KeepInConstraint,
        PlayedMotion,
    )
    from casysid.excitation.design.result import Progress
    from casysid.outputs import Stage
    from casysid.recording import Declared
    from casysid.robot import Robot


class CriterionChoice(enum.StrEnum):
    """Words of ``--criterion``."""

    BALANCED = "balanced"
    D = "d"
    CONDITION = "condition"
    TORQUE = "torque"


def excite(
    robot: RobotArgument,
    log: Annotated[
        list[Path] | None,
        typer.Option(
            "--log",
            metavar="LOG",
            help="An earlier recording, or result.json of an identification: design for what it does not tell. "
            "Repeatable.",
        ),
    ] = None,
    period: Annotated[float | None, typer.Option(help="Of the motion [s]; default: from the limits.")] = None,
    harmonics: Annotated[int | None, typer.Option(help="Of the base frequency; default: 5.")] = None,
    periods: Annotated[int, typer.Option(help="How often the motion is repeated.")] = 1,
    count: Annotated[int, typer.Option(help="So many motions that complement each other.")] = 1,
    rate: Annotated[float, typer.Option(help="Samples per second [Hz].")] = 500.0,
    criterion: Annotated[
        CriterionChoice,
        typer.Option(
            help="d: confidence volume; condition: condition number; balanced: mostly the first, a little the second; "
            "torque: accuracy of predicted torque."
        ),
    ] = CriterionChoice.BALANCED,
    acceleration: Annotated[float | None, typer.Option(help="Largest acceleration [rad/s², m/s²].")] = None,
    jerk: Annotated[float | None, typer.Option(help="Largest jerk [rad/s³, m/s³].")] = None,
    velocity_share: Annotated[float, typer.Option(help="Share of the velocity limits to use.")] = 0.9,
    torque_share: Annotated[float, typer.Option(help="Share of the effort limits to use.")] = 0.7,
    clearance: Annotated[float, typer.Option(help="Distance to keep between links and to the floor [m].")] = 0.01,
    floor: Annotated[
        str,
        typer.Option(
            metavar="mount|none|Z",
            help="Floor to stay above: what the base stands on, none, or one at a height [m].",
        ),
    ] = "mount",
    box: Annotated[
        list[str] | None, typer.Option(metavar="X,Y,Z,X,Y,Z", help="Corners of an obstacle [m]. Repeatable.")
    ] = None,
    wall: Annotated[
        list[str] | None,
        typer.Option(metavar="NX,NY,NZ,D", help="Stay where n·x >= d; n points away from the wall. Repeatable."),
    ] = None,
    keep_in: Annotated[
        list[str] | None,
        typer.Option("--keep-in", metavar="LINK=X,Y,Z,X,Y,Z", help="Box in which a link's frame stays. Repeatable."),
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="Q1,Q2,...", help="Positions to start from [rad, m]; default: free.")
    ] = None,
    present: Annotated[
        str | None,
        typer.Option(
            "--from", metavar="Q1,Q2,...", help="Where the robot is [rad, m]: adds the way to the start, and back."
        ),
    ] = None,
    speed: Annotated[float, typer.Option(help="Play the same path at this share of its speed, for a first try.")] = 1.0,
    starts: Annotated[int, typer.Option(help="Starts of the search.")] = 4,
    seed: Annotated[int, typer.Option(help="Of the random starts.")] = 0,
    units: UnitsOption = None,
    columns: MapOption = None,
    motor_constant: ConstantOption = None,
    gear: GearOption = None,
    efficiency: EfficiencyOption = None,
    gravity: GravityOption = None,
    lock: LockOption = None,
    out: Annotated[
        Path, typer.Option(help="Folder for excitation.csv, its coefficients, a ROS message, pictures.")
    ] = Path("excitation"),
) -> None:
    """Design the motion of ROBOT that tells most about its parameters, within all limits."""
    from casysid.cli.console import SOLVER_FAILED, progress_bar, say, speaking, tell_path

    with speaking() as console:
        from casysid.excitation import DesignStatus, build_excitation, design_set, limits_of
        from casysid.excitation.playing.files import add_excitation, identity_of
        from casysid.outputs import check_run_folder
        from casysid.report.excitation_pictures import add_excitation_pictures
        from casysid.report.excitation_preview import add_excitation_preview

        check_options(period=period, harmonics=harmonics, periods=periods, count=count, rate=rate, starts=starts)
        height = _floor(floor)
        check_options(acceleration=acceleration, jerk=jerk, clearance=clearance, seed=seed, speed=speed)
        check_options(velocity_share=velocity_share, torque_share=torque_share)
        check_run_folder(out, ["excitation.csv", "excitation.json", "joint_trajectory.yaml", "excitation.txt"])
        said = declared_of(units, columns, motor_constant, gear, efficiency)
        model = load_robot(robot, gravity, lock, floating_base=False)
        limits = limits_of(
            model,
            velocity_share=velocity_share,
            torque_share=torque_share,
            acceleration=float("inf") if acceleration is None else acceleration,
            jerk=float("inf") if jerk is None else jerk,
        )
        series = _series(limits, rate, period, harmonics)
        check_samples(periods * series.period, rate)
        problem = build_excitation(
            model,
            series=series,
            periods=periods,
            rate=rate,
            limits=limits,
            clearance=clearance,
            obstacles=obstacles_of(None, wall or [], box or []),
            floor=height,
            keep_in=_keep_in(model, keep_in or []),
            start=None if start is None else numbers("--start", start, model.nv),
        )
        problem = _informed(model, problem, criterion, log or [], said)
        with progress_bar(console) as progress:
            designs = design_set(problem, count, starts=starts, seed=seed, progress=_watch(progress))
            if any(design.status is DesignStatus.INTERRUPTED for design in designs):
                raise KeyboardInterrupt
            progress("write", 0.0)
            designs = tuple(design.at_speed(speed) for design in designs)
            whole = [_played(design, present, speed) for design in designs]
            with console.run_folder(out, identity_of(designs[0], whole[0])) as stage:
                stages = _stages(stage, len(designs))
                for design, played, own in zip(designs, whole, stages, strict=True):
                    add_excitation(design, own, played=played)
                    add_excitation_pictures(design, own)
                    add_excitation_preview(design, own, played=played)
        for own in stages:
            for line in (own.home / "excitation.txt").read_text(encoding="utf-8").splitlines():
                say(console, f"  · {line}")
            tell_path(own.home / "excitation.csv")
    if any(design.status is not DesignStatus.CONVERGED for design in designs):
        sys.exit(SOLVER_FAILED)


def _series(limits: JointLimits, rate: float, period: float | None, harmonics: int | None) -> FourierSeries:
    from casysid.excitation import FourierSeries, choose_series

    usual = choose_series(limits, rate)
    return FourierSeries(
        usual.period if period is None else period, usual.harmonics if harmonics is None else harmonics
    )


def obstacles_of(floor: float | None, walls: list[str], boxes: list[str]) -> list[HalfSpace | Box]:
    """What stands around the robot, from the command line's words."""
    import numpy as np

    from casysid.excitation import Box, HalfSpace

    found: list[HalfSpace | Box] = []
    if floor is not None:
        found.append(HalfSpace("floor", np.array([0.0, 0.0, 1.0]), floor))
    for k, text in enumerate(walls, 1):
        *normal, offset = numbers("--wall", text, 4)
        found.append(HalfSpace(f"wall {k}", np.array(normal), offset))
    for k, text in enumerate(boxes, 1):
        corners = np.array(numbers("--box", text, 6)).reshape(2, 3)
        found.append(Box(f"box {k}", corners.min(axis=0), corners.max(axis=0)))
    return found


def _keep_in(robot: Robot, texts: list[str]) -> list[KeepInConstraint]:
    from casysid.excitation import keep_in

    found = []
    for text in texts:
        link, _, words = text.rpartition("=")
        corners = numbers("--keep-in", words, 6)
        found.append(keep_in(robot, link, corners[:3], corners[3:]))
    return found


def _informed(
    robot: Robot, problem: ExcitationProblem, choice: CriterionChoice, logs: list[Path], declared: Declared
) -> ExcitationProblem:
    """The problem with the criterion chosen and what the logs tell."""
    from casysid.excitation import ConditionNumber, DOptimal, after_recordings, after_result, torque_accuracy
    from casysid.recording import read_recordings

    if choice is CriterionChoice.CONDITION:
        problem = problem.judged_by(ConditionNumber())
    elif choice is CriterionChoice.D:
        problem = problem.judged_by(DOptimal())
    elif choice is CriterionChoice.TORQUE:
        problem = problem.judged_by(torque_accuracy(problem))
    results = [path for path in logs if path.suffix == ".json" or path.is_dir()]
    recordings = [path for path in logs if path not in results]
    for path in results:
        problem = after_result(problem, path)
    return after_recordings(problem, read_recordings(recordings, robot, declared)) if recordings else problem


def _floor(text: str) -> float | Literal["mount"] | None:
    """What ``--floor`` says."""
    if text == "mount":
        return "mount"
    return None if text == "none" else numbers("--floor", text, 1)[0]


def _played(design: ExcitationDesign, present: str | None, speed: float) -> PlayedMotion:
    """The motion, with the way to it where it is said where the robot is."""
    from casysid.excitation import PlayedMotion, find_way

    if present is None:
        return PlayedMotion(design.trajectory)
    here = numbers("--from", present, design.problem.robot.nv)
    return PlayedMotion(design.trajectory, find_way(design.problem, here, design.trajectory.start, speed=speed))


def _watch(progress: Callable[[str, float], None]) -> Progress:
    from casysid.excitation import DesignStep

    def tell(step: DesignStep) -> None:
        progress("design", min(1.0, (step.start + min(step.step / 100.0, 1.0)) / (step.starts + 2)))

    return tell


def _stages(stage: Stage, count: int) -> list[Stage]:
    return [stage] if count == 1 else [stage.within(f"trajectory_{k + 1}") for k in range(count)]

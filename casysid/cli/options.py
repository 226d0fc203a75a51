"""Arguments that several verbs share, and what they stand for."""

from __future__ import annotations

import enum
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from casysid.cli.ranges import check_options, checked, numbers

if TYPE_CHECKING:
    from casysid.identification import Settings
    from casysid.recording import Declared, Source
    from casysid.robot import Robot
    from casysid.signals import NoiseLevels


class ConsistencyChoice(enum.StrEnum):
    """Words of ``--consistency``."""

    NONE = "none"
    INERTIA = "inertia"
    FULL = "full"


class FrictionWord(enum.StrEnum):
    """Words of ``--friction``."""

    PLAIN = "plain"
    AUTO = "auto"


RobotArgument = Annotated[str, typer.Argument(metavar="ROBOT", help="URDF or MJCF file, or a bundled model's name.")]
LogsArgument = Annotated[
    list[Path], typer.Argument(metavar="LOG...", help="Recordings: text, Parquet, NPZ, bags and more; see README.")
]
FoldersArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG...", help="Recordings, or folders of them: text, Parquet, NPZ, bags and more; see README."
    ),
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        metavar="local|ADDRESS",
        help="Spread many recordings over processes here, or over a Dask cluster; for a folder of logs: local.",
    ),
]
ByOption = Annotated[
    str | None,
    typer.Option(
        metavar="COLUMN|recording",
        help="One model for each machine, named by a column that is constant in each log, or for each recording.",
    ),
]
HeldOutOption = Annotated[
    list[Path] | None,
    typer.Option("--held-out", metavar="LOG", help="A recording to predict, never fitted. Repeatable."),
]
SplitOption = Annotated[
    float | None, typer.Option(help="Fit on this first share of each recording's time, hold out the rest.")
]
ConsistencyOption = Annotated[ConsistencyChoice, typer.Option(help="Physical laws that the answer is made to obey.")]
FlipOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="COLUMN", help="Turn a sign: tau_JOINT, q_JOINT, JOINT for both, tau for all torques. Repeatable."
    ),
]
CutoffOption = Annotated[float | None, typer.Option(help="Low-pass cut-off [Hz]; default: chosen by the data.")]
TimeScaleOption = Annotated[
    float | None,
    typer.Option(help="Time stamps times this are seconds; default: as logged, unless inertial torques contradict it."),
]
DelayOption = Annotated[
    str,
    typer.Option(
        metavar="auto|SECONDS", help="How late the torque's time stamps are; auto: found in the data. 0 for none."
    ),
]
CouplingOption = Annotated[
    list[str] | None,
    typer.Option(metavar="JOINT+JOINT", help="A motor that turns with the sum of two joints' motions. Repeatable."),
]
PositionNoiseOption = Annotated[
    str | None,
    typer.Option(
        "--noise-position", metavar="STD[,STD...]", help="Of the positions' sensors [rad, m]; default: from the data."
    ),
]
VelocityNoiseOption = Annotated[
    str | None,
    typer.Option(
        "--noise-velocity", metavar="STD[,STD...]", help="Of velocities taken as logged, without time [rad/s, m/s]."
    ),
]
AccelerationNoiseOption = Annotated[
    str | None,
    typer.Option("--noise-acceleration", metavar="STD[,STD...]", help="Of accelerations likewise [rad/s², m/s²]."),
]
FrictionOption = Annotated[
    FrictionWord,
    typer.Option(
        help="plain: viscous, Coulomb, offset and armature; auto: what else the data ask for, joint by joint."
    ),
]
GravityOption = Annotated[
    tuple[float, float, float] | None,
    typer.Option(
        "--gravity",
        metavar="X Y Z",
        help="Gravity in the base frame [m/s²]; default: the model's. identify takes auto too: what the log asks for.",
    ),
]
AUTO = "auto"
"""In place of a joint to hold."""
LockOption = Annotated[
    list[str] | None,
    typer.Option(
        "--lock",
        metavar="JOINT=VALUE|auto",
        help="Hold a joint fixed [rad or m]; auto: those that follow others (mimic). Repeatable.",
    ),
]
FloatingOption = Annotated[
    bool, typer.Option("--floating-base", help="The base is free to move (six more degrees of freedom).")
]


def load_robot(
    name: str, gravity: tuple[float, float, float] | None, lock: list[str] | None, floating_base: bool
) -> Robot:
    """The robot of the command line's arguments."""
    from casysid.bundled import find_model
    from casysid.robot import Robot

    for value in gravity or ():
        checked("--gravity", value)
    path = find_model(name)
    locked = _locked([pair for pair in lock or [] if pair != AUTO])
    if AUTO in (lock or []):
        locked |= _following(path, locked)
    return Robot.from_file(path, gravity=gravity, floating_base=floating_base, locked=locked)


def load_recordings(
    robot: Robot, logs: list[Path], held_out: list[Path] | None, split: float | None, declared: Declared
) -> tuple[list[Source], list[Source]]:
    """The fitted and the held-out recordings."""
    from casysid.identification.passes import is_long
    from casysid.recording import Source, open_recordings
    from casysid.recording.held_joints import warn_of_held_joints

    check_options(split=split)
    fitted, unseen = list[Source](), list[Source]()
    for files, several in ((logs, fitted), (held_out or [], unseen)):
        opened = open_recordings(files, robot, declared)
        several += opened if is_long(opened) else [one.in_memory() for one in opened]
        warn_of_held_joints(files, robot)
    if split is None:
        return fitted, unseen
    halves = [recording.split(split) for recording in fitted]
    return [first for first, _ in halves], [second for _, second in halves] + unseen


def noise_levels(position: str | None, velocity: str | None, acceleration: str | None) -> NoiseLevels:
    """Sensors' noise from the command line's words: one number for all, or one for each separated by commas."""
    from casysid.signals import NoiseLevels

    return NoiseLevels(
        position=_noise("--noise-position", position),
        velocity=_noise("--noise-velocity", velocity),
        acceleration=_noise("--noise-acceleration", acceleration),
    )


def _noise(option: str, text: str | None) -> float | tuple[float, ...] | None:
    if text is None:
        return None
    values = numbers(option, text)
    return values[0] if len(values) == 1 else values


def make_settings(
    method: str,
    consistency: ConsistencyChoice,
    cutoff: float | None,
    couplings: list[str] | None,
    time_scale: float | None = None,
    delay: str = "auto",
    input_noise: NoiseLevels | None = None,
    friction: FrictionWord = FrictionWord.AUTO,
    flip: list[str] | None = None,
) -> Settings:
    """Settings from the command line's words."""
    from casysid.dynamics import Coupling
    from casysid.estimation import estimator_by_name
    from casysid.identification import Settings
    from casysid.inertia import Consistency
    from casysid.signals import NoiseLevels

    check_options(cutoff=cutoff, time_scale=time_scale)
    pairs = [tuple(text.split("+")) for text in couplings or []]
    return Settings(
        method=estimator_by_name(method),
        consistency=None if consistency is ConsistencyChoice.NONE else Consistency(consistency.value),
        flip=tuple(flip or ()),
        cutoff=cutoff,
        time_scale=time_scale,
        delay=_seconds(delay),
        input_noise=input_noise or NoiseLevels(),
        choose_friction=friction is FrictionWord.AUTO,
        couplings=tuple(Coupling(joints=joints, weights=(1.0,) * len(joints)) for joints in pairs),
    )


def _seconds(delay: str) -> float | None:
    from casysid.errors import ParameterError

    try:
        seconds = None if delay == "auto" else float(delay)
    except ValueError as error:
        raise ParameterError(f"--delay wants auto or a number of seconds, such as 0.005; got {delay!r}") from error
    return None if seconds is None else checked("--delay", seconds)


def _following(path: Path, locked: dict[str, float]) -> dict[str, float]:
    """Where joints that follow others are held, which is said."""
    from casysid.errors import CasysidWarning
    from casysid.robot.following import following_joints
    from casysid.robot.locking import lock_words

    found = following_joints(path, locked)
    if found:
        warnings.warn(
            f"{path}: joints that follow others are held: {lock_words(found)}. Where those move, what these carry is "
            "told where it is not",
            CasysidWarning,
            stacklevel=3,
        )
    return found


def _locked(pairs: list[str]) -> dict[str, float]:
    from casysid.errors import ParameterError

    locked = {}
    for pair in pairs:
        joint, _, value = pair.partition("=")
        try:
            position = float(value)
        except ValueError as error:
            raise ParameterError(
                f"--lock wants auto, or JOINT=VALUE with a number, such as gripper=0.02; got {pair!r}"
            ) from error
        locked[joint] = checked("--lock", position)
    return locked

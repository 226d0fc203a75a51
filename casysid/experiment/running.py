"""Carry an experiment out, and write down what it was carried out with."""

from __future__ import annotations

import hashlib
import platform
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from casysid.dynamics import Coupling
from casysid.errors import CasysidWarning, RecordingError
from casysid.estimation import estimator_by_name
from casysid.experiment.description import FIT, HELD_OUT, Experiment
from casysid.identification import IdentificationResult, Settings, identify
from casysid.identification.output import add_result, identity_of, write_json
from casysid.identification.passes import is_long
from casysid.inertia import Consistency
from casysid.model.c_code import c_files
from casysid.outputs import Stage, run_folder
from casysid.payload import PayloadResult, identify_payload
from casysid.recording import Declared, Source, open_recordings, parse_drive, parse_units, read_map
from casysid.report import add_report
from casysid.report.summary import Origin
from casysid.robot import Robot
from casysid.signals import NoiseLevels
from casysid.threads import single_threaded

EXPERIMENT_FILE, PAYLOAD_FILE = "experiment.toml", "payload.json"
FILES = (
    *("result.json", "identified.urdf", "identified.xml", "drive.yaml", "model.json", "model.npz", "moments.npz"),
    *("report.html", EXPERIMENT_FILE, PAYLOAD_FILE),
)
"""What belongs to a run, whether it has a file of that name or not."""
PACKAGES = ("numpy", "scipy", "casadi", "pin", "clarabel", "scikit-learn", "pyarrow")
"""Those whose versions can move a number."""
Progress = Callable[[str, float], None]
Folder = Callable[..., AbstractContextManager[Stage]]


def silent(stage: str, share: float) -> None:
    """No progress."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What an experiment gave.

    Attributes:
        result: Of the identification.
        payloads: What was held, if the experiment has recordings with something.
        folder: Where all of it was written.
        notes: What a person should know about the written model.
    """

    result: IdentificationResult
    payloads: PayloadResult | None
    folder: Path
    notes: tuple[str, ...]


@single_threaded()
def run_experiment(experiment: Experiment, *, progress: Progress = silent, folder: Folder = run_folder) -> Outcome:
    """Identify, find payloads, and write everything into the experiment's folder at once.

    Beside the results is ``experiment.toml``: the experiment with nothing left open, versions of the packages, and
    SHA-256 of the inputs. Inputs that are no longer what such a file says are warned of.

    Args:
        experiment: What to do.
        progress: Called with the stage and the share done.
        folder: Opens the output folder, as :func:`casysid.outputs.run_folder` does.

    Raises:
        RobotError: The robot's file cannot be used.
        RecordingError: A recording cannot be used.
        OutputError: The files cannot be written; the folder is as it was.
        SolverError: No consistent parameters could be found.
    """
    digests = {str(path): _digest(path) for path in experiment.inputs}
    for path, digest in experiment.sha256.items():
        if digests.get(path, digest) != digest:
            warnings.warn(f"{path} is not the file that the experiment was run with", CasysidWarning, stacklevel=2)
    settings = settings_of(experiment.settings)
    asked = experiment.robot
    robot = Robot.from_file(
        asked["file"], gravity=asked["gravity"], floating_base=asked["floating_base"], locked=asked["lock"]
    )
    said = declared_of(experiment.log)
    fitted, unseen = (_opened(experiment.of_role(role), robot, said) for role in (FIT, HELD_OUT))
    if experiment.settings["split"] is not None:
        halves = [one.split(experiment.settings["split"]) for one in fitted]
        fitted, unseen = [first for first, _ in halves], [second for _, second in halves] + unseen
    groups = {name: _opened(files, robot, said) for name, files in experiment.payloads().items()}
    result = identify(robot, fitted, settings, held_out=unseen, progress=progress)
    payloads = _payloads(experiment, robot, groups, fitted, settings, progress)
    progress("write", 0.0)
    outputs = experiment.outputs
    text = experiment.to_toml(_versions(), digests)
    with folder(Path(outputs["folder"]), identity_of(result), claims=FILES) as stage:
        notes = add_result(result, stage, export_inconsistent=outputs["export_inconsistent"])
        if outputs["report"]:
            add_report(result, stage, Origin(f"casysid run {EXPERIMENT_FILE}", digests))
        if payloads is not None:
            write_json(payloads.to_json(), stage.folder / PAYLOAD_FILE)
        if outputs["c_code"]:
            inner = stage.within("c").folder
            for name, content in c_files(result.model).items():
                (inner / name).write_text(content, encoding="utf-8")
        (stage.folder / EXPERIMENT_FILE).write_text(text, encoding="utf-8")
    return Outcome(result, payloads, Path(outputs["folder"]), notes)


def settings_of(table: Mapping[str, Any]) -> Settings:
    """The settings of an experiment's table."""
    pairs = [tuple(text.split("+")) for text in table["coupling"]]
    noise = {name: _noise(table[f"noise_{name}"]) for name in ("position", "velocity", "acceleration")}
    return Settings(
        method=estimator_by_name(table["method"]),
        consistency=None if table["consistency"] == "none" else Consistency(table["consistency"]),
        flip=tuple(table["flip"]),
        cutoff=table["cutoff"],
        time_scale=table["time_scale"],
        delay=table["delay"],
        input_noise=NoiseLevels(**noise),
        choose_friction=table["friction"] == "auto",
        couplings=tuple(Coupling(joints=joints, weights=(1.0,) * len(joints)) for joints in pairs),
    )


def declared_of(table: Mapping[str, Any]) -> Declared:
    """What an experiment's table says of the recordings' columns; the table comes before the map's file."""
    said = Declared(
        units=parse_units(table["units"]),
        motor_constant=parse_drive("motor_constant", "constant", table["motor_constant"]),
        gear=parse_drive("gear", "gear", table["gear"]),
        efficiency=parse_drive("efficiency", "efficiency", table["efficiency"]),
    )
    return said if table["map"] is None else said.over(read_map(Path(table["map"])))


def _noise(levels: Sequence[float] | None) -> float | tuple[float, ...] | None:
    if levels is None:
        return None
    return levels[0] if len(levels) == 1 else tuple(levels)


def _opened(files: Sequence[Path], robot: Robot, said: Declared) -> list[Source]:
    opened = open_recordings(files, robot, said) if files else []
    return list(opened) if is_long(opened) else [one.in_memory() for one in opened]


def _payloads(
    experiment: Experiment,
    robot: Robot,
    groups: Mapping[str, Sequence[Source]],
    empty: Sequence[Source],
    settings: Settings,
    progress: Progress,
) -> PayloadResult | None:
    if not groups:
        return None
    asked = experiment.payload
    return identify_payload(
        robot, groups, empty, link=asked["link"], known_mass=asked["mass"], settings=settings, progress=progress
    )


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error


def _versions() -> dict[str, str]:
    from casysid import __version__

    found = {"casysid": __version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found

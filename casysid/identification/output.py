"""A result on disk: ``result.json``, the identified model and the moments, all at once or not at all."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from casysid.dynamics import Regressor
from casysid.identification.plain_friction import homeless_columns
from casysid.identification.result import IdentificationResult, without_infinities
from casysid.identification.verdict import judge
from casysid.model import write_model
from casysid.model.drive_yaml import DRIVE_FILE, drive_yaml
from casysid.moments_file import write_moments
from casysid.outputs import Stage, run_folder, write_whole
from casysid.robot import write_robot


def write_result(
    result: IdentificationResult, directory: str | Path, *, export_inconsistent: bool = False
) -> tuple[str, ...]:
    """Write ``result.json``, ``moments.npz``, the model, and ``identified.urdf`` or ``identified.xml`` into a folder.

    :func:`~casysid.identification.saved.read_result` reads it back. Beside a URDF, which has no place for them,
    armature and all other numbers of the drives are in ``drive.yaml``. Files of an earlier run there go, its report
    too; files of others stay.

    Returns:
        What a person should know about the written model, one sentence each.

    Raises:
        OutputError: They cannot be written; the directory is as it was.
    """
    home = Path(directory)
    with run_folder(home, identity_of(result), claims=[model_path(result, home).name]) as stage:
        return add_result(result, stage, export_inconsistent=export_inconsistent)


def add_result(result: IdentificationResult, stage: Stage, *, export_inconsistent: bool = False) -> tuple[str, ...]:
    """Write what :func:`write_result` writes to where a run's files wait; returns what it returns."""
    notes = _write_model(result, stage, export_inconsistent)
    content = {
        **result.to_json(),
        "verdict": judge(result).to_json(),
        "model_notes": list(notes),
    }
    write_moments(result.moments, stage.folder / "moments.npz")
    write_model(result.model, stage.folder)
    if result.robot.source_format == "urdf":
        (stage.folder / DRIVE_FILE).write_text(drive_yaml(result.model), encoding="utf-8")
    write_json(content, stage.folder / "result.json")
    return notes


def identity_of(result: IdentificationResult) -> str:
    """What tells a result from others: a digest of all that ``result.json`` says."""
    return hashlib.sha256(_json(result.to_json())).hexdigest()


def write_json(content: object, path: str | Path) -> None:
    """Indented JSON, whole or not at all; infinities and NaN become null.

    Raises:
        OutputError: The file cannot be written.
    """
    write_whole(path, _json(content))


def _json(content: object) -> bytes:
    return (json.dumps(without_infinities(content), indent=2, allow_nan=False) + "\n").encode()


def model_path(result: IdentificationResult, directory: Path) -> Path:
    """Where the identified model is written: the format that came in."""
    return directory / ("identified.urdf" if result.robot.source_format == "urdf" else "identified.xml")


def _in_kinds(regressor: Regressor, columns: Sequence[str]) -> str:
    """Drive columns by their kinds, such as ``stribeck (2 joints)``; names of joints where there is one."""
    owners: dict[str, list[str]] = {}
    for part in regressor.parts:
        if any(regressor.names[column] in columns for column in part.columns):
            owners.setdefault(part.kind.kind.replace("_", " "), []).append(part.direction.name)
    return ", ".join(
        f"{kind} ({names[0] if len(names) == 1 else f'{len(names)} joints'})" for kind, names in owners.items()
    )


def _write_model(result: IdentificationResult, stage: Stage, export_inconsistent: bool) -> tuple[str, ...]:
    path = model_path(result, stage.home)
    if not (result.is_physically_consistent or export_inconsistent):
        return (f"{path.name} is withheld because the parameters are not physically consistent.",)
    homeless, model = homeless_columns(result.regressor), result.model
    written = write_robot(
        result.robot,
        path,
        result.inertial_parameters,
        damping=model.damping,
        dry_friction=model.dry_friction,
        armature=model.armature,
        keep_as=stage.folder / path.name,
    )
    if not homeless:
        return written.notes
    note = (
        f"{path.name} has no place for {_in_kinds(result.regressor, homeless)}: they are in result.json, under "
        "friction; the file's viscous and Coulomb friction are those that come nearest to the whole."
    )
    return (*written.notes, note)

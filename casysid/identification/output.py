"""A result on disk: ``result.json``, the identified model and the moments, each whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path

from casysid.identification.plain_friction import nearest_plain_friction
from casysid.identification.result import JOINT_KINDS, IdentificationResult, without_infinities
from casysid.identification.verdict import judge
from casysid.moments import write_moments
from casysid.robot import write_robot


def write_result(
    result: IdentificationResult, directory: Path, *, export_inconsistent: bool = False
) -> tuple[str, ...]:
    """Write ``result.json``, ``moments.npz``, and ``identified.urdf`` or ``identified.xml`` into a directory.

    Returns:
        What a person should know about the written model, one sentence each.
    """
    directory.mkdir(parents=True, exist_ok=True)
    notes = _write_model(result, directory, export_inconsistent)
    verdict = judge(result)
    content = {
        **result.to_json(),
        "verdict": {"accepted": verdict.accepted, "reasons": list(verdict.reasons), "remarks": list(verdict.remarks)},
        "model_notes": list(notes),
    }
    write_moments(result.moments, directory / "moments.npz")
    write_json(content, directory / "result.json")
    return notes


def write_json(content: object, path: Path) -> None:
    """Indented JSON through a temporary name; infinities and NaN become null."""
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(json.dumps(without_infinities(content), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    os.replace(temporary, path)


def model_path(result: IdentificationResult, directory: Path) -> Path:
    """Where the identified model is written: the format that came in."""
    return directory / ("identified.urdf" if result.robot.source_format == "urdf" else "identified.xml")


def _write_model(result: IdentificationResult, directory: Path, export_inconsistent: bool) -> tuple[str, ...]:
    path = model_path(result, directory)
    if not (result.is_physically_consistent or export_inconsistent):
        path.unlink(missing_ok=True)
        return (f"{path.name} is withheld because the parameters are not physically consistent.",)
    homeless = _homeless(result)
    plain = nearest_plain_friction(result.regressor, result.parameters, result.moments, homeless)
    written = write_robot(
        result.robot,
        path,
        result.inertial_parameters.ravel(),
        damping=plain["viscous"],
        dry_friction=plain["coulomb"],
        armature=result.drive_vector("armature"),
    )
    if not homeless:
        return written.notes
    note = (
        f"{path.name} has no place for {', '.join(homeless)}: they are in result.json, under friction; the file's "
        "viscous and Coulomb friction are those that come nearest to the whole."
    )
    return (*written.notes, note)


def _homeless(result: IdentificationResult) -> list[str]:
    """Names of the drive columns that a robot file has no place for."""
    return [
        parameter.name
        for parameter in result.regressor.parameters[10 * len(result.robot.links) :]
        if parameter.kind not in JOINT_KINDS or parameter.owner not in result.robot.dofs
    ]

"""What is in an experiment's file, read and checked, and written back with nothing left open."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from casysid.errors import ParameterError
from casysid.experiment.checking import (
    Check,
    anything,
    checked_table,
    number,
    numbers,
    numbers_by_name,
    table,
    text,
    texts,
    truth,
    word,
)

FIT, HELD_OUT, PAYLOAD = "fit", "held-out", "payload"
LARGEST_FILE = 1 << 20
"""Bytes of an experiment's file: a thousand recordings take a tenth of that."""
_Known = Mapping[str, tuple[Check, Any]]
_ROBOT: _Known = {
    "file": (text, KeyError),
    "gravity": (numbers(3, -1e3, 1e3), None),
    "lock": (numbers_by_name(-1e4, 1e4), {}),
    "floating_base": (truth, False),
}
_RECORDING: _Known = {"file": (text, KeyError), "role": (word(FIT, HELD_OUT, PAYLOAD), FIT), "payload": (text, None)}
_LOG: _Known = {
    "units": (texts, ()),
    "map": (text, None),
    **{name: (texts, ()) for name in ("motor_constant", "gear", "efficiency")},
}
_SETTINGS: _Known = {
    "method": (text, "empirical-bayes"),
    "consistency": (word("none", "inertia", "full"), "full"),
    "friction": (word("auto", "plain"), "auto"),
    "split": (number(0.01, 0.99), None),
    "cutoff": (number(0.01, 1e4), None),
    "delay": (number(-1.0, 1.0), None),
    "time_scale": (number(1e-9, 3600.0), None),
    "flip": (texts, ()),
    "coupling": (texts, ()),
    "noise_position": (numbers(None, 0.0, 0.1), None),
    "noise_velocity": (numbers(None, 0.0, 10.0), None),
    "noise_acceleration": (numbers(None, 0.0, 1e3), None),
}
_PAYLOAD: _Known = {"link": (text, None), "mass": (numbers_by_name(1e-6, 1e6), {})}
_OUTPUTS: _Known = {
    "folder": (text, "run"),
    "report": (truth, True),
    "c_code": (truth, False),
    "export_inconsistent": (truth, False),
}
_PROVENANCE: _Known = {"casysid": (text, None), "versions": (table, {}), "sha256": (table, {})}


@dataclass(frozen=True)
class RecordingEntry:
    """A recording and what it is for.

    Attributes:
        file: Where it is.
        role: ``fit``, ``held-out`` or ``payload``.
        payload: Name of what is held, if something is.
    """

    file: Path
    role: str
    payload: str | None = None


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """What an experiment's file asks for; paths are absolute.

    Attributes:
        robot: Robot's file, gravity, locked joints, floating base.
        recordings: With their roles.
        log: What the recordings' columns hold, as ``--units``, ``--map`` and the like of ``casysid identify``.
        settings: As the options of ``casysid identify``; None lets the data decide.
        payload: Link that holds payloads, and known masses by name.
        outputs: Folder and files.
        sha256: Of the inputs when a file was written back, by path; empty in one that a person wrote.
    """

    robot: Mapping[str, Any]
    recordings: tuple[RecordingEntry, ...]
    log: Mapping[str, Any]
    settings: Mapping[str, Any]
    payload: Mapping[str, Any]
    outputs: Mapping[str, Any]
    sha256: Mapping[str, str]

    def of_role(self, role: str) -> list[Path]:
        """The files of a role."""
        return [one.file for one in self.recordings if one.role == role]

    def payloads(self) -> dict[str, list[Path]]:
        """Files with a payload, by its name."""
        groups: dict[str, list[Path]] = {}
        for one in self.recordings:
            if one.role == PAYLOAD:
                groups.setdefault(one.payload or PAYLOAD, []).append(one.file)
        return groups

    @property
    def inputs(self) -> list[Path]:
        """All files that are read."""
        maps = [Path(self.log["map"])] if self.log["map"] else []
        return list(dict.fromkeys([Path(self.robot["file"]), *maps, *(one.file for one in self.recordings)]))

    def to_toml(self, versions: Mapping[str, str], sha256: Mapping[str, str]) -> str:
        """The file with nothing left open, and what it was run with."""
        lines = [
            "# An experiment as it was run; `casysid run` on this file gives the same numbers again.",
            *_table("robot", self.robot),
        ]
        for one in self.recordings:
            lines += _table("[recordings]", {"file": str(one.file), "role": one.role, "payload": one.payload})
        for name in ("log", "settings", "payload", "outputs"):
            lines += _table(name, getattr(self, name))
        provenance = {"casysid": versions["casysid"], "versions": versions, "sha256": sha256}
        return "\n".join([*lines, *_table("provenance", provenance)]) + "\n"


def read_experiment(path: str | Path) -> Experiment:
    """The experiment in a TOML file; its relative paths start from the file's folder.

    Raises:
        ParameterError: The file is not there, is no TOML, or holds something else than it may.
    """
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ParameterError(f"{path}: {path.stat().st_size} bytes are too many for an experiment's file")
        content = tomllib.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read: {error.strerror}; wanted an experiment's TOML file") from error
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"{path}: this is no TOML: {error}") from error
    try:
        return _experiment(content, path.resolve().parent)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from error


def _experiment(content: dict[str, Any], home: Path) -> Experiment:
    sections = checked_table(
        content,
        "the file",
        {
            "robot": (table, KeyError),
            "recordings": (anything, KeyError),
            **{name: (table, {}) for name in ("log", "settings", "payload", "outputs", "provenance")},
        },
    )
    robot = checked_table(sections["robot"], "[robot]", _ROBOT)
    recordings = sections["recordings"]
    if not isinstance(recordings, list) or not recordings:
        raise ParameterError("[[recordings]] must be there at least once, with a file")
    entries = [checked_table(one, f"[[recordings]] {k}", _RECORDING) for k, one in enumerate(recordings, start=1)]
    for k, one in enumerate(entries, start=1):
        if one["payload"] is not None and one["role"] != PAYLOAD:
            raise ParameterError(f"[[recordings]] {k} names a payload, so its role must be '{PAYLOAD}'")
    if not any(one["role"] == FIT for one in entries):
        raise ParameterError(f"[[recordings]]: at least one must have the role '{FIT}'")
    provenance = checked_table(sections["provenance"], "[provenance]", _PROVENANCE)
    log = checked_table(sections["log"], "[log]", _LOG)
    outputs = checked_table(sections["outputs"], "[outputs]", _OUTPUTS)
    return Experiment(
        robot={**robot, "file": _robot_file(robot["file"], home)},
        recordings=tuple(RecordingEntry(home / one["file"], one["role"], one["payload"]) for one in entries),
        log={**log, "map": None if log["map"] is None else str(home / log["map"])},
        settings=checked_table(sections["settings"], "[settings]", _SETTINGS),
        payload=checked_table(sections["payload"], "[payload]", _PAYLOAD),
        outputs={**outputs, "folder": str(home / outputs["folder"])},
        sha256={str(name): str(digest) for name, digest in provenance["sha256"].items()},
    )


def _robot_file(name: str, home: Path) -> str:
    """The file beside the experiment's, if it is there; else what the command line would take the name for."""
    from casysid.bundled import find_model

    beside = home / name
    return str(beside if beside.is_file() else find_model(name).resolve())


def _table(name: str, values: Mapping[str, Any]) -> list[str]:
    """Lines of a table; what is None is left out, since TOML has no word for it."""
    plain = {key: value for key, value in values.items() if value is not None and not isinstance(value, Mapping)}
    nested = {key: value for key, value in values.items() if isinstance(value, Mapping) and value}
    lines = ["", f"[{name}]", *(f"{_key(key)} = {_value(value)}" for key, value in plain.items())]
    for key, value in nested.items():
        lines += ["", f"[{name}.{key}]", *(f"{_key(k)} = {_value(v)}" for k, v in value.items())]
    return lines


def _key(name: str) -> str:
    return name if name.isascii() and name.replace("_", "").replace("-", "").isalnum() else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # TOML's strings are JSON's
    if isinstance(value, Iterable):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)

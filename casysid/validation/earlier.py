"""What the result of an identification knows that a model file has no place for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from casysid.dynamics import FrictionModel
from casysid.errors import ParameterError
from casysid.identification.friction_model import model_from_json
from casysid.json_reading import check_numbers, number, numbers_by_name, object_at, read_json, texts

SMALLEST_GAIN = 1e-6
"""Of torque: as from N m to mega-newton metres."""
LOWEST_CUTOFF, HIGHEST_CUTOFF = 0.01, 1e4
"""As on the command line [Hz]."""
Drives = Mapping[str, Mapping[str, float | None]]
"""Friction and armature by joint and kind, as in a ``result.json``."""


@dataclass(frozen=True, kw_only=True)
class EarlierResult:
    """What goes with an identified model: how its recordings were read, and its drives.

    Attributes:
        drives: Friction, offset and armature to take instead of the file's.
        friction: Columns and couplings that ``drives`` are the parameters of; None takes the default columns, as wide
            as the motions ask, and couplings by their names.
        cutoff: Low-pass [Hz] of motion and torque; None lets the data choose.
        delays: By how much the logged torque is late, by joint [s].
        flip: Columns whose signs are turned.
        time_scale: Time stamps times this are seconds.
        quasi_static: Whether torques hold no inertial part.
        torque_gains: Measured torque over true torque, by joint, negative where its sign is another; one for those
            not named.
    """

    drives: Drives = field(default_factory=dict)
    friction: FrictionModel | None = None
    cutoff: float | None = None
    delays: Mapping[str, float] = field(default_factory=dict)
    flip: tuple[str, ...] = ()
    time_scale: float = 1.0
    quasi_static: bool = False
    torque_gains: Mapping[str, float] = field(default_factory=dict)


def read_earlier_result(path: str | Path) -> EarlierResult:
    """The part of a ``result.json`` that :class:`EarlierResult` holds; the folder it lies in will do.

    Raises:
        ParameterError: The file is not such a result, or its columns of friction are not casysid's own.
    """
    path = Path(path)
    path = path / "result.json" if path.is_dir() else path
    try:
        content = read_json(path)
        clock = object_at(content, "time_base")
        check_numbers(object_at(content, "friction_model"), "friction_model")
        return EarlierResult(
            drives=_drives(content),
            friction=model_from_json(content["friction_model"]) if "friction_model" in content else None,
            cutoff=_cutoff(content),
            delays=numbers_by_name(object_at(content, "delay", "seconds"), "delay.seconds", -1.0, 1.0),
            flip=texts(content.get("flip", []), "flip"),
            time_scale=number(clock.get("scale", 1.0), "time_base.scale", 1e-9, 3600.0),
            quasi_static=bool(clock.get("quasi_static", False)),
            torque_gains=_gains(content),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        reason = f"there is no '{error.args[0]}'" if isinstance(error, KeyError) and error.args else str(error)
        raise ParameterError(
            f"{path}: wanted the result.json of an identification, with its 'friction' and 'cutoff'; {reason}"
        ) from error


def _drives(content: Mapping[str, Any]) -> Drives:
    if "friction" not in content:
        raise KeyError("friction")
    drives: dict[str, dict[str, float | None]] = {}
    for owner in object_at(content, "friction"):
        kinds = object_at(content, "friction", owner)
        drives[owner] = {
            kind: None if value is None else number(value, f"friction.{owner}.{kind}") for kind, value in kinds.items()
        }
    return drives


def _gains(content: Mapping[str, Any]) -> dict[str, float]:
    """Negative ones are of torques that were logged with the other sign."""
    gains = numbers_by_name(
        object_at(content, "torque_gains", "gains"), "torque_gains.gains", -1.0 / SMALLEST_GAIN, 1.0 / SMALLEST_GAIN
    )
    for dof, gain in gains.items():
        number(abs(gain), f"torque_gains.gains.{dof}", SMALLEST_GAIN)
    return gains


def _cutoff(content: Mapping[str, Any]) -> float | None:
    if "cutoff" not in content:
        raise KeyError("cutoff")
    value = object_at(content, "cutoff")["hz"]
    return None if value is None else number(value, "cutoff.hz", LOWEST_CUTOFF, HIGHEST_CUTOFF)

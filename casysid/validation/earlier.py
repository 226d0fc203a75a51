"""What the result of an identification knows that a model file has no place for."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from casysid.dynamics import FrictionModel
from casysid.errors import ParameterError
from casysid.identification.friction_model import model_from_json

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
        torque_gains: Measured torque over true torque, by joint; one for those not named.
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
    """The part of a ``result.json`` that :class:`EarlierResult` holds.

    Raises:
        ParameterError: The file is not such a result, or its columns of friction are not casysid's own.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        clock = content.get("time_base", {})
        return EarlierResult(
            drives=content["friction"],
            friction=model_from_json(content["friction_model"]) if "friction_model" in content else None,
            cutoff=content["cutoff"]["hz"],
            delays={str(joint): float(late) for joint, late in content.get("delay", {}).get("seconds", {}).items()},
            flip=tuple(content.get("flip", ())),
            time_scale=float(clock.get("scale", 1.0)),
            quasi_static=bool(clock.get("quasi_static", False)),
            torque_gains={
                str(joint): float(g) for joint, g in content.get("torque_gains", {}).get("gains", {}).items()
            },
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ParameterError(
            f"{path}: wanted the result.json of an identification, with its 'friction' and 'cutoff'; {error!r}"
        ) from error

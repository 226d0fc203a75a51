"""Friction columns and couplings as JSON and back: all that a regressor's drive columns are made of."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from casysid.dynamics import (
    Armature,
    AsymmetricViscous,
    Coulomb,
    Coupling,
    FrictionColumn,
    LoadedCoulomb,
    Offset,
    PowerViscous,
    Regressor,
    SmoothSign,
    Spring,
    Stribeck,
    Viscous,
)
from casysid.errors import ParameterError

KINDS: Mapping[str, type[FrictionColumn]] = {
    column.kind: column
    for column in (
        Viscous, Coulomb, Offset, Armature, AsymmetricViscous, PowerViscous, Stribeck, LoadedCoulomb, Spring,
    )
}  # fmt: skip


@dataclass(frozen=True)
class FrictionModel:
    """What a regressor's drive columns are made of.

    Attributes:
        columns: Of every joint, or of those they name.
        couplings: Transmissions that link joints.
    """

    columns: tuple[FrictionColumn, ...]
    couplings: tuple[Coupling, ...] = ()


def model_to_json(regressor: Regressor) -> dict[str, object]:
    """Kinds with what enters them nonlinearly, and couplings with their weights; parameters are not in it."""
    return {
        "columns": [_column_to_json(column, regressor) for column in regressor.friction],
        "couplings": [{"name": one.name, **dataclasses.asdict(one)} for one in regressor.couplings],
    }


def model_from_json(content: Mapping[str, Any]) -> FrictionModel:
    """The columns and couplings of :func:`model_to_json`.

    Raises:
        ParameterError: A kind is not one of casysid's own, so that only its author can rebuild it.
    """
    couplings = [
        Coupling(tuple(one["joints"]), tuple(one["weights"]), None if one["kinds"] is None else tuple(one["kinds"]))
        for one in content["couplings"]
    ]
    return FrictionModel(tuple(_column_from_json(dict(one)) for one in content["columns"]), tuple(couplings))


def _column_to_json(column: FrictionColumn, regressor: Regressor) -> dict[str, object]:
    if KINDS.get(column.kind) is not type(column):
        return {"kind": column.kind, "own": True}
    fields = dataclasses.asdict(column) if dataclasses.is_dataclass(column) else {}
    if isinstance(column, SmoothSign) and isinstance(column.width, tuple):
        fields["width"] = list(column.width)
    if isinstance(column, LoadedCoulomb):
        fields["inertial_parameters"] = column.model(regressor.robot.inertial_parameters).tolist()
    return {"kind": column.kind, **fields}


def _column_from_json(content: dict[str, Any]) -> FrictionColumn:
    kind = content.pop("kind")
    if kind not in KINDS or "own" in content:
        raise ParameterError(
            f"friction: '{kind}' is not one of casysid's kinds ({', '.join(KINDS)}); give the columns themselves"
        )
    return KINDS[kind](**{name: tuple(value) if isinstance(value, list) else value for name, value in content.items()})

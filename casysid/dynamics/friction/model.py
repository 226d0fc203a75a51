"""Kinds of friction and couplings put together, and as JSON and back."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from casysid.dynamics.friction.direction import Coupling
from casysid.dynamics.friction.kind import FrictionKind
from casysid.dynamics.friction.kinds import FRICTION_KINDS
from casysid.errors import ParameterError
from casysid.robot import Robot


@dataclass(frozen=True)
class FrictionModel:
    """What a regressor's drive columns are made of.

    Attributes:
        columns: Kinds of friction of every joint, or of those they name.
        couplings: Transmissions that link joints.
    """

    columns: tuple[FrictionKind, ...]
    couplings: tuple[Coupling, ...] = ()

    def joined_by(self, kinds: Iterable[FrictionKind], couplings: Iterable[Coupling] = ()) -> FrictionModel:
        """With further kinds and couplings; a kind that is there already then acts wherever either does.

        Raises:
            ParameterError: Two of a kind cannot act as one.
        """
        columns = {kind.kind: kind for kind in self.columns}
        for kind in kinds:
            columns[kind.kind] = columns[kind.kind].merged_with(kind) if kind.kind in columns else kind
        return FrictionModel(tuple(columns.values()), (*self.couplings, *couplings))

    def to_json(self, robot: Robot) -> dict[str, object]:
        """Kinds with what enters them nonlinearly, and couplings with their weights; parameters are not in it.

        Args:
            robot: Of which this is the friction, with the parameters of its file.
        """
        return {
            "columns": [_kind_to_json(kind, robot) for kind in self.columns],
            "couplings": [{"name": one.name, **dataclasses.asdict(one)} for one in self.couplings],
        }

    @classmethod
    def from_json(
        cls, content: Mapping[str, Any], kinds: Sequence[type[FrictionKind]] = FRICTION_KINDS
    ) -> FrictionModel:
        """The friction of :meth:`to_json`.

        Args:
            content: Of the JSON.
            kinds: That may be in it; kinds of one's own are to be named here.

        Raises:
            ParameterError: A kind is none of ``kinds``.
        """
        couplings = [
            Coupling(tuple(one["joints"]), tuple(one["weights"]), None if one["kinds"] is None else tuple(one["kinds"]))
            for one in content["couplings"]
        ]
        return cls(tuple(_kind_from_json(dict(one), kinds) for one in content["columns"]), tuple(couplings))


def _kind_to_json(kind: FrictionKind, robot: Robot) -> dict[str, object]:
    own = {} if type(kind) in FRICTION_KINDS else {"class": type(kind).__qualname__}
    return {"kind": kind.kind, **own, **kind.to_json(robot)}


def _kind_from_json(content: dict[str, Any], kinds: Sequence[type[FrictionKind]]) -> FrictionKind:
    name, own = content.pop("kind"), content.pop("class", None)
    for kind in kinds:
        if kind.kind == name and own == (None if kind in FRICTION_KINDS else kind.__qualname__):
            return kind.from_json(content)
    raise ParameterError(
        f"friction: '{name}' of class {own or 'unknown'} is none of the kinds "
        f"{', '.join(kind.kind for kind in kinds)}; name its class among them, or give the columns themselves"
    )

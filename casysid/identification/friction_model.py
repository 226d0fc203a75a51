"""The friction of a regressor as JSON and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from casysid.dynamics import FRICTION_KINDS, FrictionKind, FrictionModel, Regressor


def model_to_json(regressor: Regressor) -> dict[str, object]:
    """Kinds with what enters them nonlinearly, and couplings with their weights; parameters are not in it."""
    return FrictionModel(regressor.friction, regressor.couplings).to_json(regressor.robot)


def model_from_json(content: Mapping[str, Any], kinds: Sequence[type[FrictionKind]] = FRICTION_KINDS) -> FrictionModel:
    """The kinds and couplings of :func:`model_to_json`.

    Raises:
        ParameterError: A kind is none of ``kinds``.
    """
    return FrictionModel.from_json(content, kinds)

"""A result that was written, read back: the model with its errors, and what ``result.json`` tells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from casysid.arrays import Array
from casysid.dynamics import FRICTION_KINDS, FrictionKind
from casysid.errors import ParameterError
from casysid.json_reading import object_at, read_json, texts
from casysid.model import RobotModel, read_model
from casysid.moments import Moments
from casysid.moments_file import read_moments
from casysid.robot import Robot


@dataclass(frozen=True, eq=False, repr=False)
class SavedResult:
    """What is left of an identification in its folder.

    Attributes:
        folder: Where it is.
        model: The identified dynamics, with the numbers that the identification had.
        content: All of ``result.json``.
    """

    folder: Path
    model: RobotModel
    content: Mapping[str, Any]

    def __repr__(self) -> str:
        word = "accepted" if self.accepted else "rejected"
        return f"<SavedResult in {self.folder}: {word}, {self.model!r}>"

    @property
    def robot(self) -> Robot:
        """The robot as its file described it."""
        return self.model.robot

    @property
    def parameters(self) -> Array:
        """The answer, shape (p,)."""
        return self.model.parameters

    @property
    def inertial_parameters(self) -> Array:
        """The links' parameters, shape (10 links,)."""
        return self.model.inertial_parameters

    @property
    def accepted(self) -> bool:
        """Whether the identification accepted its answer."""
        return object_at(self.content, "verdict").get("accepted") is True

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why, one sentence each."""
        return texts(object_at(self.content, "verdict").get("reasons", []), "verdict.reasons")

    @cached_property
    def moments(self) -> Moments:
        """Of the fitted recordings, as one block.

        Raises:
            ParameterError: ``moments.npz`` is not there any more, or is something else.
        """
        return read_moments(self.folder / "moments.npz")


def read_result(folder: str | Path, kinds: Sequence[type[FrictionKind]] = FRICTION_KINDS) -> SavedResult:
    """The result that ``casysid identify`` or :func:`~casysid.identification.output.write_result` left in a folder.

    Args:
        folder: Where it is, or the path of its ``result.json``.
        kinds: Of friction that may be in it; kinds of one's own are to be named here beside ``FRICTION_KINDS``.

    Raises:
        ParameterError: A file is missing, or is something else.
    """
    home = Path(folder)
    home = home.parent if home.name == "result.json" else home
    path = home / "result.json"
    try:
        content = read_json(path)
        object_at(content, "verdict")
    except (OSError, ValueError) as error:
        raise ParameterError(f"{path}: wanted the result.json of an identification; {error}") from error
    return SavedResult(home, read_model(home, kinds), content)

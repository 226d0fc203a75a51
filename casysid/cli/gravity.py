"""``--gravity auto``: the gravity that the log itself asks for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from typer.core import TyperCommand

if TYPE_CHECKING:
    from casysid.recording import Source
    from casysid.robot import Robot

AUTO = ("nan", "nan", "nan")
"""What stands for ``auto`` where three numbers are wanted: no gravity is that."""
Gravity = tuple[float, float, float] | None


class CommandWithGravity(TyperCommand):
    """A verb whose ``--gravity`` takes ``auto`` beside three numbers."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As the class before has it."""
        words: list[str] = []
        for word in args:
            words += AUTO if word == "auto" and words[-1:] == ["--gravity"] else [word]
        return super().parse_args(ctx, words)


def is_auto(gravity: Gravity) -> bool:
    """Whether ``auto`` was said."""
    return gravity is not None and all(math.isnan(value) for value in gravity)


def in_its_gravity(robot: Robot, recordings: Sequence[Source]) -> tuple[Robot, str]:
    """The robot in the gravity that its recordings ask for, and what was found, in words."""
    from casysid.identification import choose_band
    from casysid.identification.mistakes import find_gravity
    from casysid.identification.passes import Passes

    excerpts = [part for one in recordings for part in one.excerpts()]
    passes = Passes(robot, excerpts, choose_band(excerpts))
    found = find_gravity(robot, passes.sparse_motions, passes.band.cutoff)
    if found is None:
        return robot, "the log asks for no other gravity than the file's"
    return robot.with_gravity(found.gravity), f"{found.words}; taken: {found.option}"

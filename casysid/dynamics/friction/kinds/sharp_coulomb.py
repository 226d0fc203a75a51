"""Dry friction that turns more sharply than the usual smooth sign."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from casysid.dynamics.friction.kinds.coulomb import Coulomb
from casysid.robot import Robot


@dataclass(frozen=True)
class SharpCoulomb(Coulomb):
    """A second smooth sign beside Coulomb's, of a smaller width.

    Both together are a curve that rises with velocity, blunt or sharp as the data have it. The file's dry friction is
    the other one's prior.
    """

    kind: ClassVar[str] = "sharp_coulomb"

    def prior(self, robot: Robot, dof: int) -> float:
        """Nothing."""
        return 0.0

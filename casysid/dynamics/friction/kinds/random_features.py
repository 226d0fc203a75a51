"""What no mechanism explains: a smooth function of the whole motion for each joint, apart from the physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from casysid.arrays import Array
from casysid.dynamics.friction.direction import Direction, force_unit
from casysid.dynamics.friction.kind import DriveState, FrictionKind, Term, acts_along
from casysid.errors import ParameterError

Scale = float | tuple[float, ...] | None


@dataclass(frozen=True)
class RandomFeatures(FrictionKind):
    """Random waves of the motion, ``√(2/D) cos(wᵀ [q, v, a] + b)``, whose weighted sum is any smooth function of it.

    With normal weights it is Gaussian process regression with a squared exponential kernel, up to the number of waves.
    It predicts torque near motions that were fitted, such as for the detection of contacts, and nothing elsewhere; it
    is nothing that a robot file could hold.

    Attributes:
        count: ``D``, of the waves, which all joints share; each joint has as many parameters.
        length_scales: Over which the function changes, of q [rad or m, or of a configuration's other entries],
            v [rad/s or m/s] and a [rad/s² or m/s²]; each one number or one for every entry; None leaves it out.
        seed: Of the waves.
        joints: Where it acts; None for everywhere.

    Source: Rahimi and Recht (2007); for rigid bodies with a rest of this kind Gijsberts and Metta (2011).
    """

    count: int
    length_scales: tuple[Scale, Scale, Scale]
    seed: int = 0
    joints: tuple[str, ...] | None = None

    kind: ClassVar[str] = "random_features"
    is_friction: ClassVar[bool] = False
    is_physical: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ParameterError(f"{self.kind}: count must be at least 1; got {self.count}")
        scales = [np.array(one) for one in self.length_scales if one is not None]
        if len(self.length_scales) != 3 or not all((one > 0.0).all() and np.isfinite(one).all() for one in scales):
            raise ParameterError(
                f"{self.kind}: length_scales must be three, of q, v and a, positive or None; got {self.length_scales}"
            )

    def terms(self, direction: Direction, state: DriveState) -> tuple[Term, ...]:
        """The waves; every joint has them in its own torque."""
        if not acts_along(self.joints, direction):
            return ()
        motion = ca.vertcat(*state.robot)
        weights, phases = self.waves([part.numel() for part in state.robot])
        waves = np.sqrt(2.0 / self.count) * ca.cos(ca.DM(weights) @ motion + ca.DM(phases))
        unit = force_unit(direction)
        return tuple(Term(f"{self.kind}_{k}", unit, waves[k]) for k in range(self.count))

    def waves(self, sizes: Sequence[int]) -> tuple[Array, Array]:
        """Weights (D, n) of q, v and a together, which have so many entries each, and phases (D,).

        Raises:
            ParameterError: There are not as many length scales as entries.
        """
        scales = [np.atleast_1d(np.inf if one is None else one) for one in self.length_scales]
        if any(len(scale) not in (1, size) for scale, size in zip(scales, sizes, strict=True)):
            raise ParameterError(
                f"{self.kind}: length_scales of q, v and a must be one number each or {', '.join(map(str, sizes))}; "
                f"got {', '.join(str(len(scale)) for scale in scales)}"
            )
        rng = np.random.default_rng(self.seed)
        scale = np.concatenate([np.broadcast_to(one, size) for one, size in zip(scales, sizes, strict=True)])
        weights = rng.normal(size=(self.count, len(scale))) / scale
        return weights, rng.uniform(0.0, 2.0 * np.pi, self.count)

    def describe(self, direction: Direction) -> str:
        """In words."""
        return f"a rest without physics ({self.count} random features)"

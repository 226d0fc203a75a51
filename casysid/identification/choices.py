"""All that was chosen from the data on the way to the fit, as one value."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from casysid.arrays import Array
from casysid.identification.mistakes import Mistake
from casysid.identification.settings import Settings
from casysid.identification.tuning.band import BandChoice
from casysid.identification.tuning.clock import TimeBase
from casysid.identification.tuning.delay import DelayChoice
from casysid.identification.tuning.drive_gains import DriveGains
from casysid.identification.tuning.friction_selection import FrictionChoice


@dataclass(frozen=True, eq=False, kw_only=True)
class Choices:
    """What was chosen, each with its evidence.

    Attributes:
        band: Cut-offs of smoothing, equations and errors.
        width: Velocity within which Coulomb's smooth sign turns, by degree of freedom, shape (nv,).
        clock: Whether the time stamps are seconds, and whether torques hold inertia.
        mistakes: What in the recordings contradicts the model file; nothing was changed for it but ``signs``.
        delay: How late the torque is.
        friction: What joined the friction that was asked for.
        gains: Of the joints' torques relative to each other.
        signs: -1 where a joint's torque was taken to be logged with the other sign, else 1, shape (nv,).
        smoothings: How often each recording was smoothed on the way.
        passes: How often the equations of each recording were evaluated on the way.
        equations: Which are fitted, in words; empty where it is every joint's own.
    """

    band: BandChoice
    width: Array
    clock: TimeBase
    mistakes: tuple[Mistake, ...]
    delay: DelayChoice
    friction: FrictionChoice
    gains: DriveGains
    signs: Array
    smoothings: int
    passes: int
    equations: str = ""

    @property
    def settings(self) -> Settings:
        """Those given, with all that was chosen."""
        return self.friction.settings

    def to_json(self, joints: Sequence[str]) -> dict[str, object]:
        """Plain numbers, lists and words."""
        return {
            "cutoff": self.band.to_json(),
            "coulomb_width": dict(zip(joints, self.width.tolist(), strict=True)),
            "time_base": dataclasses.asdict(self.clock),
            "mistakes": [mistake.to_json() for mistake in self.mistakes],
            "delay": self.delay.to_json(joints),
            "torque_gains": {
                "gains": dict(zip(joints, (self.gains.values * self.signs).tolist(), strict=True)),
                "std": dict(zip(joints, self.gains.error.tolist(), strict=True)),
                "reason": self.gains.reason,
            },
            "smoothings": self.smoothings,
            "passes": self.passes,
            "equations": self.equations,
        }

"""What came of a simulated experiment: what was logged, and what was true."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from casysid.arrays import Array, frozen
from casysid.recording import Recording
from casysid.simulation.reference import Reference


class RunStatus(enum.Enum):
    """How a simulated run ended."""

    COMPLETED = "ran to the end"
    DIVERGED = "the robot ran away or the command was not finite; the run was stopped there"


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedRun:
    """What was logged and what was true, N samples; all torques in Pinocchio's coordinates.

    Attributes:
        recording: What a user would get: time, position, velocity and torque as the sensors say.
        reference: What was asked for.
        channels: True positions as a log has them, shape (N, channels).
        q: True configuration, shape (N, nq).
        v: True velocity, shape (N, nv).
        a: True acceleration, shape (N, nv).
        tau: Torque of the actuators, shape (N, nv); ``rnea(q, v, a) + viscous v + offset + dry_friction + cable``.
        dry_friction: What of it Coulomb friction and stiction take, shape (N, nv).
        cable: What of it the cables take, shape (N, nv).
        feedback: What the controller asked for because of its tracking error, shape (N, nv).
        saturated: Share of the samples at which more was asked for than the actuators can give, shape (nv,).
        status: How it ended.
        seconds: Time that the simulation took.
    """

    recording: Recording
    reference: Reference
    channels: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    dry_friction: Array
    cable: Array
    feedback: Array
    saturated: Array
    status: RunStatus
    seconds: float

    def __post_init__(self) -> None:
        for name in ("channels", "q", "v", "a", "tau", "dry_friction", "cable", "feedback", "saturated"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.q)

"""What is said when the robot is not what it was."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["payload", "put down", "friction", "unexplained"]


@dataclass(frozen=True)
class Event:
    """A change of the robot.

    Attributes:
        kind: ``payload``: another load than before; ``put down``: no load any more; ``friction``: of one joint;
            ``unexplained``: torque that neither explains, a contact for instance.
        since: When it began, as far as that can be told, on the samples' clock [s].
        noticed: Time of the newest sample when it was noticed [s].
        size: Mass held now [kg]; or by how much the joint's friction at its usual speed has changed [N m, N]; zero if
            unexplained.
        std: Standard error of the size; infinite if unexplained.
        joint: Whose friction; empty otherwise.
    """

    kind: Kind
    since: float
    noticed: float
    size: float
    std: float
    joint: str = ""

    @property
    def delay(self) -> float:
        """From the change to its notice [s]."""
        return self.noticed - self.since

    def __str__(self) -> str:
        what = {
            "payload": f"holds {self.size:.3g} kg ± {self.std:.1g} (one standard error)",
            "put down": "holds nothing any more",
            "friction": f"friction of {self.joint} changed by {self.size:+.3g} ± {self.std:.1g}",
            "unexplained": "torque that no payload and no joint's friction explains: a contact?",
        }[self.kind]
        return f"{what}, since {self.since:.1f} s, noticed at {self.noticed:.1f} s"

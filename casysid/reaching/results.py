"""What comes back when frames were to reach something."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError


class ReachStatus(enum.Enum):
    """How it ended; the value is the sentence the user reads."""

    REACHED = "reached"
    NEAREST = "not reached; this is the nearest posture found"
    IN_THE_WAY = "no posture found that keeps the distances"


@dataclass(frozen=True, kw_only=True)
class ReachSettings:
    """How postures are looked for.

    Attributes:
        position_tolerance: What counts as reached [m].
        rotation_tolerance: Likewise [rad].
        starts: Postures to start from, at most.
        steps: Of the descent from each start, at most.
    """

    position_tolerance: float = 1e-6
    rotation_tolerance: float = 1e-6
    starts: int = 50
    steps: int = 100

    def __post_init__(self) -> None:
        for name in ("position_tolerance", "rotation_tolerance", "starts", "steps"):
            if not getattr(self, name) > 0:
                raise ParameterError(f"reach settings: {name} must be positive; got {getattr(self, name)}")

    @property
    def tolerance(self) -> tuple[float, float]:
        """Of position and rotation."""
        return self.position_tolerance, self.rotation_tolerance


@dataclass(frozen=True, eq=False, kw_only=True)
class Reach:
    """A posture, and how near it is to the targets.

    Attributes:
        status: How it ended.
        configuration: Pinocchio's, shape (nq,).
        position: The same as a log has it, shape (channels,).
        distance: What is left of every target's position, shape (targets,), [m]; 0 where none was wanted.
        angle: Likewise of its rotation or look [rad].
        clearance: The least distance to links and obstacles [m]; inf where none was looked at.
        nearest: What is at that distance, in words.
        starts: How many postures were started from.
        steps: Of the solver, over all starts.
        seconds: Wall time.
    """

    status: ReachStatus
    configuration: Array
    position: Array
    distance: Array
    angle: Array
    clearance: float
    nearest: str
    starts: int
    steps: int
    seconds: float

    def __post_init__(self) -> None:
        for name in ("configuration", "position", "distance", "angle"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def success(self) -> bool:
        """Whether every target is reached."""
        return self.status is ReachStatus.REACHED

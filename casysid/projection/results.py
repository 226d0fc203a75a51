"""What a projection gives."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from casysid.arrays import Array, frozen


class ProjectionStatus(enum.Enum):
    """How far the answer can be trusted; the value is the sentence the user reads."""

    UNCHANGED = "the estimate was consistent; only what the data do not see was taken from the prior"
    CERTIFIED = "optimal, as the convex problem certifies"
    CONVEX = "IPOPT stopped short of the optimum; the convex solver's answer was taken"
    UNCERTIFIED = "a local optimum; the convex problem that would certify it was not solved"


class Solver(enum.Enum):
    """Whose answer it is."""

    NONE = "none"
    IPOPT = "ipopt"
    CLARABEL = "clarabel"


@dataclass(frozen=True, eq=False, kw_only=True)
class ProjectionResult:
    """Physically consistent parameters.

    Attributes:
        parameters: ``θ``, shape (p,).
        status: How far they can be trusted.
        solver: Whose answer they are.
        misfit: Energy of the residuals above the unconstrained fit's, as a fraction of that: the price of physics.
        gap: By how much IPOPT's misfit exceeds that of the convex optimum, in the same unit; nan without one of them.
        prior_weight: Weight of the distance to the prior in the directions that the data do not see, in the same unit;
            nan where none was needed.
        prior_cost: Share of the misfit that is due to this weight; nan where it is not known.
        smallest_eigenvalue: Of all links' pseudo-inertias.
        active: Names of links and parameters that lie on the boundary of what is consistent, or on the floor above it.
        iterations: IPOPT's, over all starts.
        seconds: Wall time.
    """

    parameters: Array
    status: ProjectionStatus
    solver: Solver
    misfit: float
    gap: float
    prior_weight: float
    prior_cost: float
    smallest_eigenvalue: float
    active: tuple[str, ...]
    iterations: int
    seconds: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", frozen(self.parameters))

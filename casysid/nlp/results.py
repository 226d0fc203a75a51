"""What goes into a solve beside the program, and what comes out."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Any

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError


class NlpStatus(enum.Enum):
    """Why IPOPT stopped; the value is the sentence the user reads."""

    CONVERGED = "converged to the requested tolerance"
    ACCEPTABLE = "stopped at the acceptable tolerance, not at the requested one"
    STOPPED = "stopped on request"
    MAX_ITERATIONS = "reached the largest number of iterations before the tolerance"
    MAX_SECONDS = "ran out of time before the tolerance"
    INFEASIBLE = "found no point that satisfies the constraints"
    FAILED = "gave up on numerical difficulties"


class HessianKind(enum.Enum):
    """Second derivatives of the Lagrangian; the value is IPOPT's word."""

    EXACT = "exact"
    LIMITED_MEMORY = "limited-memory"


@dataclass(frozen=True, kw_only=True)
class NlpSettings:
    """How IPOPT is asked to work.

    Attributes:
        tolerance: On the optimality conditions.
        constraint_tolerance: Largest violation of a constraint.
        acceptable_tolerance: Good enough when fifteen iterations in a row bring no more; ``tolerance`` turns this off.
        max_iterations: Largest number of iterations.
        max_seconds: Largest wall time.
        restoration: Largest number of iterations in a row in which IPOPT looks for a feasible point and nothing else.
        hessian: Exact, or approximated from gradients.
        scaling: Scale objective and constraints by their gradients at the start.
        barrier: First value of the barrier parameter; None lets IPOPT adapt it at every step.
        linear_solver: ``mumps`` or ``spral``, the two that CasADi's wheel holds.
    """

    tolerance: float = 1e-8
    constraint_tolerance: float = 1e-4
    acceptable_tolerance: float = 1e-6
    max_iterations: int = 1000
    max_seconds: float = math.inf
    restoration: int = 3_000_000
    hessian: HessianKind = HessianKind.EXACT
    scaling: bool = True
    barrier: float | None = 0.1
    linear_solver: str = "mumps"

    def __post_init__(self) -> None:
        for name in (
            "tolerance",
            "constraint_tolerance",
            "acceptable_tolerance",
            "max_iterations",
            "max_seconds",
            "restoration",
        ):
            if not getattr(self, name) > 0:
                raise ParameterError(f"NLP settings: {name} must be positive; got {getattr(self, name)}")

    def options(self) -> dict[str, Any]:
        """The same in CasADi's and IPOPT's words."""
        barrier: dict[str, Any] = {"ipopt.mu_strategy": "adaptive"}
        if self.barrier is not None:  # the strategy has to be said: with a limited memory IPOPT's default is to adapt
            barrier = {"ipopt.mu_strategy": "monotone", "ipopt.mu_init": self.barrier}
        return {
            "print_time": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.tol": self.tolerance,
            "ipopt.constr_viol_tol": self.constraint_tolerance,
            "ipopt.acceptable_tol": max(self.acceptable_tolerance, self.tolerance),
            "ipopt.max_iter": self.max_iterations,
            "ipopt.max_wall_time": min(self.max_seconds, 1e20),
            "ipopt.max_resto_iter": self.restoration,
            "ipopt.hessian_approximation": self.hessian.value,
            "ipopt.limited_memory_aug_solver": "extended",
            "ipopt.nlp_scaling_method": "gradient-based" if self.scaling else "none",
            "ipopt.linear_solver": self.linear_solver,
            **barrier,
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class NlpSolution:
    """Where IPOPT stopped, and why.

    Attributes:
        status: Why it stopped.
        reason: The same in IPOPT's own words.
        variables: The last point, shape (n,).
        objective: There.
        constraints: Values of the constraint functions there, shape (m,).
        infeasibility: Largest violation of a bound or constraint there.
        bound_multipliers: Shape (n,); negative at a lower bound.
        constraint_multipliers: Shape (m,); negative at a lower bound.
        iterations: How many.
        seconds: Wall time.
    """

    status: NlpStatus
    reason: str
    variables: Array
    objective: float
    constraints: Array
    infeasibility: float
    bound_multipliers: Array
    constraint_multipliers: Array
    iterations: int
    seconds: float

    def __post_init__(self) -> None:
        for name in ("variables", "constraints", "bound_multipliers", "constraint_multipliers"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def success(self) -> bool:
        """Whether the variables are a local optimum."""
        return self.status in (NlpStatus.CONVERGED, NlpStatus.ACCEPTABLE)

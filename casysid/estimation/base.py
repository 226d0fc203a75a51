"""What every estimator takes and gives.

An estimator is a frozen dataclass of hyperparameters. It sees :class:`~casysid.moments.Moments` only, and returns an
:class:`Estimate` that says how it stopped.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar, Protocol

import numpy as np

from casysid.arrays import Array, frozen
from casysid.moments import Moments


class Status(enum.Enum):
    """Why an estimator stopped; the value is the sentence the user reads."""

    CONVERGED = "converged"
    MAX_ITERATIONS = "reached the largest number of iterations before the tolerance"
    DEGENERATE = "the data leave nothing to estimate"


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """Unconstrained parameters with what is known about them.

    Attributes:
        method: Name of the estimator.
        parameters: ``θ``, shape (p,), in the regressor's units.
        covariance: Shape (p, p); infinite variance where the data see nothing.
        metric: ``G``, shape (p, p): the data's metric, in which a projection measures distance.
        noise_std: Residual standard deviation by joint, shape (joints,), [N m].
        rank: Number of directions that the data decided.
        status: Why it stopped.
        diagnostics: Further figures by name (strengths, bounds, iterations).
    """

    method: str
    parameters: Array
    covariance: Array
    metric: Array
    noise_std: Array
    rank: int
    status: Status
    diagnostics: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("parameters", "covariance", "metric", "noise_std"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "diagnostics", MappingProxyType(dict(self.diagnostics)))

    @property
    def std(self) -> Array:
        """Standard errors of the parameters, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))


class Estimator(Protocol):
    """A method that turns moments into parameters."""

    name: ClassVar[str]

    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Parameters that explain the moments; what the data cannot see stays at ``prior`` (zeros when None)."""
        ...

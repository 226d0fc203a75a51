"""What every estimator takes and gives.

An estimator is a frozen dataclass of hyperparameters. It sees :class:`~casysid.moments.Moments` only, and returns an
:class:`Estimate` that says how it stopped.
"""

from __future__ import annotations

import dataclasses
import enum
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.moments import Moments

LEVERAGE_TOLERANCE = 1e-6
"""A coordinate with more than this share of its squared length in unseen directions is unseen."""

ROUNDING = 1e-12
"""Relative eigenvalues below this are rounding."""


class Status(enum.Enum):
    """Why an estimator stopped; the value is the sentence the user reads."""

    CONVERGED = "converged"
    MAX_ITERATIONS = "reached the largest number of iterations before the tolerance"
    DEGENERATE = "the data leave nothing to estimate"


@dataclass(frozen=True, eq=False)
class Spread:
    """Covariance of parameters as far as the data see them, under coloured residuals.

    Attributes:
        covariance: Finite, shape (p, p): of every combination of parameters that the data see; others are left out.
        hidden: Basis of the directions that the data do not see, shape (p, p - r), orthonormal in units of ``scale``.
        scale: Of each parameter, shape (p,): what makes torque of unit energy.
        freedom: Degrees of freedom behind the covariance: intervals take Student's quantile; inf where not known.
        open: Covariance of what was open before the data, up to a factor, shape (p, p): the prior's, or parameters of
            size ``scale`` that have nothing to do with each other.
        settled: The part of it that the data have settled, shape (p, p).
    """

    covariance: Array
    hidden: Array
    scale: Array
    freedom: float
    open: Array
    settled: Array

    def __post_init__(self) -> None:
        for name in ("covariance", "hidden", "scale", "open", "settled"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @classmethod
    def without_prior(cls, covariance: Array, hidden: Array, scale: Array, freedom: float) -> Spread:
        """Of an estimator that leans on nothing: all that the data see they settle."""
        seen = np.eye(len(scale)) - hidden @ hidden.T
        sizes = np.outer(scale, scale)
        return cls(covariance, hidden, scale, freedom, np.diag(scale**2), sizes * seen)

    def decided(self, gradients: Array) -> Array:
        """Share of quantities of the given gradients (k, p) that the data decided and not the prior, shape (k,)."""
        before = np.einsum("km,mn,kn->k", gradients, self.open, gradients, optimize=True)
        after = np.einsum("km,mn,kn->k", gradients, self.settled, gradients, optimize=True)
        return np.asarray(np.clip(np.divide(after, before, out=np.zeros_like(before), where=before > 0.0), 0.0, 1.0))

    def decidable(self, gradients: Array, combinations: Array) -> Array:
        """Share that perfect data would decide of quantities (k, p), who show certain combinations (r, p), (k,)."""
        across = combinations @ self.open
        size = np.sqrt(np.maximum(np.einsum("rp,rp->r", across, combinations), np.finfo(np.float64).tiny))
        values, vectors = np.linalg.eigh((across @ combinations.T) / np.outer(size, size))
        sound = values > ROUNDING * values.max(initial=0.0)
        root = vectors[:, sound].T @ (across / size[:, None]) / np.sqrt(values[sound])[:, None]
        return dataclasses.replace(self, settled=root.T @ root).decided(gradients)

    def sees(self, gradients: Array) -> npt.NDArray[np.bool_]:
        """Whether the data tell quantities of the given gradients, shape (k, p); a boolean for each."""
        scaled = gradients * self.scale
        lost = np.sum((scaled @ self.hidden) ** 2, axis=1)
        return np.asarray(lost <= LEVERAGE_TOLERANCE * np.sum(scaled**2, axis=1))

    @property
    def marked(self) -> Array:
        """The covariance with infinite variance for parameters that the data do not tell by themselves, (p, p)."""
        covariance, unseen = self.covariance.copy(), ~self.sees(np.eye(len(self.scale)))
        covariance[unseen, :] = covariance[:, unseen] = 0.0
        covariance[unseen, unseen] = np.inf
        return covariance


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
        spread: The covariance of combinations, from blocks of time; None where the method has only ``covariance``.
    """

    method: str
    parameters: Array
    covariance: Array
    metric: Array
    noise_std: Array
    rank: int
    status: Status
    diagnostics: Mapping[str, float] = field(default_factory=dict)
    spread: Spread | None = None

    def __post_init__(self) -> None:
        for name in ("parameters", "covariance", "metric", "noise_std"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "diagnostics", MappingProxyType(dict(self.diagnostics)))

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "diagnostics": dict(self.diagnostics)}

    def __setstate__(self, state: Mapping[str, object]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    @property
    def std(self) -> Array:
        """Standard errors of the parameters, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))


Feasible = Callable[[Array, Array, float], Array]
"""The possible parameters nearest to some, (p,), in a metric (p, p), with the residual energy in its units."""


class Estimator(ABC):
    """A method that turns moments into parameters.

    Attributes:
        name: By which it is chosen.
        needs_input_noise: Whether it wants to know what noise of the measured motion has added to the moments.
    """

    name: ClassVar[str]
    needs_input_noise: ClassVar[bool] = False

    @abstractmethod
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Parameters that explain the moments; what the data cannot see stays at ``prior`` (zeros when None)."""

    def estimate_among(self, moments: Moments, prior: Array | None, feasible: Feasible) -> Estimate:
        """The same where only some parameters are possible; a method that has no use for that does not ask.

        Args:
            moments: Of the data.
            prior: As for :meth:`estimate`.
            feasible: Gives the possible parameters nearest to some.
        """
        return self.estimate(moments, prior)

"""How sure an answer is: from the estimate through the projection to links, drives and torques.

A parametric bootstrap: the answer is taken for the truth, estimates are drawn about it as the noise would scatter them,
and each is projected as the estimate was. So a law that binds narrows the answer as much as it really does, and an
answer on a bound is not taken for certain, as it would be if estimates far beyond the bound were drawn. What the data
do not see has infinite standard error, however near to the prior the projection has put it; only the laws' own bounds,
such as positive mass, limit it.

Source: Efron and Tibshirani (1993), §6.5.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.estimation import Estimate
from casysid.estimation.base import LEVERAGE_TOLERANCE, Spread
from casysid.estimation.covariance import covariance_from_blocks
from casysid.inertia import is_consistent, mass_properties
from casysid.moments import Moments
from casysid.projection import ParameterLike, ProjectionProblem, ProjectionResult, project_samples
from casysid.threads import single_threaded

SAMPLES = 40
"""Projected samples: standard errors are known to some 10 % of themselves."""
CHUNK = 4_000
"""Samples of a motion that are evaluated at once."""
INERTIA_ORDER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""xx yy zz xy xz yz, the order in which a link's inertia is reported."""
PARAMETER_OF_INERTIA = (4, 6, 9, 5, 7, 8)
"""Places of the same entries among Pinocchio's ten parameters."""
POSITIVE = np.array([1, 0, 0, 0, 1, 1, 1, 0, 0, 0], dtype=bool)
"""Of mass, centre of mass and inertia xx yy zz xy xz yz: what cannot be negative."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterUncertainty:
    """Standard errors and 95 % intervals of an answer.

    Attributes:
        parameters: The answer, shape (p,).
        covariance: Mean square error of every combination that the data see, after the projection; finite, (p, p).
        std: Of each parameter; infinite where the data do not tell it by itself, shape (p,).
        links: Mass, centre of mass and inertia about it (xx yy zz xy xz yz) of each link, shape (links, 10).
        link_std: Their standard errors, infinite likewise, shape (links, 10).
        freedom: Degrees of freedom; inf where not known.
        non_negative: Which of the p parameters cannot be negative, shape (p,).
        spread: Of the estimate before the projection: what the data see, and what they decided.
        hidden: Basis of the directions that neither data nor knowledge tell, shape (p, k), in units of the spread's
            scale.
    """

    parameters: Array
    covariance: Array
    std: Array
    links: Array
    link_std: Array
    freedom: float
    non_negative: Array
    spread: Spread
    hidden: Array

    def __post_init__(self) -> None:
        for name in ("parameters", "covariance", "std", "links", "link_std", "hidden"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def quantile(self, level: float = 0.95) -> float:
        """Half the width of a two-sided interval in standard errors."""
        return float(student.ppf(0.5 + level / 2.0, self.freedom))

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Lower and upper ends of the parameters' intervals, shape (p,) each."""
        return _interval(self.parameters, self.quantile(level) * self.std, self.non_negative)

    def link_interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Lower and upper ends of the links' intervals, in the order of ``links``, shape (links, 10) each."""
        return _interval(self.links, self.quantile(level) * self.link_std, POSITIVE)


@single_threaded()
def propagate(
    estimate: Estimate,
    moments: Moments,
    parameters: Sequence[ParameterLike],
    problem: ProjectionProblem | None = None,
    projection: ProjectionResult | None = None,
    prior: Array | None = None,
    *,
    residual_energy: float | None = None,
    samples: int = SAMPLES,
    seed: int = 0,
) -> ParameterUncertainty:
    """Carry an estimate's covariance to the consistent parameters and to the links' physical quantities.

    Args:
        estimate: The unconstrained estimate.
        moments: What it was fitted to; used when the estimator gives no covariance from blocks itself.
        parameters: The regressor's columns.
        problem: Its projection; None when the answer is the estimate.
        projection: What came of it.
        prior: As for the projection.
        residual_energy: As for the projection.
        samples: How many samples are projected.
        seed: Of their draw.
    """
    spread = estimate.spread or covariance_from_blocks(moments, estimate.parameters, estimate.noise_std**-2.0)
    inertial = 10 * sum(parameter.kind == "m" for parameter in parameters)
    non_negative = np.array([parameter.non_negative or parameter.kind == "m" for parameter in parameters])
    if problem is None or projection is None:
        nothing, free = np.zeros((0, len(non_negative))), np.zeros_like(non_negative)
        return _uncertainty(estimate.parameters, spread.covariance, spread, nothing, inertial, free)
    covariance = spread.covariance
    answer = projection.parameters
    drawn = answer + _deviations(covariance, samples, seed)
    if not (_is_free(problem, projection) and all(_is_inside(problem, point) for point in drawn)):
        projected = project_samples(problem, drawn, estimate.metric, prior, projection, residual_energy=residual_energy)
        error = projected[np.isfinite(projected).all(axis=1)] - answer
        covariance = error.T @ error / len(error) if len(error) else covariance
    rows = problem.constraints
    known = np.vstack([np.eye(len(rows.kept))[rows.kept], rows.matrix[rows.lower == rows.upper]])
    return _uncertainty(answer, covariance, spread, known, inertial, non_negative)


@single_threaded()
def torque_std(
    regressor: Regressor, covariance: Array, q: Array, v: Array, a: Array, *, time: Array | None = None
) -> Array:
    """Standard error of the predicted torque that comes of the parameters', shape (N, nv), [N m].

    A band for a measured torque adds the residuals: ``√(torque_std² + noise_std²)``.

    Args:
        regressor: The regressor.
        covariance: Of its parameters, finite, shape (p, p): motions that show what the data did not are not warned of.
        q: Shape (N, nq).
        v: Shape (N, nv).
        a: Shape (N, nv).
        time: Of the samples, whose friction may remember those before [s], shape (N,); None numbers them.
    """
    result, histories = np.empty((len(q), regressor.robot.nv)), regressor.histories(q, time)
    for start in range(0, len(q), CHUNK):
        rows = slice(start, start + CHUNK)
        Y = regressor.evaluate(q[rows], v[rows], a[rows], histories=tuple(one[rows] for one in histories))
        result[rows] = np.sqrt(np.maximum(np.einsum("njp,njp->nj", Y @ covariance, Y), 0.0))
    return result


def _deviations(covariance: Array, samples: int, seed: int) -> Array:
    """Samples of a Gaussian around zero in pairs of opposite sign, shape (samples, p)."""
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
    values, vectors = np.linalg.eigh(covariance * np.outer(unit, unit))
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    half = np.random.default_rng(seed).standard_normal((-(-samples // 2), len(size)))
    return np.asarray(np.concatenate([half, -half]) @ root.T)


def _is_free(problem: ProjectionProblem, projection: ProjectionResult) -> bool:
    """Whether nothing bound the answer, so that samples near it need no projection."""
    return not projection.active and not len(problem.constraints.matrix) and not problem.constraints.kept.any()


def _is_inside(problem: ProjectionProblem, point: Array) -> bool:
    layout = problem.layout
    bodies = point[: layout.inertial].reshape(-1, 10)
    consistent = bool(np.all(is_consistent(bodies, problem.consistency)))
    return consistent and bool((point[list(layout.non_negative)] >= 0.0).all())


def _uncertainty(
    parameters: Array, covariance: Array, spread: Spread, known: Array, inertial: int, non_negative: Array
) -> ParameterUncertainty:
    """Standard errors of parameters and links; ``known``, shape (k, p): gradients of what is known beside the data."""
    p, bodies = len(parameters), parameters[:inertial].reshape(-1, 10)
    gradients = np.zeros((len(bodies), 10, p))
    for link, body in enumerate(bodies):
        gradients[link, :, 10 * link : 10 * link + 10] = link_gradient(body)
    told = _with_known(spread, known)
    link_std = _standard_errors(gradients.reshape(-1, p), covariance, told).reshape(-1, 10)
    return ParameterUncertainty(
        parameters=parameters,
        covariance=covariance,
        std=_standard_errors(np.eye(p), covariance, told),
        links=link_quantities(bodies),
        link_std=link_std,
        freedom=spread.freedom,
        non_negative=non_negative,
        spread=spread,
        hidden=told.hidden,
    )


def _with_known(spread: Spread, known: Array) -> Spread:
    """The spread, with nothing hidden along what is known otherwise."""
    left = (known * spread.scale) @ spread.hidden
    if not left.any():
        return spread
    _, size, directions = np.linalg.svd(left)
    rank = int((size > LEVERAGE_TOLERANCE * size[0]).sum())
    return dataclasses.replace(spread, hidden=spread.hidden @ directions[rank:].T)


def _standard_errors(gradients: Array, covariance: Array, spread: Spread) -> Array:
    """``√diag(J C Jᵀ)`` for gradients of shape (k, p); infinite for what neither data nor knowledge tell."""
    finite = np.asarray(np.isfinite(gradients).all(axis=1))
    J = np.where(finite[:, None], gradients, 0.0)
    variance = np.einsum("km,mn,kn->k", J, covariance, J, optimize=True)
    return np.where(finite & spread.sees(J), np.sqrt(np.maximum(variance, 0.0)), np.inf)


def link_quantities(bodies: Array) -> Array:
    """Mass, centre of mass, inertia about it (xx yy zz xy xz yz) of links given by their parameters, both (n, 10)."""
    properties = mass_properties(bodies)
    inertia = np.stack([properties.inertia[:, i, k] for i, k in INERTIA_ORDER], axis=1)
    return np.column_stack([properties.mass, properties.center_of_mass, inertia])


def link_gradient(parameters: Array) -> Array:
    """Derivative of a link's quantities by its ten parameters, shape (10, 10); infinite where there is no mass."""
    m, h = float(parameters[0]), parameters[1:4]
    gradient = np.zeros((10, 10))
    gradient[0, 0] = 1.0
    if m == 0.0:
        gradient[1:] = np.inf
        return gradient
    gradient[1:4, 0] = -h / m**2
    gradient[1:4, 1:4] = np.eye(3) / m
    by_mass = (h @ h * np.eye(3) - np.outer(h, h)) / m**2
    for row, (i, k) in enumerate(INERTIA_ORDER):
        gradient[4 + row, 0] = by_mass[i, k]
        gradient[4 + row, PARAMETER_OF_INERTIA[row]] = 1.0
        for axis, e in enumerate(np.eye(3)):
            gradient[4 + row, 1 + axis] = -(2.0 * h[axis] * (i == k) - e[i] * h[k] - h[i] * e[k]) / m
    return gradient


def _interval(value: Array, half: Array, non_negative: Array) -> tuple[Array, Array]:
    lower = value - half
    return np.where(non_negative, np.maximum(lower, 0.0), lower), value + half

"""The evidence of a linear model with a size for every group of parameters and a variance for every joint's rows.

Deviations ``δ = θ - θ0`` of a group are Gaussian with covariance ``λ_g K_g``: the shape ``K_g`` is known beforehand,
the size ``λ_g`` maximises the evidence, as do the variances ``σ_j²`` with what the fit took away given back. The
likelihood is raised to the power ``1/κ``, because residuals are coloured and averaging windows overlap: ``κ`` is the
variance of the blocks' scores over that of white residuals.

Where parameters have to be possible, the posterior's mode among the possible ones takes the place of its mean: a prior
that lets masses be negative would explain with them what is an offset of the sensor.

Source: MacKay 1992, *Bayesian Interpolation* (the sizes); Patterson and Thompson 1971 (restricted maximum likelihood,
the variances); Varin, Reid and Firth 2011, *An overview of composite likelihood methods*, §4 (the power).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.estimation.base import Feasible, Status
from casysid.estimation.prior_covariance import links_among
from casysid.estimation.standardise import estimate_noise_std
from casysid.inertia import KINDS, relative_covariance
from casysid.moments import Indices, Moments

OVERLAP_INFLATION = 1.49
"""``∫ sinc¹⁶ / (∫ sinc⁸)²``: variance inflation of white torque noise by overlapping cubic B-spline windows."""
FEWEST_BLOCKS = 4
"""Scores of fewer blocks say nothing of ``κ``."""
SEEN = 1e-4
"""Directions of less information than this share of the strongest have no say in ``κ``: their scores are rounding."""
SIZES = (1e-6, 1e6)
"""Of ``λ``, squares of a relative deviation: a thousandth is below what any torque sensor shows, a thousand is open."""
VARIANCE_FLOOR = 1e-10
"""Of ``σ²`` over the mean square of the target: perfect data end there."""
CAREFUL_ROUNDS = 3
"""Rounds with the update of expectation-maximisation, which cannot overshoot from the start."""
UNDECIDED = 1e-6
"""Of fewer parameters than this a group's size is left as it is: it is divided by them, and both are rounding."""
INFLATION_EVERY = 8
"""Rounds from one ``κ`` to the next: it changes little, and costs as much as several rounds."""
STEADY = 2e-2
"""Change of ``log λ`` that ends the search: a hundredth in a deviation; that of a group of which the data decide less
than one parameter counts by so much less."""
LINKS, UNOWNED = "links", "columns"
"""Names of the groups that are measured from the prior; drives are measured from zero."""


class Group(NamedTuple):
    """Parameters that share one size: a name for people, and their places."""

    name: str
    columns: Indices


def groups_of(columns: Sequence[str]) -> tuple[Group, ...]:
    """All links together, and each kind of drive parameter by itself; columns without an owner are one group."""
    links = links_among(columns)
    bodies = np.concatenate([np.arange(link.start, link.stop) for link in links]) if links else np.zeros(0, np.intp)
    inside, kinds = set(bodies.tolist()), dict[str, list[int]]()
    for place, name in enumerate(columns):
        if place not in inside:
            owner, _, kind = name.rpartition(".")
            kinds.setdefault(kind.split(" #")[0] if owner else UNOWNED, []).append(place)
    found = [Group(LINKS, bodies)] if len(bodies) else []
    return (*found, *(Group(kind, np.array(places)) for kind, places in kinds.items()))


def seen_columns(moments: Moments) -> npt.NDArray[np.bool_]:
    """Which columns have any energy, shape (p,); all of a link's do if one has."""
    seen = np.zeros(len(moments.columns), dtype=bool)
    for own, sums in zip(moments.row_columns, moments.squares, strict=True):
        seen[own] |= np.einsum("bmm->m", sums)[:-1] > 0.0
    for link in links_among(moments.columns):
        seen[link] = seen[link].any()
    return seen


def centre_of(moments: Moments, prior: Array) -> Array:
    """About what parameters scatter, shape (p,): the prior for links, zero for drives, whose file values mean little.

    Columns that the data do not see keep the prior's value.
    """
    seen, centre = seen_columns(moments), prior.copy()
    for group in groups_of(moments.columns):
        if group.name not in (LINKS, UNOWNED):
            centre[group.columns] = np.where(seen[group.columns], 0.0, prior[group.columns])
    return centre


class Start(NamedTuple):
    """Where a search begins: variances of the joints' rows, ``κ``, and sizes by the names of groups."""

    variance: Array
    kappa: float
    sizes: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class EvidenceFit:
    """The fit of most evidence.

    Attributes:
        mean: ``δ``, the posterior's mean, shape (p,).
        covariance: Of the posterior, shape (p, p).
        variance: ``σ²`` of each joint's rows, shape (joints,).
        kappa: ``κ``.
        sizes: ``λ`` by group.
        size_by_column: The same for each column, shape (p,).
        decided: How many parameters of each group the data decide.
        status: Why it stopped.
        iterations: How many.
    """

    mean: Array
    covariance: Array
    variance: Array
    kappa: float
    sizes: dict[str, float]
    size_by_column: Array
    decided: dict[str, float]
    status: Status
    iterations: int


@dataclass(frozen=True, eq=False)
class EvidenceProblem:
    """Moments relative to the centre, and the shapes of the groups' covariances.

    Attributes:
        moments: Relative to the centre.
        count: Rows of each joint, shape (joints,).
        groups: Of parameters.
        covariance: ``K``, block diagonal, shape (p, p).
        precision: ``K⁻¹``, shape (p, p).
        start: Variances of weighted least squares, shape (joints,).
        floor: Of the variances, shape (joints,).
    """

    moments: Moments
    count: Array
    groups: tuple[Group, ...]
    covariance: Array
    precision: Array
    start: Array
    floor: Array

    def maximise(
        self, iterations: int, tolerance: float, feasible: Feasible | None = None, start: Start | None = None
    ) -> EvidenceFit:
        """Iterate posterior, variances, sizes and inflation until none of them moves.

        Args:
            iterations: At most.
            tolerance: Of the change of ``δ`` in units of its noise.
            feasible: Gives the possible ``δ`` nearest to one; None when all are possible.
            start: Where to begin; None with weighted least squares and sizes of one.
        """
        totals = [sums.sum(axis=0) for sums in self.moments.squares]
        start = start or Start(self.start, 1.0, {})
        variance, kappa = start.variance.copy(), start.kappa
        sizes = np.array([start.sizes.get(group.name, 1.0) for group in self.groups])
        new_groups = np.array([group.name not in start.sizes for group in self.groups])
        settled_after = 0 if start.sizes else INFLATION_EVERY
        delta, status = np.zeros(len(self.covariance)), Status.MAX_ITERATIONS
        for iteration in range(1, iterations + 1):
            normal = self.moments.pooled(1.0 / (kappa * variance))
            by_column = self._by_column(sizes)
            P = normal.xx + self.precision / np.sqrt(np.outer(by_column, by_column))
            C = inverse(P)
            mean = C @ normal.xy
            new = mean if feasible is None else feasible(mean, P, normal.residual_energy(mean))
            step = new - delta
            moved, delta = float(np.sqrt(max(float(step @ normal.xx @ step), 0.0))), new
            variance = self._variances(totals, delta, C)
            decided = np.array([self._decided(group, C, size) for group, size in zip(self.groups, sizes, strict=True)])
            wanted: Array = self._sizes(delta, C, decided, new_groups & (iteration <= CAREFUL_ROUNDS))
            change = float((np.abs(np.log(wanted / sizes)) * np.minimum(decided, 1.0)).max(initial=0.0))
            sizes = wanted
            if iteration % INFLATION_EVERY == 1:
                kappa = self._inflation(delta, variance)
            if iteration > settled_after and moved < tolerance and change < STEADY:
                status = Status.CONVERGED
                break
        names = [group.name for group in self.groups]
        return EvidenceFit(
            mean=mean,
            covariance=C,
            variance=variance,
            kappa=kappa,
            sizes=dict(zip(names, sizes.tolist(), strict=True)),
            size_by_column=by_column,
            decided=dict(zip(names, decided.tolist(), strict=True)),
            status=status,
            iterations=iteration,
        )

    def _by_column(self, sizes: Array) -> Array:
        by_column = np.ones(len(self.covariance))
        for group, size in zip(self.groups, sizes, strict=True):
            by_column[group.columns] = size
        return by_column

    def _variances(self, totals: Sequence[Array], delta: Array, C: Array) -> Array:
        """Restricted maximum likelihood; a joint is explained no better near rest than while it moves."""
        variance = self.floor.copy()
        for j, (own, total) in enumerate(zip(self.moments.row_columns, totals, strict=True)):
            if self.count[j] > 0.0:
                r = np.append(-delta[own], 1.0)
                given_back = float(np.sum(total[:-1, :-1] * C[own[:, None], own]))
                variance[j] = max((float(r @ total @ r) + given_back) / self.count[j], self.floor[j])
        return np.maximum(variance, variance[self.moments.moving_rows])

    def _decided(self, group: Group, C: Array, size: float) -> float:
        g = group.columns
        left = float(np.sum(self.precision[g[:, None], g] * C[g[:, None], g])) / size
        return min(max(len(g) - left, np.finfo(np.float64).eps), float(len(g)))

    def _sizes(self, delta: Array, C: Array, decided: Array, careful: npt.NDArray[np.bool_]) -> Array:
        """MacKay's update; that of expectation-maximisation in a group's first rounds, and where nothing is decided."""
        found = []
        for group, gamma, first in zip(self.groups, decided, careful, strict=True):
            g = group.columns
            Q = self.precision[g[:, None], g]
            length = float(delta[g] @ Q @ delta[g])
            open_still = (length + float(np.sum(Q * C[g[:, None], g]))) / len(g)
            found.append(open_still if first or gamma < UNDECIDED else length / gamma)
        return np.asarray(np.clip(np.array(found, dtype=np.float64), *SIZES))

    def _inflation(self, delta: Array, variance: Array) -> float:
        """``κ``, at least one: ``Σ ‖Wᵀ s_b‖² / (rank - Σ ‖Wᵀ I_b W‖²)`` over blocks, ``W`` whitening ``Σ I_b``."""
        if self.moments.blocks < FEWEST_BLOCKS:
            return OVERLAP_INFLATION
        scores, information = self.moments.scores(delta, 1.0 / variance), self.moments.pooled(1.0 / variance).xx
        size = np.sqrt(np.diag(information))
        unit = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
        values, vectors = np.linalg.eigh(information * np.outer(unit, unit))
        seen = values > SEEN * values.max(initial=0.0)
        W = unit[:, None] * vectors[:, seen] / np.sqrt(values[seen])
        shared = sum(float(np.sum((W.T @ I[:-1, :-1] @ W) ** 2)) for I in self.moments.by_block(1.0 / variance))  # noqa: E741
        expected = float(seen.sum()) - shared
        return max(1.0, float(np.sum((scores @ W) ** 2)) / expected) if expected > 0.0 else OVERLAP_INFLATION


def build_evidence_problem(moments: Moments, centre: Array) -> EvidenceProblem:
    """The problem relative to a centre of shape (p,); joints without torque are held to be as noisy as the others."""
    shifted, count = moments.shifted(centre), moments.count.sum(axis=0)
    logged = np.maximum(moments.target_energy().sum(axis=0), 0.0) / np.maximum(count, 1.0)
    logged = np.where(logged > 0.0, logged, logged.max(initial=0.0) or 1.0)
    floor = VARIANCE_FLOOR * logged
    K = _shape(shifted, centre)
    return EvidenceProblem(
        moments=shifted,
        count=count,
        groups=groups_of(moments.columns),
        covariance=K,
        precision=inverse(K),
        start=np.maximum(estimate_noise_std(shifted) ** 2, floor),
        floor=floor,
    )


def inverse(matrix: Array) -> Array:
    """Of a positive definite matrix, scaled to unit diagonal first."""
    size = 1.0 / np.sqrt(np.diag(matrix))
    found = np.linalg.inv(matrix * np.outer(size, size))
    return 0.5 * (found + found.T) * np.outer(size, size)


def _shape(shifted: Moments, centre: Array) -> Array:
    """``K``: of known bodies the geometry of their pseudo-inertias, of all else what explains a torque alone."""
    reach = np.zeros(len(centre))
    for own, sums in zip(shifted.row_columns, shifted.squares, strict=True):
        energy = np.maximum(np.einsum("bmm->m", sums), 0.0)
        there = energy[:-1] > 0.0
        alone = np.sqrt(energy[-1] / np.where(there, energy[:-1], np.inf))
        reach[own] = np.maximum(reach[own], alone)
    K = np.diag(np.where(reach > 0.0, reach, reach.max(initial=0.0) or 1.0) ** 2)
    links = [link for link in links_among(shifted.columns) if centre[link.start] > 0.0]
    bodies = relative_covariance(np.array([centre[link] for link in links]).reshape(-1, len(KINDS)))
    for link, covariance in zip(links, bodies, strict=True):
        K[link, link] = covariance
    return K

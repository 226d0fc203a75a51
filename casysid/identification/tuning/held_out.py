"""Torque errors on stretches of time left out, of a model with and without a few more columns.

For each stretch the fit to the rest is ridge, ``(H + P) θ = b``, with the pull ``P`` of the fit to all data, among
the parameters that laws allow: an unconstrained fit to a few minutes explains with impossible bodies and driving
friction what they never were, and fails on the next minute. The laws that hold the fit without a candidate are kept as
equalities while candidates are compared: in the directions ``N`` that they leave free, with ``W = N (Nᵀ (H_BB + P_BB)
N)⁻¹ Nᵀ`` and the model's columns ``B`` eliminated, the columns ``C`` that may join are left with the small system
``(H_CC - H_CB W H_BC) θ_C = b_C - H_CB θ_B``, so that a candidate costs next to nothing. What is to join is then fitted
anew under all laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from casysid.arrays import Array
from casysid.identification.tuning.log_score import HeldOutScore
from casysid.moments import Indices, Moments
from casysid.projection import HalfSpaces, nearest_in_half_spaces

FOLDS = 5
"""Contiguous stretches of time that are left out one after the other: the field's usual number."""
LEAST_PULL = 1e-9
"""Of every column's energy: columns that depend on each other can then be eliminated."""


Columns = Sequence[int]


class _Elimination(NamedTuple):
    """Training sums with the model's columns eliminated: ``[W H_BC, θ_B]`` (b, c + 1), the rest, (c + 1, c + 1)."""

    Z: Array
    rest: Array


class _Lawful(NamedTuple):
    """A fit under laws: its columns, their parameters, the root of their normal matrix, and the laws that hold them."""

    columns: Indices
    theta: Array
    root: Array
    holding: Array


class HeldOut:
    """Errors on stretches of time left out, under ridge among lawful parameters on the others."""

    def __init__(
        self,
        moments: Moments,
        model: Indices,
        weights: Array,
        pull: Array,
        folds: Sequence[Indices],
        laws: HalfSpaces | None = None,
    ) -> None:
        """Eliminate the model's columns for every stretch.

        Args:
            moments: Of all columns, relative to what the pull draws to.
            model: Columns that are in the model, shape (b,).
            weights: ``1/σ²`` of the joints' rows, shape (joints,).
            pull: Of the model's columns, in units of the weighted rows, shape (b, b).
            folds: Blocks of each stretch.
            laws: Half-spaces of all columns' parameters, relative to what the pull draws to.
        """
        p = len(moments.columns)
        self._laws = laws or HalfSpaces(np.zeros((0, p)), np.zeros(0))
        self._stretches, self._model = moments.merged_blocks(folds), model
        self._others = np.append(np.setdiff1d(np.arange(p), model), p)
        self._place = {int(column): k for k, column in enumerate(self._others)}
        parts = list(self._stretches.by_block(weights))
        total: Array = np.sum(parts, axis=0)
        self._pull, self._energy = pull, np.diag(total)
        counts = self._stretches.count.sum(axis=1)
        factors = counts.sum() / np.maximum(counts.sum() - counts, 1.0)
        self._training = [(total - part) * factor for part, factor in zip(parts, factors, strict=True)]
        self._fits = [self._eliminate(square) for square in self._training]
        self._whole = self._eliminate(total)

    def _system(self, square: Array, columns: Columns, without: Columns) -> tuple[Indices, Array]:
        """The columns of the model but some, and some more, and their normal matrix with the pull."""
        kept = ~np.isin(self._model, without)
        own = np.array([*self._model[kept], *columns])
        system = square[own[:, None], own] + LEAST_PULL * np.diag(self._energy[own])
        system[: kept.sum(), : kept.sum()] += self._pull[np.ix_(kept, kept)]
        return own, system

    def _lawful(self, square: Array, columns: Columns = (), without: Columns = ()) -> _Lawful:
        """The fit of the model's columns but some, and some more, under all laws."""
        own, system = self._system(square, columns, without)
        size = 1.0 / np.sqrt(np.maximum(np.diag(system), np.finfo(np.float64).tiny))
        root = cholesky(system * np.outer(size, size)) / size
        target = solve_triangular(root, square[own, -1], trans="T")
        about = (self._laws.rows[:, own] != 0.0).any(axis=1)
        rows = solve_triangular(root, self._laws.rows[np.ix_(about, own)].T, trans="T").T
        near = nearest_in_half_spaces(target, rows, self._laws.lower[about])
        found, holding = (target, rows[:0]) if near is None else near
        return _Lawful(own, solve_triangular(root, found), root, holding)

    def _eliminate(self, square: Array) -> _Elimination:
        B, C = self._model, self._others
        _, theta, root, holding = self._lawful(square)
        reached = solve_triangular(root, square[B[:, None], C], trans="T")
        if len(holding):
            held = np.linalg.qr(holding.T)[0]
            reached -= held @ (held.T @ reached)
        Z = solve_triangular(root, reached)
        Z[:, -1] = theta
        return _Elimination(Z, square[C[:, None], C] - square[C[:, None], B] @ Z)

    def score(self, columns: Columns = ()) -> HeldOutScore:
        """Of the model with some more columns, held by the laws that hold the model."""
        return self._scored([self._solve(fit, columns) for fit in self._fits])

    def lawful_score(self, columns: Columns = (), without: Columns = ()) -> HeldOutScore:
        """Of the model with some more columns and without some of its own, held by whichever laws hold them."""
        thetas = np.zeros((len(self._training), len(self._energy) - 1))
        for theta, square in zip(thetas, self._training, strict=True):
            fit = self._lawful(square, columns, without)
            theta[fit.columns] = fit.theta
        return self._scored(thetas)

    def _scored(self, thetas: Sequence[Array] | Array) -> HeldOutScore:
        energies = np.array([self._stretches.residual_energy(theta) for theta in thetas])  # (fits, stretches, joints)
        own = np.einsum("ffj->fj", energies)
        rows = self._stretches.count
        training = energies.sum(axis=1) - own
        return HeldOutScore(
            energy=own,
            target=self._stretches.target_energy(),
            count=rows,
            variance=training / np.maximum(rows.sum(axis=0) - rows, 1.0),
        )

    def fit(self, columns: Columns = ()) -> Array:
        """Parameters from all data with some more columns in the model, shape (p,)."""
        return self._solve(self._whole, columns)

    def gain(self, columns: Columns, noise: float) -> float:
        """Evidence for some columns to join: ``½ (q - d - d ln(q / d))``, zero where ``q <= d``.

        Args:
            columns: ``d`` of them.
            noise: Variance of the weighted rows, ``κ``.

        Source: the gain of the marginal likelihood by a group of columns whose size is free (Tipping and Faul 2003).
        """
        C, d = [self._place[column] for column in columns], len(columns)
        S, r = self._whole.rest[np.ix_(C, C)], self._whole.rest[C, -1]
        size = np.sqrt(np.maximum(self._energy[list(columns)], np.finfo(np.float64).tiny))
        S = S / np.outer(size, size)
        if np.diag(S).min() <= LEAST_PULL:
            return 0.0
        q = float(r / size @ np.linalg.solve(S + LEAST_PULL * np.eye(d), r / size)) / noise
        return 0.5 * (q - d - d * float(np.log(q / d))) if q > d else 0.0

    def _solve(self, fit: _Elimination, columns: Columns) -> Array:
        C = [self._place[column] for column in columns]
        pull = LEAST_PULL * np.diag(self._energy[list(columns)])
        found = np.linalg.solve(fit.rest[np.ix_(C, C)] + pull, fit.rest[C, -1]) if C else np.zeros(0)
        theta = np.zeros(len(self._energy) - 1)
        theta[list(columns)] = found
        theta[self._model] = fit.Z[:, -1] - fit.Z[:, C] @ found
        return theta

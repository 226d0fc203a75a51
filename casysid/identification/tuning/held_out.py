"""Torque errors on stretches of time left out, of a model with and without a few more columns.

For each stretch the fit to the rest is ridge, ``(H + P) θ = b``, with the pull ``P`` of the fit to all data. With the
model's columns ``B`` eliminated, ``Z = (H_BB + P_BB)⁻¹ [H_BC, b_B]``, the columns ``C`` that may join are left with the
small system ``(H_CC - H_CB Z) θ_C = b_C - H_CB Z_b``, so that a candidate costs next to nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from casysid.arrays import Array
from casysid.identification.tuning.log_score import HeldOutScore
from casysid.moments import Indices, Moments

FOLDS = 5
"""Contiguous stretches of time that are left out one after the other: the field's usual number."""
LEAST_PULL = 1e-9
"""Of every column's energy: columns that depend on each other can then be eliminated."""


class _Elimination(NamedTuple):
    """Training sums with the model's columns eliminated: ``Z`` (b, c + 1), and the rest, (c + 1, c + 1)."""

    Z: Array
    rest: Array


class HeldOut:
    """Errors on stretches of time left out, under ridge on the others."""

    def __init__(self, moments: Moments, model: Indices, weights: Array, pull: Array, folds: Sequence[Indices]) -> None:
        """Eliminate the model's columns for every stretch.

        Args:
            moments: Of all columns, relative to what the pull draws to.
            model: Columns that are in the model, shape (b,).
            weights: ``1/σ²`` of the joints' rows, shape (joints,).
            pull: Of the model's columns, in units of the weighted rows, shape (b, b).
            folds: Blocks of each stretch.
        """
        p = len(moments.columns)
        self._stretches, self._model = moments.merged_blocks(folds), model
        self._others = np.append(np.setdiff1d(np.arange(p), model), p)
        self._place = {int(column): k for k, column in enumerate(self._others)}
        parts = list(self._stretches.by_block(weights))
        total: Array = np.sum(parts, axis=0)
        self._pull = pull + LEAST_PULL * np.diag(np.diag(total)[model])
        self._square, self._energy = total, np.diag(total)
        counts = self._stretches.count.sum(axis=1)
        self._factors = counts.sum() / np.maximum(counts.sum() - counts, 1.0)
        self._fits = [
            self._eliminate((total - part) * factor) for part, factor in zip(parts, self._factors, strict=True)
        ]
        self._whole = self._eliminate(total)
        self._total = moments.merged_blocks([np.arange(moments.blocks)])

    def _eliminate(self, square: Array) -> _Elimination:
        B, C = self._model, self._others
        system = square[B[:, None], B] + self._pull
        size = 1.0 / np.sqrt(np.diag(system))
        Z = size[:, None] * np.linalg.solve(system * np.outer(size, size), size[:, None] * square[B[:, None], C])
        return _Elimination(Z, square[C[:, None], C] - square[C[:, None], B] @ Z)

    def score(self, columns: Sequence[int] = ()) -> HeldOutScore:
        """Of the model with some more columns."""
        thetas = [self._solve(fit, columns) for fit in self._fits]
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

    def fit(self, columns: Sequence[int] = ()) -> Array:
        """Parameters from all data with some more columns in the model, shape (p,)."""
        return self._solve(self._whole, columns)

    def covariance(self, columns: Sequence[int], noise: float) -> Array:
        """Of the parameters of :meth:`fit`, zero for those that are not in it, shape (p, p).

        Args:
            columns: That join the model.
            noise: Variance of the weighted rows, ``κ``.
        """
        own = np.array([*self._model, *columns])
        precision = self._square[own[:, None], own] + LEAST_PULL * np.diag(self._energy[own])
        precision[: len(self._model), : len(self._model)] += self._pull
        size = np.sqrt(np.maximum(np.diag(precision), np.finfo(np.float64).tiny))
        covariance = np.zeros((len(self._energy) - 1,) * 2)
        covariance[own[:, None], own] = noise * np.linalg.pinv(precision / np.outer(size, size)) / np.outer(size, size)
        return covariance

    def gain(self, columns: Sequence[int], noise: float) -> float:
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

    def _solve(self, fit: _Elimination, columns: Sequence[int]) -> Array:
        C = [self._place[column] for column in columns]
        pull = LEAST_PULL * np.diag(self._energy[list(columns)])
        found = np.linalg.solve(fit.rest[np.ix_(C, C)] + pull, fit.rest[C, -1]) if C else np.zeros(0)
        theta = np.zeros(len(self._energy) - 1)
        theta[list(columns)] = found
        theta[self._model] = fit.Z[:, -1] - fit.Z[:, C] @ found
        return theta

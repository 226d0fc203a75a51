"""Held-out torque errors of a model with and without a few more columns, for very many such columns at once.

For each stretch of time left out, the fit to the rest is ridge: ``(H + P) θ = b``, with the pull ``P`` of the fit to
all data. With the model's columns ``B`` eliminated, ``Z = (H_BB + P_BB)⁻¹ [H_BC, b_B]``, the columns ``C`` that may
join are left with the small system ``(H_CC - H_CB Z + P_CC) θ_C = b_C - H_CB Z_b``, and the residual of a joint in the
stretch is a quadratic form in ``θ_C`` alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve

from casysid.arrays import Array
from casysid.moments import Moments

Indices = npt.NDArray[np.intp]

LEAST_STRENGTH = 1e-9
"""Of the ridge, so that columns that depend on each other can be eliminated."""
NEGLIGIBLE = 1e-6
"""Share of the torque's energy that is not worth explaining."""


class _Elimination(NamedTuple):
    """The model's columns eliminated from one fit: ``Z`` (b, c + 1) and the system of the others, (c, c) and (c,)."""

    model: Array
    matrix: Array
    right: Array


class HeldOutErrors:
    """Residual energies of stretches of time that were left out, under ridge on the rest."""

    def __init__(
        self,
        moments: Moments,
        model: Indices,
        weights: Array,
        pull: Array,
        strength: float,
        stretches: Sequence[Indices],
    ) -> None:
        """Eliminate the columns ``model`` for every stretch.

        Args:
            moments: Of all columns, in blocks of time.
            model: Columns that are in the model.
            weights: ``1/σ²`` of the joints' rows, shape (joints,).
            pull: Of the model's columns to the prior, in units of the weighted rows, shape (b, b).
            strength: Of the other columns' pull, on columns of unit energy.
            stretches: Blocks that are left out, for each fit.
        """
        p = len(moments.columns)
        self.weights, self.model = weights, model
        self.others = np.setdiff1d(np.arange(p), model)
        self._place = {int(column): k for k, column in enumerate(self.others)}
        self._tests = moments.merged_blocks(stretches)
        counts = self._tests.count.sum(axis=1)
        self._total = next(moments.merged_blocks([np.arange(moments.blocks)]).by_block(weights))
        energy = np.diag(self._total)[:-1]
        energy = np.where(energy > 0.0, energy, 1.0)
        self._model_pull = pull + LEAST_STRENGTH * np.diag(energy[model])
        self._others_pull = max(strength, LEAST_STRENGTH) * np.diag(energy[self.others])
        rest = counts.sum() / np.maximum(counts.sum() - counts, 1.0)
        self._fits = [
            self._eliminate((self._total - test) * factor)
            for test, factor in zip(self._tests.by_block(weights), rest, strict=True)
        ]
        self.target = self._tests.target_energy()

    def _eliminate(self, gram: Array) -> _Elimination:
        B, C = self.model, self.others
        joint = np.append(C, gram.shape[0] - 1)
        factor = cho_factor(gram[B[:, None], B] + self._model_pull, lower=True)
        Z = cho_solve(factor, gram[B[:, None], joint])
        reduced = gram[C[:, None], joint] - gram[C[:, None], B] @ Z
        return _Elimination(Z, reduced[:, :-1] + self._others_pull, reduced[:, -1])

    @cached_property
    def _by_joint(self) -> list[tuple[dict[int, int], Array]]:
        """For each joint the columns that may join its row, and its quadratic forms in them, (f, u + 1, u + 1)."""
        return [self._quadratic(joint) for joint in range(len(self.weights))]

    def _quadratic(self, joint: int) -> tuple[dict[int, int], Array]:
        columns, squares = self._tests.of_joint(joint)
        felt = columns[np.einsum("fmm->m", squares)[:-1] > 0.0]
        own, model = (np.flatnonzero(np.isin(some, felt)) for some in (self.others, self.model))
        places = np.searchsorted(columns, np.concatenate([self.model[model], self.others[own]]))
        rows = np.append(places, len(columns))
        kept, forms = np.append(own, len(self.others)), []
        for test, fit in zip(squares, self._fits, strict=True):
            T = np.vstack([-fit.model[np.ix_(model, kept)], np.eye(len(kept))])
            forms.append(T.T @ test[rows[:, None], rows] @ T)
        return {int(k): place for place, k in enumerate(own)}, np.stack(forms)

    def energies(self, columns: Sequence[int], joints: Sequence[int]) -> tuple[Array, Array]:
        """Weighted residual energy of the joints in each stretch without and with ``columns``, shape (f,) each.

        Every column acts on every one of these joints.
        """
        K = [self._place[column] for column in columns]
        before, after = np.zeros(len(self._fits)), np.zeros(len(self._fits))
        coefficients = [np.linalg.solve(fit.matrix[np.ix_(K, K)], fit.right[K]) for fit in self._fits]
        for joint in joints:
            places, forms = self._by_joint[joint]
            live = [k for k, column in enumerate(K) if column in places]
            chosen = [*(places[K[k]] for k in live), -1]
            for f, (form, theta) in enumerate(zip(forms, coefficients, strict=True)):
                r = np.append(-theta[live], 1.0)
                least = NEGLIGIBLE * self.target[f, joint]
                before[f] += self.weights[joint] * max(form[-1, -1], least)
                after[f] += self.weights[joint] * max(r @ form[np.ix_(chosen, chosen)] @ r, least)
        return before, after

    def all_energies(self, columns: Sequence[int]) -> Array:
        """Residual energy of every joint in each stretch with ``columns`` in the model, shape (f, joints)."""
        fits = [self._expand(fit, columns) for fit in self._fits]
        return np.vstack([self._tests.select_blocks([f]).residual_energy(theta) for f, theta in enumerate(fits)])

    def fit(self, columns: Sequence[int]) -> Array:
        """Parameters from all data with ``columns`` in the model, shape (p,)."""
        return self._expand(self._whole, columns)

    @cached_property
    def _whole(self) -> _Elimination:
        return self._eliminate(self._total)

    def _expand(self, fit: _Elimination, columns: Sequence[int]) -> Array:
        K = [self._place[column] for column in columns]
        theta = np.zeros(self._total.shape[0] - 1)
        coefficients = np.linalg.solve(fit.matrix[np.ix_(K, K)], fit.right[K])
        theta[list(columns)] = coefficients
        theta[self.model] = fit.model[:, -1] - fit.model[:, K] @ coefficients
        return theta

"""Coordinates in which the bound of the noisy regression model is easy to climb.

Given the weights' posterior, rows are jointly normal: ``x_m ~ N(0, v_m)`` and ``y | x ~ N(hᵀx, D)`` with

    κ = 1 + ρx + ρz    ρx = σ²wx/ψx    ρz = σ²wz/ψz    v = wx²/κ + ψx    h = wx wz/(κ v)
    D = R + Σ e        e = h² v f/(1 - f)              f = ψx/v          R = ψy + Σ ψz

and the bound, q(Z, T) and q(α) being optimal, is, with ``s = Σ x²``,

    -½ N [(d + 1) log 2π + Σ log v + log D + Σ log κ] - ½ [Σ s/v + Σ (y - hᵀx)²/D]
        + Σ [½ log(σ²wz σ²wx) - (a0 + 1) log b + 1 + a0 log b0 + log a0],    b = b0 + ½ (⟨wz²⟩ + ⟨wx²⟩).

The data fix h, v and D, with curvatures that grow with N. What they leave open, the share f of noise and how R is
shared among ψz and ψy, are coordinates of their own, with curvatures of order one. EM's own variables mix the two,
which is why EM creeps. Logarithms, the logit of f and soft-max shares keep every vector with ``R > 0`` admissible.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import expit

from casysid.arrays import Array
from casysid.estimation.denoising_em import LOG_2PI, DenoisingModel, State

LEAST_CURVATURE = 0.05
"""Of the logit of f, which is nearly flat where a column is all noise or none."""
ODDS = (1e-18, 1e12)
"""Least and largest odds of f: below a column is free of noise, above it is all noise."""
JITTER = 1e-10
"""Keeps the curvature of h positive definite where columns are dependent, as a fraction of the columns' energy."""


def to_vector(model: DenoisingModel, state: State) -> Array:
    """``[h, log v, logit f, log ψz, log ψy, log D]``, and ``log ρz, log ρx`` in the Bayesian model."""
    wz, wx, psi_x, psi_z, var_z, var_x, psi_y = state
    rho_z, rho_x = var_z / psi_z, var_x / psi_x
    kappa = 1.0 + rho_z + rho_x
    signal = wx * wx / kappa
    v = signal + psi_x
    D = psi_y + float((psi_z + wz * wz / kappa * psi_x / v).sum())
    odds = np.clip(psi_x / np.maximum(signal, psi_x / ODDS[1]), *ODDS)
    parts = [wx * wz / (kappa * v), np.log(v), np.log(odds), np.log(psi_z), np.log([psi_y, D])]
    return np.concatenate(parts if model.prior is None else [*parts, np.log(rho_z), np.log(rho_x)])


def limits(model: DenoisingModel) -> tuple[Array, Array]:
    """Lowest and highest vector: of D, which without noise would fall for ever, and of the odds of f."""
    d = len(model.energy)
    highest = np.full((4 if model.prior is None else 6) * d + 2, np.inf)
    lowest = -highest
    lowest[2 * d : 3 * d], highest[2 * d : 3 * d] = np.log(ODDS)
    lowest[4 * d + 1] = np.log((d + 1) * model.least_noise[1])
    return lowest, highest


@dataclass(frozen=True, eq=False)
class CoordinatePoint:
    """The bound, its gradient and its approximate curvature at one vector.

    Attributes:
        model: The model.
        vector: As :func:`to_vector` lays it out.
    """

    model: DenoisingModel
    vector: Array

    @cached_property
    def bound(self) -> float:
        """``-inf`` where the vector is not admissible."""
        if not self._at.rest > 0.0:
            return -np.inf
        at, prior = self._at, self.model.prior
        n, d = self.model.normal.count, len(at.h)
        log_det = (d + 1) * LOG_2PI + float(self.vector[d : 2 * d].sum() + self.vector[4 * d + 1])
        bound = -0.5 * (n * log_det + float((self.model.energy / at.v).sum()) + self._residual[1] / at.D)
        if prior is not None:
            log_variances = float(self.vector[4 * d + 2 :].sum() + np.log(at.v * at.f * at.psi_z).sum())
            bound += 0.5 * (log_variances - n * float(np.log(at.kappa).sum()))
            bound += (prior.shape + 1.0) * float(np.log(at.alpha / (prior.shape + 1.0)).sum()) + d * prior.constant
        return bound if np.isfinite(bound) else -np.inf

    @property
    def rounding(self) -> float:
        """How far the bound can be off: the residual's energy is a difference of energies as large as the output's."""
        return 4.0 * float(np.finfo(np.float64).eps) * (abs(self.bound) + self.model.normal.yy / self._at.D)

    @cached_property
    def gradient(self) -> Array:
        """Of the bound, shape of the vector."""
        at, n, half = self._at, self.model.normal.count, 0.0 if self.model.prior is None else 0.5
        unexplained, energy = self._residual
        half_alpha = 0.5 * at.alpha
        squares = at.wz2 + at.wx2
        to_psi_z = half - half_alpha * at.var_z
        to_rest = float(to_psi_z.sum())
        to_e = -to_rest / at.rest * at.e
        parts = [
            unexplained / at.D - at.h * self._pull,
            0.5 * (self.model.energy / at.v - n) + half - half_alpha * (squares + at.var_x) + to_e,
            half * (1.0 - at.f) - half_alpha * (at.f * (at.wz2 - at.wx2) + (1.0 - at.f) * at.var_x) + to_e,
            to_psi_z - at.shares[:-1] * to_rest,
            np.array([-at.shares[-1] * to_rest, 0.5 * (energy / at.D - n) + to_rest * at.D / at.rest]),
        ]
        if self.model.prior is not None:
            per_rho = (n + at.alpha * squares) / at.kappa
            parts += [0.5 - 0.5 * at.rho_z * per_rho - half_alpha * at.var_z]
            parts += [0.5 - 0.5 * at.rho_x * per_rho - half_alpha * at.var_x]
        return np.concatenate(parts)

    def metric(self) -> Callable[[Array], Array]:
        """The inverse of the bound's approximate curvature, as a function of a gradient; it costs one factorisation."""
        at, n, d = self._at, self.model.normal.count, len(self._at.h)
        of_h = self.model.normal.xx / at.D
        of_h[np.diag_indices(d)] += self._pull + JITTER * self.model.energy / at.D
        factor = cho_factor(of_h, check_finite=False)
        per_rest = self._to_rest / at.rest
        curvature = np.full(len(self.vector) - d, 0.5)
        curvature[:d] = 0.5 * n
        curvature[d : 2 * d] = (
            LEAST_CURVATURE + 0.5 * at.f * (1.0 - at.f + at.alpha * at.wz2) + per_rest * at.e * (1.0 + at.e / at.rest)
        )
        curvature[3 * d + 1] = 0.5 * n + per_rest * at.D * at.D / at.rest
        return lambda g: np.concatenate([cho_solve(factor, g[:d], check_finite=False), g[d:] / curvature])

    def em_step(self) -> Array:
        """The vector after one EM iteration."""
        state = self.state()
        return to_vector(self.model, self.model.maximise(state, self.model.expect(state)))

    def state(self) -> State:
        """The same in EM's variables."""
        at, (floor_x, floor_y) = self._at, self.model.least_noise
        wx = np.sqrt(at.wx2)
        psi_x, psi_z = np.maximum(at.v * at.f, floor_x), np.maximum(at.psi_z, floor_y)
        psi_y = max(float(at.rest * at.shares[-1]), floor_y)
        return State(at.h * at.kappa * at.v / wx, wx, psi_x, psi_z, at.rho_z * psi_z, at.rho_x * psi_x, psi_y)

    @cached_property
    def _at(self) -> _Decoded:
        return _decode(self.model, self.vector)

    @cached_property
    def _residual(self) -> tuple[Array, float]:
        """``Σ x (y - hᵀx)`` and ``Σ (y - hᵀx)²``."""
        normal, h = self.model.normal, self._at.h
        unexplained = normal.xy - normal.xx @ h
        return unexplained, max(normal.yy - float(h @ (normal.xy + unexplained)), 0.0)

    @property
    def _to_rest(self) -> float:
        """Derivative of the bound by log R; positive wherever the weights are known better than their prior."""
        at = self._at
        return 0.0 if self.model.prior is None else max(float((0.5 - 0.5 * at.alpha * at.var_z).sum()), 0.0)

    @cached_property
    def _pull(self) -> Array:
        """How strongly the prior and R pull each h towards zero."""
        at = self._at
        return at.alpha * at.kappa * at.v * (1.0 + at.odds) + 2.0 * self._to_rest / at.rest * at.v * at.odds


class _Decoded(NamedTuple):
    """What a vector stands for: ``odds`` is f/(1 - f), ``wz2`` wz², ``rest`` R, ``shares`` those of ψz and ψy in R."""

    h: Array
    v: Array
    f: Array
    odds: Array
    D: float
    kappa: Array
    e: Array
    rest: float
    shares: Array
    psi_z: Array
    rho_z: Array
    rho_x: Array
    var_z: Array
    var_x: Array
    wz2: Array
    wx2: Array
    alpha: Array


def _decode(model: DenoisingModel, vector: Array) -> _Decoded:
    d = len(model.energy)
    h, v, logit = vector[:d], np.exp(vector[d : 2 * d]), vector[2 * d : 3 * d]
    f, odds, D = expit(logit), np.exp(logit), float(np.exp(vector[4 * d + 1]))
    e = h * h * v * odds
    rest = D - float(e.sum())
    logits = vector[3 * d : 4 * d + 1]
    shares = np.exp(logits - logits.max())
    shares /= shares.sum()
    psi_z = rest * shares[:-1]
    rho = np.zeros(2 * d) if model.prior is None else np.exp(vector[4 * d + 2 :])
    rho_z, rho_x = rho[:d], rho[d:]
    kappa = 1.0 + rho_z + rho_x
    var_z, var_x = rho_z * psi_z, rho_x * v * f
    scale = kappa * v
    wz2, wx2 = h * h * scale * (1.0 + odds), scale / (1.0 + odds)
    alpha = model.relevance(wz2 + var_z + wx2 + var_x)
    return _Decoded(h, v, f, odds, D, kappa, e, rest, shares, psi_z, rho_z, rho_x, var_z, var_x, wz2, wx2, alpha)

"""The noisy regression model of Ting et al. (2006), one EM iteration on moments, and the bound that it climbs.

For columns m = 1..d and rows i = 1..N (paper §III, Fig. 1(b) and (c)), with hidden ``t`` and ``z``:

    t_m ~ N(0, 1)    x_m ~ N(wx_m t_m, ψx_m)    z_m ~ N(wz_m t_m, ψz_m)    y ~ N(Σ z_m, ψy)
    wx_m, wz_m ~ N(0, 1/α_m)    α_m ~ Gamma(a0, b0)                      (the Bayesian layer of Fig. 1(c))

The posterior is approximated by ``q(α) q(wz) q(wx) q(Z, T)``. The means of z and t are diagonal plus rank one in [x,
y], so every sum over rows is a function of ``Σ x xᵀ``, ``Σ x y``, ``Σ y²``: an iteration is one matrix-vector product,
O(d²) whatever N (the paper's runs over the rows). Joint Factor Analysis is the same without the Bayesian layer.

Errata of the paper's appendix: ``Σzt`` is printed with a minus sign; its own ``⟨t⟩`` needs plus.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.moments import NormalEquations

SMALLEST_VARIANCE = 1e-12
"""No noise variance of the output falls below this fraction of its mean square."""
SMALLEST_INPUT_VARIANCE = 1e-15
"""The same for a column."""


@dataclass(frozen=True)
class GammaPrior:
    """``α_m ~ Gamma(shape, rate)``, the prior of every column's precision.

    With the default rate the bound, as a function of the shape, is largest between 0.05 and 0.5, on the paper's
    synthetic problems as on real robots' moments.

    Attributes:
        shape: The paper's ``a_α0``.
        rate: The paper's ``b_α0``.
    """

    shape: float = 0.25
    rate: float = 1e-6

    def __post_init__(self) -> None:
        if not (0.0 < self.shape < np.inf and 0.0 < self.rate < np.inf):
            raise ParameterError(
                f"gamma prior: shape and rate must be positive and finite; got {self.shape}, {self.rate}"
            )

    @property
    def constant(self) -> float:
        """What a column adds to the bound whatever its weights."""
        return float(1.0 + self.shape * np.log(self.rate) + np.log(self.shape))


class State(NamedTuple):
    """What EM iterates: the posterior of the weights and the noise variances, arrays of shape (d,).

    ``wz`` and ``wx`` are posterior means, ``var_z`` and ``var_x`` posterior variances (zeros in Joint Factor Analysis).
    """

    wz: Array
    wx: Array
    psi_x: Array
    psi_z: Array
    var_z: Array
    var_x: Array
    psi_y: float


class Expectation(NamedTuple):
    """The E-step at one state: sums over rows, and the bound there.

    ``zz`` is ``Σ ⟨z²⟩``, ``zt`` is ``Σ ⟨z t⟩``, ``tt`` is ``Σ ⟨t²⟩``, ``xt`` is ``Σ x ⟨t⟩``, each of shape (d,);
    ``residual`` is ``Σ ⟨(y - 1ᵀz)²⟩`` and ``alpha`` is ``⟨α⟩`` given the state's weights.
    """

    bound: float
    alpha: Array
    zz: Array
    zt: Array
    tt: Array
    xt: Array
    residual: float


@dataclass(frozen=True, eq=False)
class DenoisingModel:
    """The model of one data set.

    Attributes:
        normal: The data's sums, every column and the output with some energy.
        prior: Of the precisions; None is Joint Factor Analysis.
    """

    normal: NormalEquations
    prior: GammaPrior | None

    def __post_init__(self) -> None:
        energy = np.append(self.energy, self.normal.yy)
        if not (energy > 0.0).all():
            empty = [str(m) for m in np.flatnonzero(~(energy > 0.0))]
            raise ParameterError(
                f"de-noising: every column and the output must have energy; nothing in {', '.join(empty)} "
                f"(the output is {len(energy) - 1}); leave them out"
            )

    @cached_property
    def energy(self) -> Array:
        """``Σ x_m²``, shape (d,)."""
        return np.diag(self.normal.xx).copy()

    @cached_property
    def least_noise(self) -> tuple[Array, float]:
        """Floors of ``ψx``, shape (d,), and of ``ψz`` and ``ψy``."""
        n, d = self.normal.count, len(self.energy)
        return SMALLEST_INPUT_VARIANCE * self.energy / n, SMALLEST_VARIANCE * self.normal.yy / n / (d + 1)

    def expect(self, state: State) -> Expectation:
        """E-step of Z and T (paper's appendix, on moments), and the variational bound with q(Z, T) and q(α) optimal."""
        wz, wx, psi_x, psi_z, var_z, var_x, psi_y = state
        xx, n, s = self.normal.xx, self.normal.count, self.energy
        kappa = 1.0 + var_x / psi_x + var_z / psi_z
        A = wx / psi_x
        C = kappa + wx * A
        B = wz / C
        M = psi_z + wz * B
        M_sum = float(M.sum())
        D = psi_y + M_sum  # variance of y given x
        g = B / M
        h = A * B  # mean of y given x is hᵀx
        p = A * psi_z / (C * M)
        u = self.normal.xy - xx @ h  # Σ x (y - hᵀx)
        E = max(self.normal.yy - float(h @ (self.normal.xy + u)), 0.0)  # Σ (y - hᵀx)²
        k = M / D
        zx = k * u + h * s
        zz = k * (k * E + 2.0 * h * u) + h * h * s + n * (M - k * M)
        zt = g * zz + p * zx
        xt = g * zx + p * s
        tt = g * zt + p * xt + n * psi_z / (C * M)
        log_det = float(np.log(psi_x * C).sum()) + np.log(D)
        fit = float((s * kappa / (psi_x * C)).sum()) + E / D
        bound = -0.5 * (n * ((len(wz) + 1) * LOG_2PI + log_det) + fit)
        alpha = self.relevance(wz * wz + var_z + wx * wx + var_x)
        residual = (psi_y / D) ** 2 * E + n * psi_y * M_sum / D
        return Expectation(bound - self._divergence(state, alpha), alpha, zz, zt, tt, xt, residual)

    def maximise(self, state: State, expected: Expectation) -> State:
        """One EM iteration: the weights' posterior given sums and old noise, then the noise given the weights."""
        n = self.normal.count
        var_z = 1.0 / (expected.tt / state.psi_z + expected.alpha)
        var_x = 1.0 / (expected.tt / state.psi_x + expected.alpha)
        wz, wx = var_z / state.psi_z * expected.zt, var_x / state.psi_x * expected.xt
        if self.prior is None:
            var_z = var_x = np.zeros_like(wz)
        floor_x, floor_y = self.least_noise
        psi_x = (self.energy - 2.0 * wx * expected.xt + (wx * wx + var_x) * expected.tt) / n
        psi_z = (expected.zz - 2.0 * wz * expected.zt + (wz * wz + var_z) * expected.tt) / n
        return State(
            wz,
            wx,
            np.maximum(psi_x, floor_x),
            np.maximum(psi_z, floor_y),
            var_z,
            var_x,
            max(expected.residual / n, floor_y),
        )

    def relevance(self, squares: Array) -> Array:
        """``⟨α⟩`` of the optimal q(α) for ``⟨wz²⟩ + ⟨wx²⟩``; zeros in Joint Factor Analysis."""
        if self.prior is None:
            return np.zeros_like(squares)
        return (self.prior.shape + 1.0) / (self.prior.rate + 0.5 * squares)

    def _divergence(self, state: State, alpha: Array) -> float:
        """Kullback-Leibler divergence of q(wz) q(wx) q(α) from their prior."""
        if self.prior is None:
            return 0.0
        a = self.prior.shape + 1.0
        gain = 0.5 * np.log(state.var_z * state.var_x) + a * np.log(alpha / a)
        return -float(gain.sum()) - len(alpha) * self.prior.constant


LOG_2PI = float(np.log(2.0 * np.pi))

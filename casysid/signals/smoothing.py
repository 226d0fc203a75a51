r"""Zero-phase low-pass and differentiation in one: the penalised smoothing spline.

The spline ``x`` that minimises ``Σ (y_k - x(t_k))² + 1/(Δt ω_c^{2d}) ∫ (x^{(d)})² dt`` has, away from the ends, the
gain ``1 / (1 + (f/f_c)^{2d})``: that of a Butterworth filter of order ``d`` run forwards and backwards, half at the
cut-off, with no phase. Unlike that filter it needs no even sampling, treats the ends by its natural boundary
conditions, reproduces polynomials of degree below ``d`` exactly, and its derivatives are those of the spline itself.

Source: Craven and Wahba 1979 (smoothing splines), Eilers and Marx 1996 (penalised B-splines); the gain follows from the
Euler-Lagrange equation ``x + (-1)^d ω_c^{-2d} x^{(2d)} = y``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError

KNOTS_PER_CUTOFF_PERIOD = 6
TOLERANCE = 1e-10
"""Of an effect that is forgotten: a tenth of what results are held to, 1e-9, since derivatives forget less."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Smoother:
    """A linear smoother for one time base; build it with :func:`build_smoother`.

    Attributes:
        time: Sample times [s], shape (N,), increasing.
        cutoff: Frequency at which the gain is one half [Hz].
        order: ``d``, the order of the penalised derivative.
    """

    time: Array
    cutoff: float
    order: int
    _knots: Array
    _basis: Any
    _factor: Array

    def smooth(self, values: Array, derivative: int = 0, at: Array | None = None) -> Array:
        """The smoothed ``values``, shape (N,) or (N, n), or a time derivative of them, at the sample times or others.

        Args:
            values: At the sample times.
            derivative: Of which order.
            at: Times [s], shape (M,), not beyond the samples; None takes the sample times.
        """
        return np.asarray(self._basis_at(derivative, at) @ self._coefficients(values))

    def states(self, values: Array, at: Array | None = None) -> tuple[Array, Array, Array]:
        """The smoothed ``values``, their first and second derivatives, as :meth:`smooth` gives them one by one."""
        degree, time = 2 * self.order - 1, self.time if at is None else at
        spline = BSpline.construct_fast(self._knots, self._coefficients(values), degree)
        inside = np.clip(time, self._knots[degree], self._knots[-degree - 1])
        value, rate, second = (np.asarray(spline(inside, nu=k)) for k in range(3))
        return value, rate, second

    def _coefficients(self, values: Array) -> Array:
        if len(values) != len(self.time):
            raise ParameterError(f"smoother: built for {len(self.time)} samples, got {len(values)}")
        return np.asarray(cho_solve_banded((self._factor, True), self._basis.T @ values))

    def _basis_at(self, derivative: int, at: Array | None) -> Any:
        if derivative == 0 and at is None:
            return self._basis
        return derivative_basis(self.time if at is None else at, self._knots, 2 * self.order - 1, derivative)

    def gain(self, frequency: Array) -> Array:
        """Gain at frequencies [Hz], away from the ends: ``1 / (1 + (f/f_c)^{2d})``."""
        return np.asarray(1.0 / (1.0 + (np.asarray(frequency) / self.cutoff) ** (2 * self.order)))

    def impulse_responses(self) -> Array:
        """Responses of value, first and second derivative to a unit impulse at the middle sample, shape (3, N)."""
        impulse = np.zeros(len(self.time))
        impulse[len(impulse) // 2] = 1.0
        return np.stack(self.states(impulse))

    def noise_covariance(self) -> Array:
        """``H Hᵀ``, shape (3, 3): covariance of value, first and second derivative for white noise of unit variance."""
        responses = self.impulse_responses()
        return responses @ responses.T


class Grid(NamedTuple):
    """What smoothers of parts of a stretch of time have in common, so that they are parts of one spline.

    Attributes:
        start: First sample of the stretch [s].
        stop: Last sample of it [s].
        step: Usual step between samples [s].
    """

    start: float
    stop: float
    step: float


def memory(cutoff: float, tolerance: float = TOLERANCE) -> float:
    """How far from a sample its effect on the spline falls to ``tolerance`` of what it is there [s].

    The poles of the gain next to the real axis are ``ω_c e^{±iπ/2d}``, for order 3 with an imaginary part of
    ``ω_c / 2``: an effect falls by ``exp(-π)`` in a period of the cut-off.
    """
    return float(-np.log(tolerance) / np.pi / cutoff)


def build_smoother(time: Array, cutoff: float, order: int = 3, grid: Grid | None = None) -> Smoother:
    """A smoother for samples at ``time`` [s] with the given cut-off [Hz].

    With a grid, a part of a stretch gets knots and penalty of the whole, and so the same spline but for its ends, whose
    effect is gone after :func:`memory`.

    Raises:
        ParameterError: Times do not increase, fewer samples than ``order + 1``, or a cut-off that is not positive and
            finite.
    """
    time = np.asarray(time, dtype=np.float64)
    if not (np.isfinite(cutoff) and cutoff > 0):
        raise ParameterError(f"smoother: the cut-off must be a positive number of Hz; got {cutoff}")
    if order < 1 or len(time) < order + 1:
        raise ParameterError(f"smoother: order {order} wants at least {max(order, 1) + 1} samples; got {len(time)}")
    steps = np.diff(time)
    if not (steps > 0).all():
        raise ParameterError(f"smoother: times must increase; they do not after sample {int(np.argmin(steps > 0)) + 1}")
    grid = grid or Grid(float(time[0]), float(time[-1]), float(np.median(steps)))
    degree, step = 2 * order - 1, grid.step
    knots, spacing = _knots(time, grid, max(1.0 / (KNOTS_PER_CUTOFF_PERIOD * cutoff), step), degree)
    basis = derivative_basis(time, knots, degree, 0)
    normal = basis.T @ basis
    banded = (2.0 * np.pi * cutoff) ** (-2 * order) / step * _roughness(normal.shape[0], order, spacing)
    for offset in range(min(degree + 1, normal.shape[0])):
        banded[offset, : normal.shape[0] - offset] += normal.diagonal(-offset)
    return Smoother(
        time=frozen(time),
        cutoff=float(cutoff),
        order=order,
        _knots=knots,
        _basis=basis,
        _factor=cholesky_banded(banded, lower=True),
    )


def _knots(time: Array, grid: Grid, wanted_spacing: float, degree: int) -> tuple[Array, float]:
    """The grid's evenly spaced knots about the samples, ``degree`` more on either side, and their spacing."""
    intervals = max(int(np.ceil((grid.stop - grid.start) / wanted_spacing)), 1)
    spacing = (grid.stop - grid.start) / intervals
    first = min(max(int(np.floor((time[0] - grid.start) / spacing)), 0), intervals - 1)
    last = max(min(int(np.ceil((time[-1] - grid.start) / spacing)), intervals), first + 1)
    return np.asarray(grid.start + spacing * np.arange(first - degree, last + degree + 1)), spacing


def derivative_basis(time: Array, knots: Array, degree: int, derivative: int) -> Any:
    """Sparse matrix from coefficients to the ``derivative``-th derivative at ``time`` (de Boor 1978, ch. X eq. 15)."""
    lowered = degree - derivative
    inner = knots[derivative : len(knots) - derivative]
    inside = np.clip(time, inner[lowered], inner[-lowered - 1])
    basis = BSpline.design_matrix(inside, inner, lowered).tocsr()
    differences = sparse.eye_array(len(knots) - degree - 1).tocsr()
    for step in range(derivative):
        k = degree - step
        rows = differences.shape[0] - 1
        width = knots[step + 1 + k : step + 1 + k + rows] - knots[step + 1 : step + 1 + rows]
        differences = sparse.diags_array(k / width) @ (differences[1:] - differences[:-1])
    return (basis @ differences).tocsr()


def _roughness(size: int, order: int, spacing: float) -> Array:
    """``∫ B_i^{(d)} B_j^{(d)} dt`` between the outer samples, the lower bands of the matrix, shape (2 d, size).

    Pairs that no end cuts are alike, so a spline of few intervals has all there are.
    """
    degree = 2 * order - 1
    few = min(size, 3 * degree + 1)
    small = _dense_roughness(few - degree, order) * spacing ** (1 - 2 * order)
    bands = np.zeros((degree + 1, size))
    for offset in range(min(degree + 1, few)):
        band = np.diagonal(small, -offset)
        middle = np.full(size - few, band[min(degree, len(band) - 1)])
        bands[offset, : size - offset] = np.concatenate([band[:degree], middle, band[degree:]])
    return bands


@lru_cache
def _dense_roughness(intervals: int, order: int) -> Array:
    """The matrix for knots a unit apart, by Gauss-Legendre, exact for the polynomial pieces."""
    degree = 2 * order - 1
    nodes, weights = np.polynomial.legendre.leggauss(degree - order + 1)
    points = (np.arange(intervals)[:, None] + (nodes + 1.0) / 2.0).ravel()
    knots = np.arange(-degree, intervals + degree + 1.0)
    derivative = derivative_basis(points, knots, degree, order)
    return frozen((derivative.T @ sparse.diags_array(np.tile(weights / 2.0, intervals)) @ derivative).toarray())

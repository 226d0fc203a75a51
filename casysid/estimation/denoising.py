"""Bayesian de-noising regression and Joint Factor Analysis of one regression problem, from its moments.

The likelihood is flat along ``wx² + ψx = const``, ``wx wz = const``: how much of a column is noise is decided by start
and prior, not by second moments. A few starts are run and the one of the largest bound is kept.

The prior must not tie a column's noise to its strength. It does where ``wz`` is small beside ``wx ≤ 1``: there it makes
weak columns nearly pure noise and blows up their weights. Given an output so large that every weight the data can tell
from zero is large beside one, the bound along the flat direction is ``½ log f + (1 + a0) log(1 - f)`` for a share of
noise
f: the same for all columns, with its maximum at a third, as far as the output's residual allows. So scale the output
before calling.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.estimation.acceleration import ascend
from casysid.estimation.base import Status
from casysid.estimation.denoising_coordinates import CoordinatePoint, limits, to_vector
from casysid.estimation.denoising_em import DenoisingModel, GammaPrior, State
from casysid.moments import NormalEquations


@dataclass(frozen=True)
class Start:
    """Where EM begins.

    Attributes:
        noise_fraction: Share of every column's mean square that is taken for noise.
        ridge: The first weights are a ridge regression of this strength, as a fraction of the columns' energy.
    """

    noise_fraction: float
    ridge: float = 1e-2

    def __post_init__(self) -> None:
        if not (0.0 < self.noise_fraction < 1.0 and 0.0 < self.ridge < np.inf):
            raise ParameterError(f"start: wanted 0 < noise_fraction < 1 and ridge > 0; got {self}")

    def state(self, model: DenoisingModel) -> State:
        """The first state."""
        normal = model.normal
        penalised = normal.xx + self.ridge * np.diag(model.energy)
        coefficients = np.asarray(np.linalg.solve(penalised, normal.xy), dtype=np.float64)
        return state_from(model, coefficients, np.full_like(coefficients, self.noise_fraction))


STARTS = (Start(0.05, 1e-7), Start(0.1), Start(0.2))
WARM_UP = 100
"""Iterations of plain EM at the beginning; without them, starts end in different optima more often."""
LARGEST_SHARE = 1.0 - 1e-6


def state_from(model: DenoisingModel, coefficients: Array, noise_fraction: Array) -> State:
    """A state whose noisy regression vector and shares of noise, shape (d,), are the given ones.

    The shares are lowered in common as far as they would make more noise in the output than its residual shows.
    """
    n, d = model.normal.count, len(coefficients)
    mean_square, residual = model.energy / n, model.normal.residual_energy(coefficients) / n
    share = np.minimum(noise_fraction, LARGEST_SHARE)
    odds = share / (1.0 - share)
    spent = float((coefficients**2 * mean_square * odds).sum())
    if spent > residual:
        odds = odds * (residual / spent)
        share = odds / (1.0 + odds)
    wx = np.sqrt(mean_square * (1.0 - share))
    floor_x, floor_y = model.least_noise
    psi_y = max(0.5 * residual, floor_y)
    psi_x, psi_z = np.maximum(mean_square * share, floor_x), np.full(d, max(psi_y / d, floor_y))
    known = np.zeros(d) if model.prior is None else np.ones(d)
    return State(coefficients * mean_square / wx, wx, psi_x, psi_z, known * psi_z / n, known * psi_x / n, psi_y)


@dataclass(frozen=True, eq=False, kw_only=True)
class DenoisingPosterior:
    """What was learnt of one regression problem; arrays of shape (d,).

    Attributes:
        output_weight: ``⟨wz⟩``.
        input_weight: ``⟨wx⟩``.
        output_weight_variance: ``σ²_wz``, zeros in Joint Factor Analysis.
        input_weight_variance: ``σ²_wx``, zeros in Joint Factor Analysis.
        input_noise: ``ψx``.
        hidden_noise: ``ψz``.
        output_noise: ``ψy``.
        relevance: ``⟨α⟩``, zeros in Joint Factor Analysis.
        prior: Of the precisions; None is Joint Factor Analysis.
        bounds: The bound at the start and after every iteration.
        start_bounds: The last bound of every start, the largest of which was kept.
        evaluations: E-steps of the start that was kept.
        status: Why it stopped.
    """

    output_weight: Array
    input_weight: Array
    output_weight_variance: Array
    input_weight_variance: Array
    input_noise: Array
    hidden_noise: Array
    output_noise: float
    relevance: Array
    prior: GammaPrior | None
    bounds: Array
    start_bounds: Array
    evaluations: int
    status: Status

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                object.__setattr__(self, field.name, frozen(value))

    @property
    def bound(self) -> float:
        """The variational bound (Joint Factor Analysis: the log likelihood)."""
        return float(self.bounds[-1])

    @cached_property
    def noisy_regression(self) -> Array:
        """``b_noise``, for noisy inputs: the paper's Eq. (3), which collapses to ``wz wx / (ψx + wx²)``."""
        return frozen(self.output_weight * self.input_weight / self.mean_square)

    @cached_property
    def noiseless_regression(self) -> Array:
        """``b_true`` for noiseless inputs: the paper's Eq. (4), as ``wz wx / ⟨wx²⟩``, which is zero where a column is
        off.

        As printed it collapses to ``wz / wx``, 0/0 for such columns.
        """
        return self.noiseless_regression_within(np.full_like(self.input_noise, np.inf))

    def noiseless_regression_within(self, largest_noise: Array) -> Array:
        """``b_true`` if no column m can have more noise than ``largest_noise[m]``."""
        square = self.input_weight**2 + self.input_weight_variance
        signal = np.maximum(square, self.mean_square - largest_noise)
        return frozen(self.output_weight * self.input_weight / signal)

    @property
    def noise_fraction(self) -> Array:
        """Share of every column that is noise, shape (d,)."""
        return self.input_noise / self.mean_square

    @property
    def is_relevant(self) -> npt.NDArray[np.bool_]:
        """Columns whose weight is larger than its standard deviation; all in Joint Factor Analysis."""
        return self.output_weight**2 > self.output_weight_variance

    def bound_of(self, normal: NormalEquations) -> float:
        """The bound, computed anew from the moments that were fitted."""
        return DenoisingModel(normal, self.prior).expect(self._state).bound

    def gain_of_one_more_iteration(self, normal: NormalEquations) -> float:
        """By how much one more EM iteration raises the bound: zero, but for rounding, at a stationary point."""
        model = DenoisingModel(normal, self.prior)
        expected = model.expect(self._state)
        return model.expect(model.maximise(self._state, expected)).bound - expected.bound

    @property
    def mean_square(self) -> Array:
        """Of every column, as the model has it: ``wx² + ψx``, shape (d,)."""
        return self.input_noise + self.input_weight**2

    @property
    def conditional_variance(self) -> float:
        """Of the output given noisy inputs: the appendix's ``ψy + 1ᵀM1``."""
        kappa = 1.0 + self.input_weight_variance / self.input_noise + self.output_weight_variance / self.hidden_noise
        hidden = self.output_weight**2 / (kappa + self.input_weight**2 / self.input_noise)
        return self.output_noise + float((self.hidden_noise + hidden).sum())

    @property
    def _state(self) -> State:
        return State(
            self.output_weight,
            self.input_weight,
            self.input_noise,
            self.hidden_noise,
            self.output_weight_variance,
            self.input_weight_variance,
            self.output_noise,
        )


def denoise(
    normal: NormalEquations,
    *,
    prior: GammaPrior | None = GammaPrior(),  # noqa: B008 - frozen
    starts: Sequence[Start | State] = STARTS,
    tolerance: float = 1e-9,
    max_iterations: int = 20_000,
) -> DenoisingPosterior:
    """Fit the model from every start and keep the largest bound.

    Args:
        normal: The data's sums; every column and the output must have energy.
        prior: Of the precisions; None fits Joint Factor Analysis.
        starts: Where to begin; at least one.
        tolerance: Relative gain of the bound in an accelerated iteration at which it has come to rest.
        max_iterations: Accelerated iterations of each start at most.

    Raises:
        ParameterError: No start, or a column or the output without energy.
    """
    if not starts:
        raise ParameterError("de-noising: at least one start is needed; got none")
    model = DenoisingModel(normal, prior)
    states = [start.state(model) if isinstance(start, Start) else start for start in starts]
    climbs = [climb(model, state, tolerance=tolerance, max_iterations=max_iterations) for state in states]
    best = max(climbs, key=lambda one: one.bounds[-1])
    state = best.state
    return DenoisingPosterior(
        output_weight=state.wz,
        input_weight=state.wx,
        output_weight_variance=state.var_z,
        input_weight_variance=state.var_x,
        input_noise=state.psi_x,
        hidden_noise=state.psi_z,
        output_noise=state.psi_y,
        relevance=model.expect(state).alpha,
        prior=prior,
        bounds=np.array(best.bounds),
        start_bounds=np.array([one.bounds[-1] for one in climbs]),
        evaluations=best.evaluations,
        status=Status.CONVERGED if best.converged else Status.MAX_ITERATIONS,
    )


@dataclass(frozen=True, eq=False)
class Climb:
    """Where EM went from one start.

    Attributes:
        state: The last state.
        bounds: The bound at the start and after every iteration.
        evaluations: E-steps, or computations of the bound and its gradient, which cost about the same.
        converged: Whether the bound had come to rest.
    """

    state: State
    bounds: tuple[float, ...]
    evaluations: int
    converged: bool


def climb(model: DenoisingModel, state: State, *, tolerance: float, max_iterations: int) -> Climb:
    """Some iterations of plain EM from one state, then accelerated ones."""
    bounds = []
    for _ in range(min(WARM_UP, max_iterations)):
        expected = model.expect(state)
        bounds.append(expected.bound)
        state = model.maximise(state, expected)
    ascent = ascend(
        lambda vector: CoordinatePoint(model, vector),
        to_vector(model, state),
        limits(model),
        tolerance=tolerance,
        max_iterations=max_iterations - len(bounds),
        metric_age=max(3, len(model.energy) // 40),  # factorisations then cost O(d²) an iteration
    )
    state = CoordinatePoint(model, ascent.vector).state()
    return Climb(state, (*bounds, *ascent.bounds), len(bounds) + ascent.evaluations, ascent.converged)

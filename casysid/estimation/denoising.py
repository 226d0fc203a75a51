"""Bayesian de-noising regression and Joint Factor Analysis of one regression problem, from its moments.

The likelihood is flat along ``wx² + ψx = const``, ``wx wz = const``: how much of a column is noise is decided by start
and prior, for the model takes the noiseless columns for independent (:mod:`casysid.estimation.noise_split` does not).
A few starts are run and the one of the largest bound is kept.

The prior must not tie a column's noise to its strength. It does where ``wz`` is small beside ``wx ≤ 1``: there it makes
weak columns nearly pure noise and blows up their weights. Given an output so large that every weight the data can tell
from zero is large beside one, the bound along the flat direction is ``½ log f + (1 + a0) log(1 - f)`` for a share f of
noise, the same for all columns: largest at ``1/(3 + 2 a0)``, and lower where the output's residual does not allow that
much. So scale the output before calling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError, SolverError
from casysid.estimation.acceleration import ascend
from casysid.estimation.base import Status
from casysid.estimation.denoising_coordinates import CoordinatePoint, limits, to_vector
from casysid.estimation.denoising_em import DenoisingModel, GammaPrior, State
from casysid.estimation.denoising_posterior import DenoisingPosterior
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
        tolerance: Relative gain of the bound over ten iterations at which it has come to rest.
        max_iterations: Iterations of each start at most.

    Raises:
        ParameterError: No start, or a column or the output without energy.
        SolverError: The climb broke off: no step raises the bound where its gradient says that one must.
    """
    if not starts:
        raise ParameterError("de-noising: at least one start is needed; got none")
    model = DenoisingModel(normal, prior)
    states = [start.state(model) if isinstance(start, Start) else start for start in starts]
    climbs = [climb(model, state, tolerance=tolerance, max_iterations=max_iterations) for state in states]
    best = max(climbs, key=lambda one: one.bounds[-1])
    if not best.converged and len(best.bounds) <= max_iterations:
        raise SolverError(
            f"de-noising: the best of {len(climbs)} climbs broke off after {len(best.bounds) - 1} iterations; its "
            f"bound is {best.bounds[-1]:.6g}, which is not the top, says its gradient; give other starts"
        )
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

"""The optimisation over all joints' coordinates at once, with exact derivatives, in the form IPOPT takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.excitation.constraints.constraint import Constraint
from casysid.excitation.design.information import FLOOR
from casysid.excitation.design.problem import ExcitationProblem
from casysid.excitation.motion.fourier import ORDERS, FourierSeries, Motion
from casysid.excitation.search.constraint_sampling import Watched, on_grid
from casysid.nlp import HessianKind, NlpSettings, NonlinearProgram, build_nlp

RESTORATION = 20
"""Steps in which IPOPT may look for a motion that keeps the limits at all; longer searches rarely end well."""


class Grid:
    """Instants, and the variables' basis functions there."""

    def __init__(self, series: FourierSeries, time: Array, unit: Array) -> None:
        """Of one period."""
        ones = np.ones((len(time), 1))
        self.size, self._unit = len(time), unit
        self.basis = [np.hstack([ones * (order == 0), series.basis(time, order)]) for order in range(ORDERS)]

    def motion(self, x: Array) -> Motion:
        """Of the variables."""
        coordinates = x.reshape(len(self._unit), -1) * self._unit[:, None]
        return Motion(*(basis @ coordinates.T for basis in self.basis))


class Evaluation:
    """Objective, constraints and their derivatives at a vector of variables; remembers the last one.

    Variables are, joint by joint, the start and the coordinates, in units of half the joint's range. Not to be shared
    by threads.

    Attributes:
        problem: What is designed.
        watched: The constraints that are looked at.
        counts: How often each of objective, gradient, constraints and Jacobian was evaluated.
    """

    def __init__(self, problem: ExcitationProblem, watched: Sequence[Watched] | None = None) -> None:
        """The constraints that are looked at, and when; None is all on the design grid."""
        watched = on_grid(problem) if watched is None else watched
        self.problem, self.watched = problem, tuple(one.constraint for one in watched)
        self.counts = dict.fromkeys(("objective", "gradient", "constraints", "jacobian"), 0)
        series, unit = problem.series, problem.limits.half_range
        self._grid = Grid(series, series.grid(problem.samples), unit)
        times = {one.time.tobytes(): one.time for one in watched}  # blocks that are looked at together share a grid
        grids = {key: Grid(series, time, unit) for key, time in times.items()}
        self._grids = [grids[one.time.tobytes()] for one in watched]
        self._last, self._known = np.empty(0), dict[Any, Any]()

    @property
    def variables(self) -> int:
        """Their number."""
        return len(self.problem.limits.lower) * (1 + self.problem.series.size)

    def objective(self, x: Array) -> float:
        """The criterion."""
        return float(self._criterion(x)[0])

    def gradient(self, x: Array) -> Array:
        """Of the criterion, shape (variables,)."""
        self.counts["gradient"] += 1
        _, slope, rows = self._criterion(x)
        problem = self.problem
        weight = problem.measured / problem.samples
        parts = problem.information.pull_back(self._motion(self._grid, x), rows, weight * slope)
        total = sum(part.T @ basis for part, basis in zip(parts, self._grid.basis, strict=False))
        return np.asarray(problem.limits.half_range[:, None] * total).ravel()

    def constraints(self, x: Array) -> Array:
        """Instant by instant within each constraint."""
        motions = [self._motion(grid, x) for grid in self._grids]
        if "constraints" not in self._known:
            self.counts["constraints"] += 1
            parts = [
                constraint.constrain(motion).ravel() for constraint, motion in zip(self.watched, motions, strict=True)
            ]
            self._known["constraints"] = np.concatenate(parts or [np.empty(0)])
        values: Array = self._known["constraints"]
        return values

    def bounds(self, tightening: float) -> tuple[Array, Array]:
        """Of the constraints, moved inwards."""
        sides = [
            [np.tile(side, grid.size) for side in constraint.bounds]
            for constraint, grid in zip(self.watched, self._grids, strict=True)
        ]
        if not sides:
            return np.empty(0), np.empty(0)
        lower, upper = (np.concatenate(parts) for parts in zip(*sides, strict=True))
        return lower + tightening, upper - tightening

    def jacobian(self, x: Array) -> Array:
        """Nonzeros of the constraints' Jacobian, at the places of :attr:`pattern`."""
        self.counts["jacobian"] += 1
        parts = [self._chain(constraint, grid, x) for constraint, grid in zip(self.watched, self._grids, strict=True)]
        return np.concatenate(parts or [np.empty(0)])

    @property
    def pattern(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Row and column of each nonzero of :meth:`jacobian`."""
        width, first = 1 + self.problem.series.size, 0
        rows, columns = [np.empty(0, np.intp)], [np.empty(0, np.intp)]
        for constraint, grid in zip(self.watched, self._grids, strict=True):
            i, j = np.nonzero(constraint.depends)
            m = len(constraint.depends)
            row = first + np.arange(grid.size)[:, None, None] * m + i[None, :, None]
            column = j[None, :, None] * width + np.arange(width)[None, None, :]
            shape = (grid.size, len(i), width)
            rows.append(np.broadcast_to(row, shape).ravel())
            columns.append(np.broadcast_to(column, shape).ravel())
            first += grid.size * m
        return np.concatenate(rows), np.concatenate(columns)

    def _chain(self, constraint: Constraint, grid: Grid, x: Array) -> Array:
        rows, joints = np.nonzero(constraint.depends)
        total = np.zeros((grid.size, len(rows), 1 + self.problem.series.size))
        for order, slope in constraint.slopes(self._motion(grid, x)).items():
            total += slope[:, rows, joints][:, :, None] * grid.basis[order][:, None, :]
        return np.asarray(total * self.problem.limits.half_range[joints][None, :, None]).ravel()

    def _criterion(self, x: Array) -> tuple[float, Array, list[Array]]:
        motion, problem = self._motion(self._grid, x), self.problem
        if "criterion" not in self._known:
            self.counts["objective"] += 1
            information, rows = problem.information.sampled(motion)
            total = problem.known + information * (problem.measured / problem.samples)
            total[np.diag_indices_from(total)] += FLOOR * problem.measured
            self._known["criterion"] = *problem.criterion.evaluate(total), rows
        answer: tuple[float, Array, list[Array]] = self._known["criterion"]
        return answer

    def _motion(self, grid: Grid, x: Array) -> Motion:
        if not np.array_equal(self._last, x):
            self._last, self._known = x.copy(), {}
        if grid not in self._known:
            self._known[grid] = grid.motion(x)
        motion: Motion = self._known[grid]
        return motion


class _Call(ca.Callback):
    """A Python function as a CasADi function, by way of memory that both see."""

    def __init__(
        self, name: str, function: Callable[[Array], tuple[Array, ...]], inputs: list[Any], outputs: list[Any]
    ):
        ca.Callback.__init__(self)
        self._function, self._in, self._out = function, inputs, outputs
        self.construct(name, {})

    def get_n_in(self) -> int:
        """Variables, and perhaps parameters."""
        return len(self._in)

    def get_n_out(self) -> int:
        """What the function returns."""
        return len(self._out)

    def get_sparsity_in(self, i: int) -> Any:
        """Dense."""
        return self._in[i]

    def get_sparsity_out(self, i: int) -> Any:
        """As given."""
        return self._out[i]

    def has_eval_buffer(self) -> bool:
        """So that no number is copied one by one."""
        return True

    def eval_buffer(self, arguments: Any, results: Any) -> int:
        """Fill the results; 1 tells the solver that the point cannot be evaluated."""
        values = self._function(np.frombuffer(arguments[0], dtype=np.float64))
        for memory, value in zip(results, values, strict=True):
            if memory is not None and len(memory):
                np.frombuffer(memory, dtype=np.float64)[...] = value
        return int(not all(np.isfinite(value).all() for value in values))


class Program:
    """An evaluation as a nonlinear program. Keeps what CasADi only borrows."""

    def __init__(self, evaluation: Evaluation, settings: NlpSettings) -> None:
        """Not yet solved."""
        n, m = evaluation.variables, len(evaluation.bounds(0.0)[0])
        rows, columns = evaluation.pattern
        order = np.lexsort((rows, columns))
        sparsity = ca.Sparsity.triplet(m, n, rows[order].tolist(), columns[order].tolist())
        x_in, p_in = ca.Sparsity.dense(n), ca.Sparsity(0, 0)
        one, column, constraints = ca.Sparsity.dense(1), ca.Sparsity.dense(n), ca.Sparsity.dense(m)
        self.evaluation = evaluation
        e = evaluation
        self._calls = {
            "f": _Call("objective", lambda x: (np.array([e.objective(x)]),), [x_in], [one]),
            "g": _Call("constraints", lambda x: (e.constraints(x),), [x_in], [constraints]),
            "grad_f": _Call(
                "gradient", lambda x: (np.array([e.objective(x)]), e.gradient(x)), [x_in, p_in], [one, column]
            ),
            "jac_g": _Call(
                "jacobian", lambda x: (e.constraints(x), e.jacobian(x)[order]), [x_in, p_in], [constraints, sparsity]
            ),
        }
        symbols = ca.MX.sym("x", n)
        derivatives = {"grad_f": self._calls["grad_f"], "jac_g": self._calls["jac_g"], "no_nlp_grad": True}
        self.nlp: NonlinearProgram = build_nlp(
            symbols,
            self._calls["f"](symbols),
            constraints=self._calls["g"](symbols),
            settings=settings,
            derivatives=derivatives,
        )


def default_settings(max_iterations: int, max_seconds: float, tolerance: float) -> NlpSettings:
    """IPOPT with gradients only."""
    return NlpSettings(
        tolerance=tolerance,
        acceptable_tolerance=10.0 * tolerance,
        max_iterations=max_iterations,
        max_seconds=max_seconds,
        hessian=HessianKind.LIMITED_MEMORY,
        scaling=False,
        barrier=None,
        restoration=RESTORATION,
    )

"""The optimisation over all joints' coordinates at once, with exact derivatives, in the form IPOPT takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.excitation.blocks import Block
from casysid.excitation.criteria import Criterion
from casysid.excitation.information import Information
from casysid.excitation.series import ORDERS, FourierSeries, Motion
from casysid.nlp import HessianKind, NlpSettings, NonlinearProgram, build_nlp


@dataclass(eq=False, kw_only=True)
class Evaluation:
    """Objective, constraints and their derivatives at a vector of variables; remembers the last one.

    Variables are, joint by joint, the start and the coordinates, in units of ``unit``. Not to be shared by threads.

    Attributes:
        series: The basis.
        samples: Instants of the grid in a period.
        unit: Of each joint's variables, shape (n,), [rad, m].
        information: How to see it.
        known: Information from before, shape (r, r).
        weight: How many measured samples each instant of the grid stands for.
        floor: Added to the diagonal of the information, so that it can be inverted.
        criterion: To be minimised.
        blocks: To be kept.
        counts: How often each of objective, gradient, constraints and Jacobian was evaluated.
    """

    series: FourierSeries
    samples: int
    unit: Array
    information: Information
    known: Array
    weight: float
    floor: float
    criterion: Criterion
    blocks: Sequence[Block]
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("objective", "gradient", "constraints", "jacobian"), 0))

    def __post_init__(self) -> None:
        time = self.series.grid(self.samples)
        ones = np.ones((self.samples, 1))
        self._basis = [np.hstack([ones * (order == 0), self.series.basis(time, order)]) for order in range(ORDERS)]
        self._last: tuple[Array, Motion] | None = None
        self._known: dict[str, Any] = {}

    @property
    def variables(self) -> int:
        """Their number."""
        return len(self.unit) * (1 + self.series.size)

    def motion(self, x: Array) -> Motion:
        """On the grid."""
        if self._last is None or not np.array_equal(self._last[0], x):
            coordinates = x.reshape(len(self.unit), -1) * self.unit[:, None]
            self._last = x.copy(), Motion(*(basis @ coordinates.T for basis in self._basis))
            self._known = {}
        return self._last[1]

    def objective(self, x: Array) -> float:
        """The criterion."""
        self.counts["objective"] += 1
        return float(self._criterion(x)[0])

    def gradient(self, x: Array) -> Array:
        """Of the criterion, shape (variables,)."""
        self.counts["gradient"] += 1
        _, slope, rows = self._criterion(x)
        motion = self.motion(x)
        parts = self.information.pull_back(motion, rows, self.weight * slope)
        total = sum(part.T @ basis for part, basis in zip(parts, self._basis, strict=False))
        return np.asarray(self.unit[:, None] * total).ravel()

    def total(self, information: Array) -> Array:
        """All information, from that of the grid."""
        return np.asarray(self.known + self.weight * information + self.floor * np.eye(len(self.known)))

    def _criterion(self, x: Array) -> tuple[float, Array, list[Array]]:
        motion = self.motion(x)
        if "criterion" not in self._known:
            information, rows = self.information.sampled(motion)
            self._known["criterion"] = *self.criterion.evaluate(self.total(information)), rows
        answer: tuple[float, Array, list[Array]] = self._known["criterion"]
        return answer

    def constraints(self, x: Array) -> Array:
        """Instant by instant within each block."""
        self.counts["constraints"] += 1
        motion = self.motion(x)
        return np.concatenate([block.constrain(motion).ravel() for block in self.blocks] or [np.empty(0)])

    def bounds(self, tightening: float) -> tuple[Array, Array]:
        """Of the constraints, moved inwards."""
        sides = [[np.tile(side, self.samples) for side in block.bounds] for block in self.blocks]
        if not sides:
            return np.empty(0), np.empty(0)
        lower, upper = (np.concatenate(parts) for parts in zip(*sides, strict=True))
        return lower + tightening, upper - tightening

    def jacobian(self, x: Array) -> Array:
        """Nonzeros in the order of :attr:`pattern`, before its permutation."""
        self.counts["jacobian"] += 1
        motion = self.motion(x)
        parts = [self._chain(block, motion) for block in self.blocks]
        return np.concatenate(parts or [np.empty(0)])

    def _chain(self, block: Block, motion: Motion) -> Array:
        rows, joints = np.nonzero(block.depends)
        total = 0.0
        for order, slope in block.slopes(motion).items():
            total = total + slope[:, rows, joints][:, :, None] * self._basis[order][:, None, :]
        return np.asarray(total * self.unit[joints][None, :, None]).ravel()

    @property
    def pattern(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Row and column of each nonzero of :meth:`jacobian`."""
        width, first = 1 + self.series.size, 0
        rows, columns = [np.empty(0, np.intp)], [np.empty(0, np.intp)]
        for block in self.blocks:
            i, j = np.nonzero(block.depends)
            m = len(block.depends)
            row = first + np.arange(self.samples)[:, None, None] * m + i[None, :, None]
            column = j[None, :, None] * width + np.arange(width)[None, None, :]
            shape = (self.samples, len(i), width)
            rows.append(np.broadcast_to(row, shape).ravel())
            columns.append(np.broadcast_to(column, shape).ravel())
            first += self.samples * m
        return np.concatenate(rows), np.concatenate(columns)


class _Call(ca.Callback):
    """A Python function as a CasADi function, by way of memory that both see."""

    def __init__(self, name: str, function: Callable[[Array], tuple[Array, ...]], inputs: list[Any], outputs: list[Any]):
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
        barrier=1e-1,
    )

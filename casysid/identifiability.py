"""Which parameters can be known at all, which this recording shows, and in what combinations.

Structure: the regressor at random states has a null space however rich the motion is. Columns are taken from the base
to the tip; one that depends on those before it joins them, so that ``β = θ_independent + K θ_dependent`` are the base
parameters (Gautier and Khalil 1990, numerical form Gautier 1991). Data: the same on the moments of a recording, where
further directions may be too weak.
"""

from __future__ import annotations

import enum
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_triangular

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.memory import NUMBER, require_memory
from casysid.moments import Moments
from casysid.robot import Robot
from casysid.robot.coordinates import state_from_channels
from casysid.threads import single_threaded

RANK_TOLERANCE = 3e-5
"""Relative singular values below this are rounding of the model's angles (four digits give 1e-6), not rank."""
QUIETEST_COLUMN = 1e-8
"""Columns smaller than this fraction of the largest are rounding of the arithmetic."""
PANEL = 64
"""Columns that are eliminated together: products of matrices are many times faster than products of vectors."""
FEWEST_STATES = 40
STATES_PER_COLUMN = 2
"""Random states for each column of the longest row: twice as many equations of one joint as it has unknowns."""
MATRICES = 8
"""Of all columns by all columns at once: sums, scaled sums, factor, weights, and what their making takes."""
COEFFICIENT_TOLERANCE = 1e-3
"""Weights in a combination below this fraction of its largest are left out of the words."""


class Identifiability(enum.Enum):
    """What can be known of one parameter; the value is the phrase a user reads."""

    ALONE = "by itself"
    COMBINED = "only in combination"
    NOT_AT_ALL = "not at all"


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """The minimal set of combinations that the torque depends on.

    Attributes:
        names: Of all p parameters.
        independent: Indices of the parameters that lead a combination, shape (r,).
        transform: ``β = B θ``, shape (r, p): one at the leading parameter, the others' weights beside it.
        condition_number: Of the standardised regressor of the base parameters.
    """

    names: tuple[str, ...]
    independent: npt.NDArray[np.intp]
    transform: Array
    condition_number: float

    @property
    def rank(self) -> int:
        """Number of base parameters."""
        return len(self.independent)

    def words(self) -> tuple[str, ...]:
        """Each combination written out, such as ``link_1.Izz + 0.09 link_2.m``."""
        return tuple(self._combination(row) for row in range(self.rank))

    def _combination(self, row: int) -> str:
        weights = self.transform[row]
        leading = int(self.independent[row])
        text = self.names[leading]
        for column in np.flatnonzero(np.abs(weights) > COEFFICIENT_TOLERANCE * np.abs(weights).max()):
            if column != leading:
                weight = weights[column]
                factor = "" if np.isclose(abs(weight), 1.0, rtol=1e-6) else f"{abs(weight):.4g} "
                text += f" {'-' if weight < 0 else '+'} {factor}{self.names[column]}"
        return text

    def identifiability(self) -> tuple[Identifiability, ...]:
        """For each of the p parameters: by itself, only in combination, not at all."""
        mixed = np.abs(self.transform) > COEFFICIENT_TOLERANCE * np.abs(self.transform).max(axis=1, keepdims=True)
        alone = mixed.sum(axis=1) == 1
        return tuple(
            Identifiability.NOT_AT_ALL
            if not mixed[:, column].any()
            else Identifiability.ALONE
            if alone[mixed[:, column]].all()
            else Identifiability.COMBINED
            for column in range(len(self.names))
        )


def base_parameters_of_gram(
    gram: Array, names: tuple[str, ...], tolerance: float = RANK_TOLERANCE, quietest: float = QUIETEST_COLUMN
) -> BaseParameters:
    """Base parameters from a Gram matrix of the regressor's rows.

    Args:
        gram: ``Σ x xᵀ``, shape (p, p).
        names: Of the p parameters.
        tolerance: Relative singular values below this are no rank.
        quietest: Columns smaller than this fraction of the largest are zero.
    """
    energy = np.diag(gram).copy()
    live = energy > quietest**2 * max(energy.max(initial=0.0), np.finfo(np.float64).tiny)
    scale = np.where(live, 1.0 / np.sqrt(np.where(live, energy, 1.0)), 0.0)
    S = gram * np.outer(scale, scale)
    independent, echelon = _eliminate(S, live, tolerance**2 * len(S))
    weights = solve_triangular(echelon[:, independent], echelon)
    transform = weights * scale[independent][:, None] / np.where(live, scale, 1.0)
    transform[:, independent] = np.eye(len(independent))
    energies = np.linalg.eigvalsh(S[np.ix_(independent, independent)]) if len(independent) else np.ones(1)
    condition = float(np.sqrt(energies[-1] / max(energies[0], np.finfo(np.float64).eps * energies[-1])))
    return BaseParameters(names, independent, frozen(transform), condition)


def _eliminate(S: Array, live: Array, smallest: float) -> tuple[npt.NDArray[np.intp], Array]:
    """Columns that are not combinations of those before them, and the rows ``R`` of ``S = Rᵀ R``, shape (r, p).

    A Cholesky factorisation that passes over columns of which those before leave less than ``smallest``: what Gram and
    Schmidt do to the rows themselves. Coefficients of a column that is passed over are of those before it alone.
    """
    p = len(S)
    R, independent = np.zeros((p, p)), list[int]()
    for start in range(0, p, PANEL):
        panel, first = slice(start, start + PANEL), len(independent)
        left = S[panel, start:] - R[:first, panel].T @ R[:first, start:]
        for row, column in zip(left, range(start, p), strict=False):
            rank = len(independent)
            row = row[column - start :] - R[first:rank, column] @ R[first:rank, column:]
            if live[column] and row[0] > smallest:
                R[rank, column:] = row / np.sqrt(row[0])
                independent.append(column)
    return np.array(independent, dtype=np.intp), R[: len(independent)]


@single_threaded()
def structural_base_parameters(regressor: Regressor, *, samples: int = 0, seed: int = 0) -> BaseParameters:
    """Base parameters of the mechanism itself, from random states within its limits (Gautier 1991).

    Raises:
        ParameterError: There are more columns than fit into memory.
    """
    p = len(regressor.names)
    require_memory(
        MATRICES * NUMBER * float(p) ** 2,
        f"finding base parameters of {p} columns",
        "Lock joints that are of no interest",
    )
    count = samples or FEWEST_STATES + STATES_PER_COLUMN * max(map(len, regressor.row_columns), default=0)
    rng = np.random.default_rng(seed)
    q, v, a = random_states(regressor.robot, count, rng)
    remembered = (rng.uniform(-1.0, 1.0, (count, regressor.history_count)),) if regressor.history_count else ()
    gram = _gram_of_states(regressor, q, v, a, remembered)
    return base_parameters_of_gram(gram, regressor.names, quietest=RANK_TOLERANCE)


def _gram_of_states(regressor: Regressor, q: Array, v: Array, a: Array, remembered: tuple[Array, ...]) -> Array:
    """``Σ x xᵀ`` over states and joints, shape (p, p), in memory of that size; ``remembered`` is what friction does."""
    rows, p = regressor.equations, len(regressor.names)
    inputs, samples = rows.check((q, v, a, np.zeros(regressor.robot.nv), *remembered))
    gram = np.zeros((p, p))
    ends = np.cumsum([len(columns) + 1 for columns in regressor.row_columns])

    def add(values: Array, piece: npt.NDArray[np.intp]) -> None:
        for columns, end in zip(regressor.row_columns, ends, strict=True):
            x = values[end - 1 - len(columns) : end - 1]
            gram[columns[:, None], columns] += x @ x.T

    with single_threaded():
        deque(rows.map(add, inputs, [np.arange(samples)], threads=1), maxlen=0)
    return gram


@single_threaded()
def excited_base_parameters(regressor: Regressor, moments: Moments, noise_std: Array) -> BaseParameters:
    """Base parameters that a recording shows, joints weighted by ``1/σ²``; ``noise_std`` of shape (joints,), [N m]."""
    return base_parameters_of_gram(moments.pooled(noise_std**-2.0).xx, regressor.names)


def random_states(robot: Robot, count: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Random ``q, v, a`` of shapes (N, nq), (N, nv), (N, nv); positions within limits where there are any."""
    lower = np.where(np.isfinite(robot.position_lower), robot.position_lower, -np.pi)
    upper = np.where(np.isfinite(robot.position_upper), robot.position_upper, np.pi)
    position = rng.uniform(lower, upper, size=(count, len(robot.channels)))
    for joint in robot.joints:
        if joint.channels.stop - joint.channels.start >= 4:
            quaternion = slice(joint.channels.stop - 4, joint.channels.stop)
            position[:, quaternion] = rng.normal(size=(count, 4))
            position[:, quaternion] /= np.linalg.norm(position[:, quaternion], axis=1, keepdims=True)
    q, _, _ = state_from_channels(robot, position, np.zeros_like(position), np.zeros_like(position))
    return q, rng.normal(size=(count, robot.nv)), 3.0 * rng.normal(size=(count, robot.nv))

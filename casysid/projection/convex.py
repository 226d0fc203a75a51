"""The same projection as a semidefinite program, whose optimum is global: the certificate, and the fall-back.

``min ‖C φ - d‖²`` over ``φ``, each link's consistency matrix at or above the floor, single numbers not negative,
knowledge as linear rows. Clarabel solves it in some 10 ms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse

from casysid.arrays import Array, frozen
from casysid.errors import SolverError
from casysid.inertia import CONSISTENCY_BASIS, Consistency
from casysid.projection.frame import UNIT_BODY, Frame
from casysid.projection.knowledge import Constraints
from casysid.projection.layout import Layout
from casysid.projection.objective import SCALE, Objective

TOLERANCE = 1e-9
"""What Clarabel is asked for; it seldom gets quite there."""
ACCURACY = 1e-5
"""Its answer is looked at when the residuals are below this; the duality gap is for the caller to judge."""


@dataclass(frozen=True, eq=False)
class Cone:
    """The feasible set in the frame's coordinates, ``b - A φ`` in a product of cones.

    Attributes:
        matrix: ``A``, sparse, shape (rows, p).
        offset: ``b``, shape (rows,).
        equalities: Rows that have to be zero; they come first.
        inequalities: Rows that must not be negative; they follow.
        bodies: Links whose matrix must be positive semidefinite, shape (b,); their triangles follow.
        consistency: What is asked of them.
    """

    matrix: Any
    offset: Array
    equalities: int
    inequalities: int
    bodies: npt.NDArray[np.intp]
    consistency: Consistency

    @property
    def order(self) -> int:
        """Rows of a link's matrix."""
        return len(CONSISTENCY_BASIS[self.consistency][0])

    def contains(self, scaled: Array, tolerance: float = 1e-9) -> bool:
        """Whether ``φ``, shape (p,), is feasible."""
        slack = self.offset - self.matrix @ scaled
        linear = self.equalities + self.inequalities
        smallest = np.linalg.eigvalsh(self.matrices(scaled)).min(initial=np.inf)
        worst = min(smallest, slack[self.equalities : linear].min(initial=np.inf))
        return bool(worst >= -tolerance and np.abs(slack[: self.equalities]).max(initial=0.0) <= tolerance)

    def matrices(self, scaled: Array) -> Array:
        """What must be positive semidefinite at ``φ``, lower triangles, shape (bodies, order, order)."""
        linear = self.equalities + self.inequalities
        column, row = np.tril_indices(self.order)
        triangles = (self.offset[linear:] - self.matrix[linear:] @ scaled).reshape(len(self.bodies), len(row))
        matrices = np.zeros((len(self.bodies), self.order, self.order))
        matrices[:, column, row] = triangles / np.where(row == column, 1.0, np.sqrt(2.0))
        return matrices

    def gradients(self, body: npt.NDArray[np.intp], v: Array) -> Array:
        """Derivatives by ``φ`` of ``vᵀ M v``, ``M`` a body's matrix, shape (k, p), for ``v`` of shape (k, order)."""
        rows = np.zeros((len(body), self.matrix.shape[1]))
        own = 10 * self.bodies[body, None] + np.arange(10)
        basis = CONSISTENCY_BASIS[self.consistency]
        rows[np.arange(len(body))[:, None], own] = np.einsum("ki,mij,kj->km", v, basis, v, optimize=True)
        return rows


def cone_of(layout: Layout, constraints: Constraints, frame: Frame, consistency: Consistency, floor: float) -> Cone:
    """The feasible set of a projection."""
    unit = np.eye(len(layout))
    rows, lower, upper = constraints.in_coordinates(frame.transform)
    same = lower == upper
    below, above = ~same & np.isfinite(upper), ~same & np.isfinite(lower)
    single = list(layout.non_negative)
    triangle = _triangle(consistency)
    free = np.flatnonzero(~constraints.kept[: layout.inertial : 10])
    pick = np.eye(len(layout.links))[free]
    bodies = sparse.hstack(
        [sparse.kron(pick, -triangle), sparse.csr_matrix((len(free) * len(triangle), len(layout) - layout.inertial))]
    )
    matrix = sparse.vstack(
        [unit[constraints.kept], rows[same], rows[below], -rows[above], -unit[single], bodies], format="csc"
    )
    offset = np.concatenate(
        [
            frame.scaled_prior[constraints.kept],
            lower[same],
            upper[below],
            -lower[above],
            np.zeros(len(single)),
            np.tile(-floor * triangle @ UNIT_BODY, len(free)),
        ]
    )
    return Cone(
        matrix,
        frozen(offset),
        int(constraints.kept.sum() + same.sum()),
        int(below.sum() + above.sum() + len(single)),
        free,
        consistency,
    )


def _triangle(consistency: Consistency) -> Array:
    """Upper triangle of the consistency matrix by columns, off-diagonal entries times √2 (Clarabel): (entries, 10)."""
    basis = CONSISTENCY_BASIS[consistency]
    places: Sequence[tuple[int, int]] = [(i, j) for j in range(basis.shape[1]) for i in range(j + 1)]
    return np.array([basis[:, i, j] * (1.0 if i == j else np.sqrt(2.0)) for i, j in places])


@dataclass(frozen=True, eq=False)
class ConvexOptimum:
    """What Clarabel found.

    Attributes:
        scaled: ``φ``, feasible up to rounding, shape (p,).
        bound: No feasible point has a smaller objective than this (the dual objective).
    """

    scaled: Array
    bound: float


def solve_convex(objective: Objective, cone: Cone, reference: Array) -> ConvexOptimum | None:
    """The global optimum, or None when Clarabel has no answer.

    The unknowns are ``φ - reference`` and the residual ``z = C φ - d``: ``C`` is never squared and nothing cancels.

    Args:
        objective: What is minimised.
        cone: The feasible set.
        reference: A point of the right order of magnitude, such as the prior, shape (p,).

    Raises:
        SolverError: No parameters satisfy the constraints.
    """
    import clarabel

    p = len(reference)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.equilibrate_enable = False  # the frame has done it, and better
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    kinds = [clarabel.ZeroConeT(p + cone.equalities), clarabel.NonnegativeConeT(cone.inequalities)]
    kinds += [clarabel.PSDTriangleConeT(cone.order)] * len(cone.bodies)
    quadratic = sparse.diags(np.repeat([0.0, 2.0 * SCALE], p), format="csc")
    rows = sparse.bmat([[sparse.csc_matrix(objective.factor), -sparse.eye(p)], [cone.matrix, None]], format="csc")
    offset = np.concatenate([objective.target - objective.factor @ reference, cone.offset - cone.matrix @ reference])
    solution = clarabel.DefaultSolver(quadratic, np.zeros(2 * p), rows, offset, kinds, settings).solve()
    if str(solution.status) in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
        raise SolverError(
            "projection: no physically consistent parameters satisfy what is claimed to be known; relax or correct it"
        )
    if not max(solution.r_prim, solution.r_dual) < ACCURACY:  # not a number is not below
        return None
    return ConvexOptimum(reference + np.array(solution.x[:p]), solution.obj_val_dual / SCALE)

"""The projection as a nonlinear program over virtual parameters, for IPOPT, with structured exact derivatives.

``f(u) = ‖C φ(u) - d‖²`` with ``φ(u) = floor + virtual-parameter map``: every ``u`` is consistent. The gradient is
``2 Jᵀ Cᵀ (C φ - d)`` and the Hessian ``2 Jᵀ H J``, ``H = Cᵀ C``, plus the map's own curvature, ten by ten a link: far
cheaper than to differentiate ``f`` blindly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.inertia import (
    Consistency,
    parameters_from_virtual,
    symbolic_parameters_from_virtual,
    virtual_from_parameters,
)
from casysid.nlp import NlpSettings, NonlinearProgram, build_nlp
from casysid.projection.frame import UNIT_BODY, Frame
from casysid.projection.knowledge import Constraints
from casysid.projection.layout import Layout
from casysid.projection.objective import SCALE, Objective

SETTINGS = NlpSettings(
    tolerance=1e-5, constraint_tolerance=1e-9, acceptable_tolerance=1e-5, max_iterations=600, scaling=False
)


@dataclass(frozen=True, eq=False)
class ProjectionProgram:
    """IPOPT's program, and what its variables mean.

    The variables are ten virtual parameters for each link that is not kept, then the joints' numbers, as square roots
    where they cannot be negative.

    Attributes:
        nlp: What :func:`casysid.nlp.solve_nlp` takes.
        layout: Order of the parameters.
        free: Links that are not kept.
        consistency: What is asked of them.
        floor: Smallest eigenvalue of a scaled link's matrix.
    """

    nlp: NonlinearProgram
    layout: Layout
    free: npt.NDArray[np.intp]
    consistency: Consistency
    floor: float

    def variables(self, scaled: Array) -> Array:
        """``u`` of a feasible ``φ``."""
        bodies = scaled[: self.layout.inertial].reshape(-1, 10)[self.free] - self.floor * UNIT_BODY
        single, roots = scaled.copy(), list(self.layout.non_negative)
        single[roots] = np.sqrt(np.maximum(single[roots], 0.0))
        virtual = virtual_from_parameters(bodies, self.consistency)
        return np.concatenate([virtual.ravel(), single[self.layout.inertial :]])

    def scaled(self, variables: Array, kept: Array) -> Array:
        """``φ`` of ``u``; links that are kept are taken from ``kept``, shape (p,)."""
        scaled, inertial, roots = kept.copy(), self.layout.inertial, list(self.layout.non_negative)
        bodies = scaled[:inertial].reshape(-1, 10)
        virtual = variables[: 10 * len(self.free)].reshape(-1, 10)
        bodies[self.free] = parameters_from_virtual(virtual, self.consistency) + self.floor * UNIT_BODY
        scaled[inertial:] = variables[10 * len(self.free) :]
        scaled[roots] = scaled[roots] ** 2
        return scaled

    def values(self, objective: Objective, frame: Frame, rows: Array) -> Array:
        """Values of the program's parameters."""
        columns = np.tril_indices(len(self.layout))  # of the transpose: the upper triangle by columns
        square = objective.factor.T @ objective.factor
        triangles = objective.factor.T[columns], square[columns]
        return np.concatenate([*triangles, objective.target, frame.scaled_prior, rows.ravel(order="F")])


def build_program(
    layout: Layout, constraints: Constraints, consistency: Consistency, floor: float
) -> ProjectionProgram:
    """Build the program once; parameters of the objective come with each solve."""
    p, c = len(layout), len(constraints.matrix)
    free = np.flatnonzero(~constraints.kept[: layout.inertial : 10])
    upper = ca.Sparsity.upper(p)
    c_entries, h_entries, d = ca.SX.sym("C", upper.nnz()), ca.SX.sym("H", upper.nnz()), ca.SX.sym("d", p)
    C, H = ca.SX(upper, c_entries), ca.triu2symm(ca.SX(upper, h_entries))
    kept, A = ca.SX.sym("kept", p), ca.SX.sym("A", c, p)
    given = ca.vertcat(c_entries, h_entries, d, kept, ca.vec(A))
    u, phi = _scaled_parameters(layout, free, kept, consistency, floor)
    J, residual = ca.jacobian(phi, u), C @ phi - d
    objective, constraint, slope = SCALE * ca.sumsqr(residual), A @ phi, 2.0 * SCALE * (C.T @ residual)
    lam_f, lam_g, pull = ca.SX.sym("lam_f"), ca.SX.sym("lam_g", c), ca.SX.sym("pull", p)
    curvature = ca.jacobian(ca.jacobian(ca.dot(pull, phi), u), u)  # of the map alone, (10, 10) blocks
    curvature = ca.substitute(curvature, pull, lam_f * slope + A.T @ lam_g)
    hessian = ca.triu(2.0 * SCALE * lam_f * (J.T @ (H @ J)) + curvature)
    derivatives = {
        "grad_f": ca.Function("grad_f", [u, given], [objective, J.T @ slope], ["x", "p"], ["f", "grad_f_x"]),
        "hess_lag": ca.Function(
            "hess_lag", [u, given, lam_f, lam_g], [hessian], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        ),
    }
    nlp = build_nlp(u, objective, parameters=given, constraints=constraint, settings=SETTINGS, derivatives=derivatives)
    return ProjectionProgram(nlp, layout, free, consistency, floor)


def _scaled_parameters(
    layout: Layout, free: npt.NDArray[np.intp], kept: Any, consistency: Consistency, floor: float
) -> tuple[Any, Any]:
    """Virtual parameters ``u`` and ``φ(u)``, symbolic columns."""
    bodies, single = ca.SX.sym("bodies", 10, len(free)), ca.SX.sym("single", len(layout) - layout.inertial)
    mapped = symbolic_parameters_from_virtual(bodies, consistency) + ca.repmat(ca.DM(floor * UNIT_BODY), 1, len(free))
    place = {int(link): column for column, link in enumerate(free)}
    links = [
        mapped[:, place[link]] if link in place else kept[10 * link : 10 * link + 10]
        for link in range(len(layout.links))
    ]
    roots = set(layout.non_negative)
    numbers = [
        single[k] ** 2 if layout.inertial + k in roots else single[k] for k in range(len(layout) - layout.inertial)
    ]
    return ca.vertcat(ca.vec(bodies), single), ca.vertcat(*links, *numbers)

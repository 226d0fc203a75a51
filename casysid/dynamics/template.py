"""What the regressors of one robot share that differ in nothing but the numbers that their friction leaves open.

A search over widths of smooth signs makes many regressors. The widths are inputs of the functions here, so that the
mechanism's algebra is done, and its code compiled, only once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.dynamics import symbolic
from casysid.dynamics.bulk import Bulk
from casysid.dynamics.drive import FrictionPart, Parameter, PartMaker, SymbolicPart, drive_parts
from casysid.dynamics.friction import Coupling, FrictionKind
from casysid.dynamics.joints import constant
from casysid.robot import Robot

_INERTIAL = {
    "m": "kg", "mcx": "kg m", "mcy": "kg m", "mcz": "kg m",
    "Ixx": "kg m^2", "Ixy": "kg m^2", "Iyy": "kg m^2", "Ixz": "kg m^2", "Iyz": "kg m^2", "Izz": "kg m^2",
}  # fmt: skip
_POSITIVE = {"m", "Ixx", "Iyy", "Izz"}
KEPT = 4
"""Templates that are kept for the next regressor."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Template:
    """``tau = Y(q, v, a, histories; numbers) θ``.

    Attributes:
        robot: Whose torques these are.
        parameters: What the p columns multiply.
        function: ``casadi.Function`` ``(q, v, a, histories, numbers) -> Y``, sparse, shape (nv, p).
        torque: ``casadi.Function`` ``(q, v, a, parameters, histories, numbers) -> tau``.
        parts: Friction whose open numbers are the last input, in the order of its columns.
    """

    robot: Robot
    parameters: tuple[Parameter, ...]
    function: Any
    torque: Any
    parts: tuple[FrictionPart, ...] = ()

    @cached_property
    def row_columns(self) -> tuple[npt.NDArray[np.intp], ...]:
        """For each degree of freedom, the columns that are structurally nonzero in its row of ``Y``."""
        rows, columns = (np.array(index, dtype=np.intp) for index in self.function.sparsity_out(0).get_triplet())
        return tuple(np.sort(columns[rows == dof]) for dof in range(self.robot.nv))

    @cached_property
    def equations(self) -> Bulk:
        """``(q, v, a, tau, histories, numbers)`` -> for each degree of freedom its row's nonzeros, then its torque."""
        state, tau = symbolic.State.of(self.robot), ca.SX.sym("tau", self.robot.nv)
        numbers = ca.SX.sym("numbers", self.function.nnz_in("numbers"))
        histories = ca.SX.sym("histories", self.function.nnz_in("histories"))
        Y = self.function(state.q, state.v, state.a, histories, numbers)
        entries = [
            entry
            for dof, columns in enumerate(self.row_columns)
            for entry in (*(Y[dof, int(column)] for column in columns), tau[dof])
        ]
        inputs = [state.q, state.v, state.a, tau, histories, numbers]
        names = ["q", "v", "a", "tau", "histories", "numbers"]
        return Bulk(ca.Function("equations", inputs, [ca.vertcat(*entries)], names, ["rows"], {"cse": True}))

    @cached_property
    def torques(self) -> Bulk:
        """``(q, v, a, parameters, histories, numbers) -> tau``."""
        return Bulk(self.torque)


def build_template(
    robot: Robot,
    friction: Sequence[FrictionKind],
    couplings: Sequence[Coupling],
    quasi_static: bool,
    gains: Sequence[float],
) -> Template:
    """The template for some friction, whatever its numbers; arguments as :func:`~casysid.dynamics.build_regressor`.

    Raises:
        ParameterError: A coupling names an unknown joint, or a column uses a position that is none.
    """
    numberless = tuple(kind.with_open_numbers() for kind in friction)
    arguments = robot, numberless, tuple(couplings), quasi_static, tuple(gains)
    try:
        return _kept(*arguments)
    except TypeError:  # a kind holds what cannot be hashed, such as a velocity for each joint's name
        return _build(*arguments)


def finish_template(
    robot: Robot,
    state: symbolic.State,
    parameters: tuple[Parameter, ...],
    Y: Any,
    theta: Any,
    tau: Any,
    parts: Sequence[SymbolicPart],
    histories: Any,
) -> Template:
    """The functions of expressions for ``Y`` and ``tau`` in a state, ``theta`` and the parts' open numbers.

    The parts' columns and histories are the last ones.
    """
    inputs, names = [state.q, state.v, state.a], ["q", "v", "a"]
    numbers = ca.vertcat(ca.SX(0, 1), *(part.numbers for part in parts))
    histories = ca.vertcat(histories, *(part.histories for part in parts))
    columns = iter(range(len(parameters) - sum(len(part.parameters) for part in parts), len(parameters)))
    return Template(
        robot=robot,
        parameters=parameters,
        function=ca.Function(
            "regressor",
            [*inputs, histories, numbers],
            [ca.sparsify(Y)],
            [*names, "histories", "numbers"],
            ["Y"],
            {"cse": True},
        ),
        torque=ca.Function(
            "torque",
            [*inputs, theta, histories, numbers],
            [ca.densify(tau)],
            [*names, "parameters", "histories", "numbers"],
            ["tau"],
            {"cse": True},
        ),
        parts=tuple(
            FrictionPart(part.kind, part.direction, tuple(islice(columns, len(part.parameters)))) for part in parts
        ),
    )


def _build(
    robot: Robot,
    friction: tuple[FrictionKind, ...],
    couplings: tuple[Coupling, ...],
    quasi_static: bool,
    gains: tuple[float, ...],
) -> Template:
    state, still = symbolic.State.of(robot), ca.SX(robot.nv, 1)
    motions = symbolic.link_motions(robot, symbolic.State(state.q, still, still) if quasi_static else state)
    part_along = PartMaker(robot, symbolic.State(state.q, state.v, still) if quasi_static else state)
    parts = list(drive_parts(part_along, friction, couplings))
    drive_matrix = ca.horzcat(ca.SX(robot.nv, 0), *(part.torques for part in parts))
    parameters = (*_inertial_parameters(robot), *(parameter for part in parts for parameter in part.parameters))
    rigid = robot.inertial_parameters.size
    theta = ca.SX.sym("parameters", len(parameters))
    measured = ca.diag(constant(np.array(gains)))
    Y = measured @ ca.horzcat(symbolic.regressor(robot, motions), drive_matrix)
    tau = measured @ (symbolic.inverse_dynamics(robot, motions, theta[:rigid]) + drive_matrix @ theta[rigid:])
    return finish_template(robot, state, parameters, Y, theta, tau, parts, ca.SX(0, 1))


_kept = lru_cache(KEPT)(_build)


def _inertial_parameters(robot: Robot) -> tuple[Parameter, ...]:
    values = robot.inertial_parameters.reshape(-1, len(_INERTIAL))
    return tuple(
        Parameter(f"{link}.{kind}", link, kind, unit, kind in _POSITIVE, float(prior))
        for link, priors in zip(robot.links, values, strict=True)
        for (kind, unit), prior in zip(_INERTIAL.items(), priors, strict=True)
    )

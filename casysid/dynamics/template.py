"""What the regressors of one robot share that differ in nothing but the numbers that their friction leaves open.

A search over widths of smooth signs makes many regressors. The widths are inputs of the functions here, so that the
mechanism's algebra is done, and its code compiled, only once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any, NamedTuple

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


@dataclass(frozen=True)
class Sensing:
    """What of a robot's torques is measured.

    Attributes:
        gains: Measured torque over true torque of every degree of freedom, (nv,).
        quasi_static: Whether nothing inertial is in it.
    """

    gains: tuple[float, ...]
    quasi_static: bool = False

    def state_of_links(self, state: symbolic.State) -> symbolic.State:
        """The motion whose torques are measured, of links."""
        still = ca.SX(len(self.gains), 1)
        return symbolic.State(state.q, still, still) if self.quasi_static else state

    def state_of_drives(self, state: symbolic.State) -> symbolic.State:
        """The same of drives, whose friction is there in slow motion as well."""
        return symbolic.State(state.q, state.v, ca.SX(len(self.gains), 1)) if self.quasi_static else state

    @property
    def matrix(self) -> Any:
        """The gains as a diagonal matrix."""
        return ca.diag(constant(np.array(self.gains)))


class Expressions(NamedTuple):
    """A regressor as CasADi expressions: what its columns multiply, themselves, and their sum for ``theta``.

    Attributes:
        parameters: Of the p columns.
        Y: Shape (nv, p).
        theta: Symbols for the parameters, (p,).
        tau: ``Y θ``, (nv,).
        histories: Symbols for what friction remembers, (m,).
    """

    parameters: tuple[Parameter, ...]
    Y: Any
    theta: Any
    tau: Any
    histories: Any


@dataclass(frozen=True, eq=False, kw_only=True)
class Template:
    """``tau = Y(q, v, a, histories; numbers) θ``.

    Attributes:
        robot: Whose torques these are.
        parameters: What the p columns multiply.
        function: ``casadi.Function`` ``(q, v, a, histories, numbers) -> Y``, sparse, shape (nv, p).
        torque: ``casadi.Function`` ``(q, v, a, parameters, histories, numbers) -> tau``.
        parts: Friction whose open numbers are the last input, in the order of its columns.
        sensing: What of the torques is measured.
    """

    robot: Robot
    parameters: tuple[Parameter, ...]
    function: Any
    torque: Any
    parts: tuple[FrictionPart, ...]
    sensing: Sensing

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
    sensing: Sensing,
) -> Template:
    """The template for some friction, whatever its numbers; arguments as :func:`~casysid.dynamics.build_regressor`.

    Raises:
        ParameterError: A coupling names an unknown joint, or a column uses a position that is none.
    """
    numberless = tuple(kind.with_open_numbers() for kind in friction)
    arguments = robot, numberless, tuple(couplings), sensing
    try:
        return _kept(*arguments)
    except TypeError:  # a kind holds what cannot be hashed, such as a velocity for each joint's name
        return _build(*arguments)


def finish_template(
    robot: Robot, state: symbolic.State, sensing: Sensing, found: Expressions, parts: Sequence[SymbolicPart]
) -> Template:
    """The functions of expressions in a state and the parts' open numbers; the parts' columns are the last ones."""
    inputs, names = [state.q, state.v, state.a], ["q", "v", "a"]
    numbers = ca.vertcat(ca.SX(0, 1), *(part.numbers for part in parts))
    p = len(found.parameters)
    columns = iter(range(p - sum(len(part.parameters) for part in parts), p))
    return Template(
        robot=robot,
        parameters=found.parameters,
        function=ca.Function(
            "regressor",
            [*inputs, found.histories, numbers],
            [ca.sparsify(found.Y)],
            [*names, "histories", "numbers"],
            ["Y"],
            {"cse": True},
        ),
        torque=ca.Function(
            "torque",
            [*inputs, found.theta, found.histories, numbers],
            [ca.densify(found.tau)],
            [*names, "parameters", "histories", "numbers"],
            ["tau"],
            {"cse": True},
        ),
        parts=tuple(
            FrictionPart(part.kind, part.direction, tuple(islice(columns, len(part.parameters)))) for part in parts
        ),
        sensing=sensing,
    )


def _build(
    robot: Robot, friction: tuple[FrictionKind, ...], couplings: tuple[Coupling, ...], sensing: Sensing
) -> Template:
    state = symbolic.State.of(robot)
    motions = symbolic.link_motions(robot, sensing.state_of_links(state))
    parts = list(drive_parts(PartMaker(robot, sensing.state_of_drives(state)), friction, couplings))
    drives = ca.horzcat(ca.SX(robot.nv, 0), *(part.torques for part in parts))
    parameters = (*_inertial_parameters(robot), *(parameter for part in parts for parameter in part.parameters))
    theta, rigid = ca.SX.sym("parameters", len(parameters)), robot.inertial_parameters.size
    Y = ca.horzcat(symbolic.regressor(robot, motions), drives)
    tau = symbolic.inverse_dynamics(robot, motions, theta[:rigid]) + drives @ theta[rigid:]
    histories = ca.vertcat(ca.SX(0, 1), *(part.histories for part in parts))
    found = Expressions(parameters, sensing.matrix @ Y, theta, sensing.matrix @ tau, histories)
    return finish_template(robot, state, sensing, found, parts)


_kept = lru_cache(KEPT)(_build)


def _inertial_parameters(robot: Robot) -> tuple[Parameter, ...]:
    values = robot.inertial_parameters.reshape(-1, len(_INERTIAL))
    return tuple(
        Parameter(f"{link}.{kind}", link, kind, unit, kind in _POSITIVE, float(prior))
        for link, priors in zip(robot.links, values, strict=True)
        for (kind, unit), prior in zip(_INERTIAL.items(), priors, strict=True)
    )

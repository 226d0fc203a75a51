"""The regressor: every torque equation's coefficients of inertial and drive parameters, with what each column means."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import symbolic
from casysid.dynamics.bulk import Bulk
from casysid.dynamics.friction import (
    DEFAULT_FRICTION,
    Coupling,
    Direction,
    FrictionColumn,
    coupling_direction,
    joint_directions,
)
from casysid.dynamics.joints import constant
from casysid.errors import ParameterError
from casysid.robot import JointKind, Robot

_INERTIAL = {
    "m": "kg", "mcx": "kg m", "mcy": "kg m", "mcz": "kg m",
    "Ixx": "kg m^2", "Ixy": "kg m^2", "Iyy": "kg m^2", "Ixz": "kg m^2", "Iyz": "kg m^2", "Izz": "kg m^2",
}  # fmt: skip
_POSITIVE = {"m", "Ixx", "Iyy", "Izz"}


@dataclass(frozen=True)
class Parameter:
    """What one column of the regressor multiplies.

    Attributes:
        name: ``<owner>.<kind>``.
        owner: A link, a degree of freedom, or those of a coupling joined by ``+``.
        kind: ``m`` ... ``Izz``, or the friction column's kind.
        unit: In SI.
        non_negative: Whether it cannot be negative.
        prior: The model file's value.
    """

    name: str
    owner: str
    kind: str
    unit: str
    non_negative: bool
    prior: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Regressor:
    """``tau = Y(q, v, a) θ``, for one robot with its friction.

    Attributes:
        robot: Whose torques these are.
        parameters: What the p columns multiply: ten for each link, then friction kind by kind, then couplings.
        function: ``casadi.Function`` ``(q, v, a) -> Y``, sparse, shape (nv, p).
        torque: ``casadi.Function`` ``(q, v, a, parameters) -> tau``, which is ``Y θ`` in fewer operations.
    """

    robot: Robot
    parameters: tuple[Parameter, ...]
    function: Any
    torque: Any

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the p columns."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def prior(self) -> Array:
        """The model file's parameters, shape (p,)."""
        return frozen([parameter.prior for parameter in self.parameters])

    @cached_property
    def row_columns(self) -> tuple[npt.NDArray[np.intp], ...]:
        """For each degree of freedom, the columns that are structurally nonzero in its row of ``Y``."""
        rows, columns = (np.array(index, dtype=np.intp) for index in self.function.sparsity_out(0).get_triplet())
        return tuple(np.sort(columns[rows == dof]) for dof in range(self.robot.nv))

    @cached_property
    def equations(self) -> Bulk:
        """Bulk evaluation of ``(q, v, a, tau)`` -> for each degree of freedom its row's nonzeros, then its torque.

        The entries of row ``i`` belong to the columns ``row_columns[i]``.
        """
        state, tau = symbolic.State.of(self.robot), ca.SX.sym("tau", self.robot.nv)
        Y = self.function(state.q, state.v, state.a)
        entries = [
            entry
            for dof, columns in enumerate(self.row_columns)
            for entry in (*(Y[dof, int(column)] for column in columns), tau[dof])
        ]
        inputs = [state.q, state.v, state.a, tau]
        names = ["q", "v", "a", "tau"]
        return Bulk(ca.Function("equations", inputs, [ca.vertcat(*entries)], names, ["rows"], {"cse": True}))

    def evaluate(self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike) -> Array:
        """``Y`` at every sample, dense, shape (N, nv, p): 8 N nv p bytes.

        Args:
            q: Configurations, shape (N, nq).
            v: Velocities, shape (N, nv).
            a: Accelerations, shape (N, nv).

        Raises:
            ParameterError: When a shape does not fit.
        """
        nv, p = self.robot.nv, len(self.parameters)
        rows = self.equations
        inputs, samples = rows.check((q, v, a, np.zeros(nv)))
        out = np.zeros((samples, nv * p))
        places = np.concatenate([np.append(dof * p + columns, -1) for dof, columns in enumerate(self.row_columns)])
        filled = places >= 0  # without the torques

        def keep(values: Array, piece: npt.NDArray[np.intp]) -> None:
            out[piece[:, None], places[filled]] = values[filled].T

        deque(rows.map(keep, inputs, [np.arange(samples)], threads=2), maxlen=0)
        return out.reshape(samples, nv, p)

    def predict(self, parameters: npt.ArrayLike, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike) -> Array:
        """Torques at every sample, shape (N, nv), in memory of that size.

        Args:
            parameters: ``θ``, shape (p,).
            q: Configurations, shape (N, nq).
            v: Velocities, shape (N, nv).
            a: Accelerations, shape (N, nv).

        Raises:
            ParameterError: When a shape does not fit.
        """
        return self._torques.evaluate(q, v, a, parameters)

    @cached_property
    def _torques(self) -> Bulk:
        return Bulk(self.torque)


def build_regressor(
    robot: Robot,
    friction: Sequence[FrictionColumn] = DEFAULT_FRICTION,
    couplings: Sequence[Coupling] = (),
    *,
    quasi_static: bool = False,
) -> Regressor:
    """The regressor of a robot.

    Args:
        robot: Its links give ten columns each.
        friction: Columns of every driven degree of freedom, and of every coupling as far as they depend on motion
            there (a coupling's constant torque is a sum of its joints' constant torques).
        couplings: Motors that act on several joints.
        quasi_static: Torques hold gravity and friction, but nothing inertial: for links velocity and acceleration, for
            drives acceleration count as zero.

    Raises:
        ParameterError: When a kind of friction or a coupling is given twice, a coupling names an unknown joint, or a
            column uses the position of a degree of freedom that has none.
    """
    kinds, coupled = [column.kind for column in friction], [coupling.joints for coupling in couplings]
    if len(set(kinds)) != len(kinds) or len(set(coupled)) != len(coupled):
        raise ParameterError(f"friction: every kind and every coupling once; got {kinds} and {coupled}")
    state = symbolic.State.of(robot)
    still = ca.SX(robot.nv, 1)
    motions = symbolic.link_motions(robot, symbolic.State(state.q, still, still) if quasi_static else state)
    driven = symbolic.State(state.q, state.v, still) if quasi_static else state
    drive = list(_drive_columns(robot, driven, friction, couplings))
    drive_matrix = ca.horzcat(ca.SX(robot.nv, 0), *(column for _, column in drive))
    parameters = (*_inertial_parameters(robot), *(parameter for parameter, _ in drive))
    rigid = robot.inertial_parameters.size
    theta = ca.SX.sym("parameters", len(parameters))
    Y = ca.sparsify(ca.horzcat(symbolic.regressor(robot, motions), drive_matrix))
    tau = symbolic.inverse_dynamics(robot, motions, theta[:rigid]) + drive_matrix @ theta[rigid:]
    inputs, names = [state.q, state.v, state.a], ["q", "v", "a"]
    return Regressor(
        robot=robot,
        parameters=parameters,
        function=ca.Function("regressor", inputs, [Y], names, ["Y"], {"cse": True}),
        torque=ca.Function(
            "torque", [*inputs, theta], [ca.densify(tau)], [*names, "parameters"], ["tau"], {"cse": True}
        ),
    )


def _inertial_parameters(robot: Robot) -> Iterator[Parameter]:
    values = robot.inertial_parameters.reshape(-1, len(_INERTIAL))
    for link, priors in zip(robot.links, values, strict=True):
        for (kind, unit), prior in zip(_INERTIAL.items(), priors, strict=True):
            yield Parameter(f"{link}.{kind}", link, kind, unit, kind in _POSITIVE, float(prior))


def _drive_columns(
    robot: Robot, state: symbolic.State, friction: Sequence[FrictionColumn], couplings: Sequence[Coupling]
) -> Iterator[tuple[Parameter, Any]]:
    """Every friction column with its parameter: kind by kind for the joints, then coupling by coupling."""
    positions, missing = _positions(robot, state)

    def build(column: FrictionColumn, direction: Direction, prior: float) -> tuple[Parameter, Any] | None:
        weights = constant(direction.weights)
        s, ds, dds = (weights.T @ x for x in (positions, state.v, state.a))
        expression = column.torque(direction, s, ds, dds)
        if expression is None:
            return None
        torque = ca.SX(expression)
        if ca.depends_on(torque, missing):
            raise ParameterError(
                f"friction: '{column.kind}' uses the position of '{direction.name}', which has none; return None there"
            )
        name, unit = f"{direction.name}.{column.kind}", column.unit(direction)
        parameter = Parameter(name, direction.name, column.kind, unit, column.non_negative, prior)
        return parameter, weights @ torque

    joints = joint_directions(robot)
    ordinary = [
        build(column, direction, column.prior(robot, dof)) for column in friction for dof, direction in joints.items()
    ]
    coupled = [
        build(column, direction, 0.0)
        for direction in (coupling_direction(robot, coupling) for coupling in couplings)
        for column in friction
    ]
    yield from (entry for entry in ordinary if entry is not None)
    moving = ca.vertcat(state.q, state.v, state.a)
    yield from (entry for entry in coupled if entry is not None and ca.depends_on(entry[1], moving))


def _positions(robot: Robot, state: symbolic.State) -> tuple[Any, Any]:
    """The coordinate of each degree of freedom (nv,), with a symbol where there is none; and these symbols."""
    missing = ca.SX.sym("position", robot.nv)
    positions = ca.SX(missing)
    for joint in robot.joints:
        match joint.kind:
            case JointKind.REVOLUTE | JointKind.PRISMATIC:
                positions[joint.v] = state.q[joint.q]
            case JointKind.CONTINUOUS:
                cosine, sine = ca.vertsplit(state.q[joint.q])
                positions[joint.v] = ca.atan2(sine, cosine)
    return positions, missing

"""The columns that a drive adds to the regressor, as expressions with the parameters they multiply."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from casysid.dynamics import symbolic
from casysid.dynamics.friction import (
    Coupling,
    Direction,
    FrictionColumn,
    SmoothSign,
    coupling_direction,
    joint_directions,
)
from casysid.dynamics.friction_kinds import LoadedCoulomb
from casysid.dynamics.joints import constant
from casysid.errors import ParameterError
from casysid.robot import JointKind, Robot


@dataclass(frozen=True)
class Parameter:
    """What one column of the regressor multiplies.

    Attributes:
        name: ``<owner>.<kind>``.
        owner: A link, a degree of freedom, or a coupling.
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


def drive_columns(
    column_along: ColumnMaker, friction: Sequence[FrictionColumn], couplings: Sequence[Coupling]
) -> Iterator[tuple[Parameter, Any]]:
    """Every friction column with its parameter: kind by kind for the joints, then coupling by coupling."""
    robot, state = column_along.robot, column_along.state
    joints = joint_directions(robot)
    ordinary = [
        column_along(column, direction, column.prior(robot, dof))
        for column in friction
        for dof, direction in joints.items()
    ]
    coupled = [
        column_along(column, coupling_direction(robot, coupling), 0.0)
        for coupling in couplings
        for column in friction
        if coupling.kinds is None or column.kind in coupling.kinds
    ]
    yield from (entry for entry in ordinary if entry is not None)
    moving = ca.vertcat(state.q, state.v, state.a)
    yield from (entry for entry in coupled if entry is not None and ca.depends_on(entry[1], moving))


class ColumnMaker:
    """Makes columns of friction along directions, on one state's symbols.

    Attributes:
        robot: Whose columns.
        state: Its symbols.
        signs: Kind and direction of every smooth sign made so far, with the symbol that stands for its width.
    """

    def __init__(self, robot: Robot, state: symbolic.State) -> None:
        self.robot, self.state = robot, state
        self.signs: list[tuple[str, Direction, Any]] = []
        self._positions, self._missing = _positions(robot, state)
        self._loads: dict[tuple[float, ...] | None, Any] = {}

    def __call__(self, column: FrictionColumn, direction: Direction, prior: float) -> tuple[Parameter, Any] | None:
        """The column's parameter and its torque (nv,); None where it does not act."""
        weights, state = constant(direction.weights), self.state
        if isinstance(column, SmoothSign):
            direction = replace(direction, width=ca.SX.sym("width"))
        if isinstance(column, LoadedCoulomb):
            direction = replace(direction, load=weights.T @ self._load(column))
        s, ds, dds = (weights.T @ x for x in (self._positions, state.v, state.a))
        expression = column.torque(direction, s, ds, dds)
        if expression is None:
            return None
        torque = ca.SX(expression)
        if ca.depends_on(torque, self._missing):
            raise ParameterError(
                f"friction: '{column.kind}' uses the position of '{direction.name}', which has none; return None there"
            )
        if direction.width is not None:
            self.signs.append((column.kind, replace(direction, width=None, load=None), direction.width))
        name, unit = f"{direction.name}.{column.kind}", column.unit(direction)
        parameter = Parameter(name, direction.name, column.kind, unit, column.non_negative, prior)
        return parameter, weights @ torque

    def _load(self, column: LoadedCoulomb) -> Any:
        """Torques (nv,) that hold the column's model still."""
        key = column.inertial_parameters
        if key not in self._loads:
            still = symbolic.State(self.state.q, ca.SX(self.robot.nv, 1), ca.SX(self.robot.nv, 1))
            parameters = constant(column.model(self.robot.inertial_parameters))
            self._loads[key] = symbolic.inverse_dynamics(
                self.robot, symbolic.link_motions(self.robot, still), parameters
            )
        return self._loads[key]


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

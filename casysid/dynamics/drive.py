"""The columns that a drive adds to the regressor, as expressions with the parameters they multiply."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from casysid.arrays import Array
from casysid.dynamics import symbolic
from casysid.dynamics.friction import (
    Coupling,
    Direction,
    DriveState,
    FrictionKind,
    coupling_direction,
    joint_directions,
)
from casysid.dynamics.joints import constant
from casysid.errors import ParameterError
from casysid.robot import JointKind, Robot


@dataclass(frozen=True)
class Parameter:
    """What one column of the regressor multiplies.

    Attributes:
        name: ``<owner>.<kind>``.
        owner: A link, a degree of freedom, or a coupling.
        kind: ``m`` ... ``Izz``, or the name of the friction's term, which is that of its kind if it has only one.
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


@dataclass(frozen=True, eq=False)
class FrictionPart:
    """One kind of friction along one direction, in a regressor.

    Attributes:
        kind: Of friction.
        direction: Where it acts.
        columns: Of its terms.
    """

    kind: FrictionKind
    direction: Direction
    columns: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class SymbolicPart:
    """One kind of friction along one direction, as expressions.

    Attributes:
        kind: Of friction.
        direction: Where it acts.
        parameters: Of its terms.
        torques: Of all joints for parameters of one, expressions of shape (nv, terms).
        numbers: Symbols that stand for the kind's numbers, (n,).
        histories: Symbols that stand for its histories, (m,).
    """

    kind: FrictionKind
    direction: Direction
    parameters: tuple[Parameter, ...]
    torques: Any
    numbers: Any
    histories: Any


def drive_parts(
    part_along: PartMaker, friction: Sequence[FrictionKind], couplings: Sequence[Coupling]
) -> Iterator[SymbolicPart]:
    """All friction with its parameters: kind by kind for the joints, then coupling by coupling."""
    robot = part_along.robot
    joints = joint_directions(robot)
    for kind in friction:
        for dof, direction in joints.items():
            yield from part_along(kind, direction, kind.prior(robot, dof))
    for coupling in couplings:
        direction = coupling_direction(robot, coupling)
        for kind in friction:
            if coupling.kinds is None or kind.kind in coupling.kinds:
                yield from part_along(kind, direction, constant_too=False)


class PartMaker:
    """Makes columns of friction along directions, on one state's symbols.

    Attributes:
        robot: Whose columns.
        state: Its symbols.
    """

    def __init__(self, robot: Robot, state: symbolic.State) -> None:
        self.robot, self.state = robot, state
        self._positions, self._missing = _positions(robot, state)
        self._loads: dict[bytes, Any] = {}

    def __call__(
        self, kind: FrictionKind, direction: Direction, prior: float = 0.0, *, constant_too: bool = True
    ) -> Iterator[SymbolicPart]:
        """The kind's terms along a direction; nothing where it has none.

        Args:
            kind: Of friction.
            direction: Where it acts.
            prior: The model file's value of its parameters.
            constant_too: Whether terms that no motion changes are wanted.

        Raises:
            ParameterError: A term uses the position of a degree of freedom that has none.
        """
        weights, state = constant(direction.weights), self.state
        s, ds, dds = (weights.T @ x for x in (self._positions, state.v, state.a))
        numbers = ca.SX.sym("numbers", len(kind.with_open_numbers().numbers(direction)))
        histories = ca.SX.sym("history", len(kind.histories(direction)))
        load = partial(self._static_torque, kind, weights)
        along = DriveState(
            position=s,
            velocity=ds,
            acceleration=dds,
            numbers=tuple(ca.vertsplit(numbers)),
            histories=tuple(ca.vertsplit(histories)),
            robot=(state.q, state.v, state.a),
            static_torque=load,
        )
        torques, parameters, moving = [], [], ca.vertcat(state.q, state.v, state.a, histories)
        for term in kind.terms(direction, along):
            torque = ca.SX(term.torque)
            if ca.depends_on(torque, self._missing):
                raise ParameterError(
                    f"friction: '{kind.kind}' uses the position of '{direction.name}', which has none; "
                    "it cannot act there"
                )
            if constant_too or ca.depends_on(torque, moving):
                torques.append(weights @ torque)
                name = f"{direction.name}.{term.name}"
                parameters.append(Parameter(name, direction.name, term.name, term.unit, term.non_negative, prior))
        if parameters:
            yield SymbolicPart(kind, direction, tuple(parameters), ca.horzcat(*torques), numbers, histories)

    def _static_torque(self, kind: FrictionKind, weights: Any, parameters: Array | None) -> Any:
        """What gravity asks along a direction of links with some parameters, (10 links,)."""
        own = self.robot.inertial_parameters
        theta = own if parameters is None else parameters
        if theta.shape != own.shape:
            raise ParameterError(
                f"{kind.kind} friction: inertial_parameters must be {own.size} numbers; got {theta.size}"
            )
        key = theta.tobytes()
        if key not in self._loads:
            still = symbolic.State(self.state.q, ca.SX(self.robot.nv, 1), ca.SX(self.robot.nv, 1))
            motions = symbolic.link_motions(self.robot, still)
            self._loads[key] = symbolic.inverse_dynamics(self.robot, motions, constant(theta))
        return weights.T @ self._loads[key]


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


def continued_positions(robot: Robot, q: Array) -> Array:
    """The coordinate of each degree of freedom, shape (N, nv), from configurations (N, nq) in order of time.

    Angles of joints that turn without end go on beyond a turn; where there is no coordinate it is zero.
    """
    positions = np.zeros((len(q), robot.nv))
    for joint in robot.joints:
        match joint.kind:
            case JointKind.REVOLUTE | JointKind.PRISMATIC:
                positions[:, joint.v] = q[:, joint.q]
            case JointKind.CONTINUOUS:
                cosine, sine = q[:, joint.q].T
                positions[:, joint.v.start] = np.unwrap(np.arctan2(sine, cosine))
    return positions

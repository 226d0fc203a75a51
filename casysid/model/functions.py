"""A model's dynamics as CasADi Functions with the identified numbers in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Regressor, symbolic
from casysid.errors import ParameterError
from casysid.robot import JointKind, Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelFunctions:
    """A model's dynamics; every field is a ``casadi.Function`` with named inputs and outputs, columns all.

    ``q`` (nq,) is in Pinocchio's layout, ``v, a, tau`` (nv,). Where friction remembers the way, ``memory`` (m,) is a
    further input, last; :attr:`remember` carries it from one instant to the next.

    Attributes:
        torque: ``(q, v, a[, memory]) -> tau``.
        gravity: ``(q) -> tau``.
        mass_matrix: ``(q) -> M``, (nv, nv); None where the torques held nothing inertial.
        bias: ``(q, v) -> tau``.
        friction: ``(q, v[, memory]) -> tau``.
        forward_dynamics: ``(q, v, tau[, memory]) -> a``; None where there is no mass matrix.
        slid: ``(v) -> memory`` after a long way in the direction of ``v``; None where nothing is remembered.
        remember: ``(memory, q_before, q) -> memory``; None likewise.
    """

    torque: Any
    gravity: Any
    mass_matrix: Any | None
    bias: Any
    friction: Any
    forward_dynamics: Any | None
    slid: Any | None
    remember: Any | None

    @property
    def all(self) -> tuple[Any, ...]:
        """Those that there are."""
        return tuple(one for one in vars(self).values() if one is not None)


def friction_columns(regressor: Regressor) -> npt.NDArray[np.bool_]:
    """Which of the p columns are friction: they take energy out of the motion, or remember it."""
    found = np.zeros(len(regressor.parameters), dtype=bool)
    for part in regressor.parts:
        if part.kind.is_friction or part.kind.histories(part.direction):
            found[list(part.columns)] = True
    return found


def build_functions(regressor: Regressor, parameters: Array) -> ModelFunctions:
    """The functions of a regressor with its parameters, shape (p,)."""
    robot, sensing = regressor.robot, regressor.template.sensing
    state = symbolic.State.of(robot)
    q, v, a, tau = state.q, state.v, state.a, ca.SX.sym("tau", robot.nv)
    memory = [ca.SX.sym("memory", regressor.history_count)] if regressor.history_count else []
    still, nothing = ca.SX(robot.nv, 1), [ca.SX(regressor.history_count, 1)] if memory else []
    is_friction, links = friction_columns(regressor), robot.inertial_parameters.size

    def torque(columns: npt.NDArray[np.bool_], velocity: Any, acceleration: Any, remembered: list[Any]) -> Any:
        theta = ca.SX(ca.DM(np.where(columns, parameters, 0.0)))
        return regressor.torque(q, velocity, acceleration, theta, *remembered)

    every, of_drives = np.ones_like(is_friction), np.arange(len(parameters)) >= links
    bias = torque(~is_friction, v, still, nothing)
    friction = torque(is_friction, v, still, memory)
    functions: dict[str, Any] = {
        "torque": _function("torque", {"q": q, "v": v, "a": a}, memory, "tau", torque(every, v, a, memory)),
        "gravity": _function("gravity", {"q": q}, [], "tau", torque(~is_friction, still, still, nothing)),
        "bias": _function("bias", {"q": q, "v": v}, [], "tau", bias),
        "friction": _function("friction", {"q": q, "v": v}, memory, "tau", friction),
        **dict.fromkeys(("mass_matrix", "forward_dynamics", "slid", "remember")),
    }
    of_rotors = ca.jacobian(torque(of_drives, v, a, memory), a)
    if not (sensing.quasi_static or ca.depends_on(of_rotors, ca.vertcat(v, a, *memory))):
        gains = ca.DM(sensing.gains)
        placements = [motion.placement for motion in symbolic.link_motions(robot, state)]
        bodies = symbolic.mass_matrix(robot, placements, ca.SX(ca.DM(parameters[:links])))
        mass = bodies + ca.diag(1.0 / gains) @ of_rotors
        pushed = (tau - bias - friction) / gains
        functions["mass_matrix"] = _function("mass_matrix", {"q": q}, [], "M", ca.diag(gains) @ mass)
        functions["forward_dynamics"] = _function(
            "forward_dynamics", {"q": q, "v": v, "tau": tau}, memory, "a", ca.ldl_solve(pushed, *ca.ldl(mass))
        )
    if memory:
        before = ca.SX.sym("q_before", robot.nq)
        functions |= _of_memory(regressor, state, memory[0], before)
    return ModelFunctions(**functions)


def _of_memory(regressor: Regressor, state: symbolic.State, memory: Any, before: Any) -> dict[str, Any]:
    """``slid`` and ``remember``."""
    way = _way(regressor.robot, before, state.q)
    every = [
        (history, ca.DM(part.direction.weights))
        for part in regressor.parts
        for history in part.kind.histories(part.direction)
    ]
    slid = ca.vertcat(*(history.slid(weights.T @ state.v) for history, weights in every))
    moved = ca.vertcat(*(history.moved(memory[k], weights.T @ way) for k, (history, weights) in enumerate(every)))
    return {
        "slid": _function("slid", {"v": state.v}, [], "memory", slid),
        "remember": _function("remember", {"memory": memory, "q_before": before, "q": state.q}, [], "next", moved),
    }


def _way(robot: Robot, before: Any, after: Any) -> Any:
    """How far each degree of freedom went between two configurations, (nv,); zero where it has no coordinate."""
    way = ca.SX(robot.nv, 1)
    for joint in robot.joints:
        match joint.kind:
            case JointKind.REVOLUTE | JointKind.PRISMATIC:
                way[joint.v] = after[joint.q] - before[joint.q]
            case JointKind.CONTINUOUS:
                (c0, s0), (c1, s1) = ca.vertsplit(before[joint.q]), ca.vertsplit(after[joint.q])
                way[joint.v] = ca.atan2(s1 * c0 - c1 * s0, c1 * c0 + s1 * s0)
    return way


def _function(name: str, inputs: dict[str, Any], memory: list[Any], output: str, expression: Any) -> Any:
    named = {**inputs, **({"memory": memory[0]} if memory else {})}
    return ca.Function(name, list(named.values()), [ca.densify(expression)], list(named), [output], {"cse": True})


def values(function: Any, bulk: Any, inputs: tuple[npt.ArrayLike, ...]) -> Array:
    """A function at one state, or at many: the inputs are (n,) each, or some of them (N, n).

    Args:
        function: With one output.
        bulk: The same for many states.
        inputs: Those of the function.

    Raises:
        ParameterError: A shape does not fit.
    """
    arrays = [np.asarray(one, dtype=np.float64) for one in inputs]
    rows, columns = function.size_out(0)
    is_matrix = function.name_out(0) == "M"
    shape = (rows, columns) if is_matrix else (rows,)
    if any(array.ndim == 2 for array in arrays):
        out = bulk.evaluate(*arrays)
        return np.asarray(out.reshape(len(out), *shape[::-1]).swapaxes(1, -1)) if is_matrix else out
    for k, array in enumerate(arrays):
        if array.shape != (function.size1_in(k),):
            raise ParameterError(
                f"{function.name()}: wanted {function.name_in(k)} of shape ({function.size1_in(k)},), or (N, "
                f"{function.size1_in(k)}) for many states; got {array.shape}"
            )
    return np.asarray(function(*arrays), dtype=np.float64).reshape(shape)

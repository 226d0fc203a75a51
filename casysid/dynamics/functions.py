"""The robot's dynamics as CasADi Functions: to differentiate, to put into an optimiser, or to write out as C."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca

from casysid.dynamics import symbolic
from casysid.dynamics.joints import constant
from casysid.errors import ParameterError
from casysid.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class Dynamics:
    """Rigid-body dynamics of one robot; every field is a ``casadi.Function`` with named inputs and outputs.

    Columns all: ``q`` (nq,) in Pinocchio's layout, ``v, a, tau`` (nv,), ``theta`` (10 * links,) inertial parameters
    in the order of ``robot.links``, ``armature`` (nv,). Called by keyword, an input that is left out is zero.
    Friction is not part of these: see :class:`~casysid.dynamics.regressor.Regressor`.

    Attributes:
        forward_kinematics: ``(q) -> (rotation, translation)``: pose in the world of every joint's child frame, which
            is its link's frame, side by side in the order of ``robot.joints``; shapes (3, 3 * joints) and (3, joints)
            [m].
        inverse_dynamics: ``(q, v, a, theta, armature) -> tau``.
        forward_dynamics: ``(q, v, tau, theta, armature) -> a``.
        mass_matrix: ``(q, theta, armature) -> M``, (nv, nv).
        bias: ``(q, v, theta) -> tau``: Coriolis, centrifugal and gravity torques.
        coriolis: ``(q, v, theta) -> tau``: Coriolis and centrifugal torques.
        gravity: ``(q, theta) -> tau``: what holds the robot still.
        regressor: ``(q, v, a) -> Y``, sparse, (nv, 10 * links): ``Y theta`` is the torque without armature.
    """

    forward_kinematics: Any
    inverse_dynamics: Any
    forward_dynamics: Any
    mass_matrix: Any
    bias: Any
    coriolis: Any
    gravity: Any
    regressor: Any


def build_dynamics(robot: Robot) -> Dynamics:
    """All of :class:`Dynamics` for a robot (a few tenths of a second for ten joints)."""
    state = symbolic.State.of(robot)
    q, v, a = state.q, state.v, state.a
    theta, armature = ca.SX.sym("theta", 10 * len(robot.links)), ca.SX.sym("armature", robot.nv)
    tau = ca.SX.sym("tau", robot.nv)

    def torque(velocity: Any, acceleration: Any, gravity: Any) -> Any:
        motions = symbolic.link_motions(robot, symbolic.State(q, velocity, acceleration), gravity)
        return symbolic.inverse_dynamics(robot, motions, theta)

    weight, still = constant(robot.gravity), ca.SX(robot.nv, 1)
    poses = symbolic.world_placements(robot, q)
    motions = symbolic.link_motions(robot, state, weight)
    mass = symbolic.mass_matrix(robot, [motion.placement for motion in motions], theta) + ca.diag(armature)
    bias = torque(v, still, weight)
    return Dynamics(
        forward_kinematics=_function(
            "forward_kinematics",
            {"q": q},
            {
                "rotation": ca.horzcat(*(pose.rotation for pose in poses)),
                "translation": ca.horzcat(*(pose.translation for pose in poses)),
            },
        ),
        inverse_dynamics=_function(
            "inverse_dynamics",
            {"q": q, "v": v, "a": a, "theta": theta, "armature": armature},
            {"tau": torque(v, a, weight) + armature * a},
        ),
        forward_dynamics=_function(
            "forward_dynamics",
            {"q": q, "v": v, "tau": tau, "theta": theta, "armature": armature},
            {"a": ca.ldl_solve(tau - bias, *ca.ldl(mass))},
        ),
        mass_matrix=_function("mass_matrix", {"q": q, "theta": theta, "armature": armature}, {"M": mass}),
        bias=_function("bias", {"q": q, "v": v, "theta": theta}, {"tau": bias}),
        coriolis=_function("coriolis", {"q": q, "v": v, "theta": theta}, {"tau": torque(v, still, ca.SX(3, 1))}),
        gravity=_function("gravity", {"q": q, "theta": theta}, {"tau": torque(still, still, weight)}),
        regressor=ca.Function(
            "regressor", [q, v, a], [symbolic.regressor(robot, motions)], ["q", "v", "a"], ["Y"], {"cse": True}
        ),
    )


def generate_c(functions: Iterable[Any], path: str | os.PathLike[str]) -> Path:
    """C source of CasADi Functions under their own names, without dependencies, and its header beside it.

    Args:
        functions: CasADi Functions, such as the fields of :class:`Dynamics`.
        path: The file to write, ending in ``.c``.

    Returns:
        ``path``; it is written whole or not at all.

    Raises:
        ParameterError: When ``path`` does not end in ``.c``, or its name is no C identifier.
    """
    target = Path(path)
    if target.suffix != ".c" or not target.stem.isidentifier():
        raise ParameterError(f"C source: the file must be named <identifier>.c; got {target.name!r}")
    generator = ca.CodeGenerator(target.name, {"with_header": True})
    for function in functions:
        generator.add(function)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=".casysid-") as directory:
        generator.generate(f"{directory}{os.sep}")
        for name in (f"{target.stem}.h", target.name):
            os.replace(Path(directory) / name, target.parent / name)
    return target


def _function(name: str, inputs: dict[str, Any], outputs: dict[str, Any]) -> Any:
    """A dense-output Function of named expressions, common subexpressions shared."""
    dense = [ca.densify(expression) for expression in outputs.values()]
    return ca.Function(name, list(inputs.values()), dense, list(inputs), list(outputs), {"cse": True})

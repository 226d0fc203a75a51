"""The one place that knows what casysid's answer looks like: from an identification to plain numbers and words."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import casysid
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.uncertainty import torque_std

KIND_OF_EFFECT = {
    "asymmetry": ("viscous_asymmetry", "asymmetry", "coulomb_asymmetry"),
    "stribeck": ("stribeck",),
    "load": ("loaded_coulomb", "load"),
    "ripple": ("ripple", "harmonic", "position_ripple", "torque_ripple"),
    "hysteresis": ("hysteresis", "maxwell_slip", "presliding"),
    "wrist": ("coupling",),
}
"""Names under which casysid may report an effect."""
EFFECT_OF_KIND = {kind: effect for effect, kinds in KIND_OF_EFFECT.items() for kind in kinds}


@dataclass(frozen=True, eq=False)
class Answer:
    """What casysid found.

    Attributes:
        torque: Predicted as the log has it, shape (N, nv), of q, v, a in the order of time.
        effects: Friction beyond the ordinary: pairs of effect and dof; a kind that no truth has keeps its own name.
        clock: Stamps times this are seconds.
        delay: Taken out, by joint, shape (nv,), [s].
        gains: Relative gains by joint, shape (nv,), None where none were fitted.
        negated: Dofs whose torque is said to be negated.
        other_mistakes: Further complaints about the log, in words.
        quasi_static: Whether the torques are said to hold no inertia.
        names: Of the parameters, as pairs of owner and kind.
        parameters: Shape (p,).
        covariance: Of what the data see, shape (p, p).
        std: Of each parameter, inf where not told, shape (p,).
        base: Combinations that the data show, shape (r, p).
        torque_std: Standard error of the predicted torque, shape (N, nv), of q, v, a.
        seconds: CPU time.
    """

    torque: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
    effects: tuple[tuple[str, int], ...]
    clock: float
    delay: np.ndarray
    gains: np.ndarray | None
    negated: tuple[int, ...]
    other_mistakes: tuple[str, ...]
    quasi_static: bool
    names: tuple[tuple[str, str], ...]
    parameters: np.ndarray
    covariance: np.ndarray
    std: np.ndarray
    base: np.ndarray
    torque_std: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
    seconds: float


def ask(robot: Robot, recording: Recording, settings: Any = None) -> Answer:
    """Identify with defaults, unless there are settings."""
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = casysid.identify(robot, recording, settings)
    return read_answer(robot, result, time.process_time() - began)


def read_answer(robot: Robot, result: Any, seconds: float = 0.0) -> Answer:
    """The answer in a result."""
    regressor, sure = result.regressor, result.uncertainty
    predict = getattr(result, "predict_torque", None) or (lambda q, v, a: regressor.predict(result.parameters, q, v, a))
    clock = _first(result, "time_base", "clock")
    gains = _first(result, "torque_gains", "gains", "drive_gains")
    negated, others = _mistakes(robot, _first(result, "mistakes") or ())
    structural, excited = result.structural, result.excited
    return Answer(
        torque=predict,
        effects=_effects(robot, _first(result, "friction", "friction_choice")),
        clock=float(getattr(clock, "scale", clock) or 1.0),
        delay=_delay(robot, result),
        gains=np.array(gains.values) if getattr(gains, "found", False) else None,
        negated=negated,
        other_mistakes=others,
        quasi_static=bool(getattr(clock, "quasi_static", _first(result, "quasi_static") or False)),
        names=tuple((parameter.owner, parameter.kind) for parameter in regressor.parameters),
        parameters=np.array(result.parameters),
        covariance=np.array(sure.covariance),
        std=np.array(sure.std),
        base=np.array((excited if excited.rank < structural.rank else structural).transform),
        torque_std=lambda q, v, a: torque_std(regressor, sure.covariance, q, v, a),
        seconds=seconds,
    )


def _first(result: Any, *names: str) -> Any:
    """The first of these attributes that there is, of the result or of its choices; else None."""
    for place in (result, getattr(result, "choices", None)):
        for name in names:
            if getattr(place, name, None) is not None:
                return getattr(place, name)
    return None


def _delay(robot: Robot, result: Any) -> np.ndarray:
    delay = _first(result, "torque_delay", "delay")
    seconds = getattr(delay, "seconds", delay)
    return np.broadcast_to(0.0 if seconds is None else np.asarray(seconds, dtype=np.float64), robot.nv).copy()


def _effects(robot: Robot, friction: Any) -> tuple[tuple[str, int], ...]:
    chosen = getattr(friction, "chosen", friction) or ()
    return tuple(
        (EFFECT_OF_KIND.get(one.kind, one.kind), robot.dofs.index(joint)) for one in chosen for joint in one.joints
    )


def _mistakes(robot: Robot, mistakes: Any) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Dofs whose torque is said to be negated, and all other complaints."""
    negated, others = [], []
    for mistake in mistakes:
        name = getattr(mistake.kind, "name", str(mistake.kind)).lower()
        if name in ("torque_negated", "axis_negated", "position_negated"):
            negated += [robot.dofs.index(joint) for joint in mistake.joints]
        elif name == "all_torques_negated":
            negated += range(robot.nv)
        else:
            others.append(mistake.words)
    return tuple(negated), tuple(others)

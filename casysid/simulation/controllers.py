"""Controllers: what drives a robot along a reference, from whatever parameters they believe in.

A command has three parts: what is planned beforehand from the reference alone, what a model says at the measured
state, and what the tracking error asks for. The last is the paper's *feedback command*: the better the model, the
smaller it is (Ting et al. 2006, Tables I and II).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.robot import Robot
from casysid.simulation.model import ControlModel
from casysid.simulation.reference import Reference
from casysid.simulation.truth import felt_inertia

_UNEVEN = 2.5  # how many times its smallest inertia a joint's gains may be made for


class Command(NamedTuple):
    """Torques at one tick, each (nv,), [N m] or [N].

    Attributes:
        model: What a model says at the measured state.
        feedback: What the tracking error asks for.
    """

    model: Array
    feedback: Array


class Controller(Protocol):
    """Anything that can drive a plant."""

    def plan(self, reference: Reference) -> Array:
        """Torques known before the motion begins, shape (N, nv)."""
        ...

    def react(self, q: Array, v: Array, reference: Reference, k: int) -> Command:
        """What to add at tick ``k``, at the measured configuration (nq,) and velocity (nv,)."""
        ...


@dataclass(frozen=True, eq=False)
class PD:
    """Proportional and derivative feedback of every degree of freedom.

    Attributes:
        robot: Whose configurations are compared.
        stiffness: Shape (nv,) or one number, [N m/rad] or [N/m].
        damping: Shape (nv,) or one number, [N m s/rad] or [N s/m].
    """

    robot: Robot
    stiffness: Array
    damping: Array

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping"):
            values = np.asarray(getattr(self, name), dtype=np.float64)
            if values.shape not in ((), (self.robot.nv,)) or not (np.isfinite(values).all() and (values >= 0.0).all()):
                raise ParameterError(
                    f"PD: {name} must be {self.robot.nv} finite numbers from 0 up, or one; got {values}"
                )
            object.__setattr__(self, name, frozen(np.broadcast_to(values, self.robot.nv)))

    @classmethod
    def tuned(
        cls, robot: Robot, parameters: Array | None = None, *, bandwidth: float = 3.0, damping_ratio: float = 1.0
    ) -> PD:
        """Gains for a bandwidth [Hz] and a damping ratio.

        They fit the largest inertia that a joint feels, unless that is far more than the smallest: a loop closed
        through a filtered velocity would then oscillate in the light poses.

        Args:
            robot: The robot.
            parameters: In the order of :attr:`~casysid.simulation.plant.Plant.parameters`; None takes the file's.
            bandwidth: [Hz].
            damping_ratio: 1 is critical.
        """
        smallest, largest = felt_inertia(robot, parameters)
        inertia, w = np.minimum(largest, _UNEVEN * smallest), 2.0 * np.pi * bandwidth
        return cls(robot, w * w * inertia, 2.0 * damping_ratio * w * inertia)

    def plan(self, reference: Reference) -> Array:
        """Nothing."""
        return np.zeros_like(reference.v)

    def react(self, q: Array, v: Array, reference: Reference, k: int) -> Command:
        """``Kp (q_ref - q) + Kd (v_ref - v)``."""
        return Command(np.zeros_like(v), self.torque(q, v, reference, k))

    def torque(self, q: Array, v: Array, reference: Reference, k: int) -> Array:
        """The feedback alone, shape (nv,)."""
        target, robot = reference.q[k], self.robot
        error = target - q if robot.nq == robot.nv else pin.difference(robot.model, q, target)
        return np.asarray(self.stiffness * error + self.damping * (reference.v[k] - v))


@dataclass(frozen=True, eq=False)
class ComputedTorque:
    """Inverse dynamics of the reference, fed forward, and PD feedback: the control law of Ting et al. (2006), §IV-B.

    Attributes:
        model: Parameters to believe in.
        feedback: Feedback.
    """

    model: ControlModel
    feedback: PD

    def plan(self, reference: Reference) -> Array:
        """Inverse dynamics along the reference, friction included."""
        return self.model.inverse_dynamics(reference.q, reference.v, reference.a)

    def react(self, q: Array, v: Array, reference: Reference, k: int) -> Command:
        """Feedback alone."""
        return self.feedback.react(q, v, reference, k)


@dataclass(frozen=True, eq=False)
class GravityCompensation:
    """The model's gravity at the measured configuration, and PD feedback.

    Attributes:
        model: Parameters to believe in.
        feedback: Feedback; zero gains let the robot float.
    """

    model: ControlModel
    feedback: PD

    def plan(self, reference: Reference) -> Array:
        """Nothing."""
        return np.zeros_like(reference.v)

    def react(self, q: Array, v: Array, reference: Reference, k: int) -> Command:
        """Gravity and feedback."""
        return Command(self.model.gravity(q), self.feedback.torque(q, v, reference, k))

"""Operational-space control of a point on the robot: needs mass matrix and bias apart."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.simulation.controllers import PD, Command
from casysid.simulation.model import ControlModel
from casysid.simulation.reference import Reference

_SINGULAR = 1e-6  # of the largest eigenvalue of J M⁻¹ Jᵀ, added where the point cannot move


@dataclass(frozen=True, eq=False, kw_only=True)
class OperationalSpace:
    """A point follows where the reference would take it; what freedom is left follows the reference's posture.

    ``tau = Jᵀ Λ (ẍ_ref + kp e + kd ė - J̇ v) + h + (1 - Jᵀ J̄ᵀ) M (a_ref + posture feedback)`` with
    ``Λ = (J M⁻¹ Jᵀ)⁻¹`` and the dynamically consistent inverse ``J̄ = M⁻¹ Jᵀ Λ`` (Khatib 1987, compared in Nakanishi et
    al. 2005).

    Attributes:
        model: Parameters to believe in.
        joint: The joint that carries the point's link.
        point: In the joint's frame, shape (3,), [m].
        bandwidth: Of the point's tracking [Hz].
        posture_bandwidth: Of the posture [Hz].

    Raises:
        ParameterError: There is no such joint, or the model's mass matrix is not positive definite.
    """

    model: ControlModel
    joint: str
    point: Array
    bandwidth: float = 3.0
    posture_bandwidth: float = 1.5

    def __post_init__(self) -> None:
        robot = self.model.robot
        object.__setattr__(self, "point", frozen(self.point))
        if self.joint not in [joint.name for joint in robot.joints]:
            raise ParameterError(
                f"operational space: robot '{robot.name}' has no joint '{self.joint}'; its joints are "
                f"{', '.join(joint.name for joint in robot.joints)}"
            )
        if np.linalg.eigvalsh(self.model.mass_matrix(pin.neutral(robot.model)))[0] <= 0.0:
            raise ParameterError(
                f"operational space: by these parameters the mass matrix of robot '{robot.name}' is not positive "
                "definite, and the controller divides by it; project the parameters first"
            )

    def plan(self, reference: Reference) -> Array:
        """The friction of the reference motion."""
        return self.model.friction(reference.q, reference.v)

    def react(self, q: Array, v: Array, reference: Reference, k: int) -> Command:
        """The control law; the part with the errors is the feedback."""
        x, jacobian, dx, drift = self._kinematics(q, v)
        x_ref, jacobian_ref, dx_ref, drift_ref = self._kinematics(reference.q[k], reference.v[k])
        w, w_posture = 2.0 * np.pi * self.bandwidth, 2.0 * np.pi * self.posture_bandwidth
        mass = self.model.mass_matrix(q)
        spread = np.linalg.solve(mass, jacobian.T)  # M⁻¹ Jᵀ, (nv, 3)
        mobility = jacobian @ spread
        mobility += _SINGULAR * np.linalg.eigvalsh(mobility)[-1] * np.eye(3)
        wanted = jacobian_ref @ reference.a[k] + drift_ref - drift
        error = w * w * (x_ref - x) + 2.0 * w * (dx_ref - dx)
        posture = w_posture**2 * self._posture.torque(q, v, reference, k) + 2.0 * w_posture * (reference.v[k] - v)
        pushes = jacobian.T @ np.linalg.solve(mobility, np.column_stack([wanted, error, jacobian @ posture]))
        ahead = mass @ reference.a[k] - jacobian.T @ np.linalg.solve(mobility, jacobian @ reference.a[k])
        feedback = pushes[:, 1] + mass @ posture - pushes[:, 2]
        return Command(pushes[:, 0] + self.model.bias(q, v) + ahead, feedback)

    @cached_property
    def _posture(self) -> PD:
        return PD(self.model.robot, np.ones(self.model.robot.nv), np.zeros(self.model.robot.nv))

    @cached_property
    def _carrier(self) -> int:
        return int(self.model.robot.model.getJointId(self.joint))

    @cached_property
    def _data(self) -> object:
        return self.model.robot.model.createData()

    def _kinematics(self, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Position, Jacobian (3, nv), velocity and ``J̇ v`` of the point, along the world's axes."""
        model, data, carrier = self.model.robot.model, self._data, self._carrier
        pin.forwardKinematics(model, data, q, v, np.zeros_like(v))
        pin.computeJointJacobians(model, data, q)
        pose = data.oMi[carrier]  # type: ignore[attr-defined]
        arm = pose.rotation @ self.point
        full = pin.getJointJacobian(model, data, carrier, pin.LOCAL_WORLD_ALIGNED)
        jacobian = full[:3] - pin.skew(arm) @ full[3:]
        spin = full[3:] @ v
        motion = pin.getClassicalAcceleration(model, data, carrier, pin.LOCAL_WORLD_ALIGNED)
        drift = motion.linear + np.cross(motion.angular, arm) + np.cross(spin, np.cross(spin, arm))
        return pose.translation + arm, jacobian, jacobian @ v, drift

"""Kinematics and dynamics of a tree of rigid bodies as CasADi expressions.

One outward pass gives every link's angular velocity, angular acceleration and acceleration of its frame's origin
(gravity counted as an acceleration of the world), each in the link's own frame. These make the body regressor
``A_k``, 6 × 10: the wrench that moves link k is ``A_k θ_k``. What is left is to bring wrenches to the joints: inward,
link by link, for the torques of given parameters (recursive Newton-Euler), or with the link's Jacobian, ``Y_k = J_kᵀ
A_k``, for the regressor, which stays sparse.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from casysid.dynamics.joints import Placement, constant, joint_placement, motion_subspace, skew
from casysid.robot import Robot


@dataclass(frozen=True, eq=False)
class State:
    """Symbols of one instant: configuration (nq,), velocity (nv,), acceleration (nv,)."""

    q: Any
    v: Any
    a: Any

    @classmethod
    def of(cls, robot: Robot) -> State:
        """Fresh symbols ``q, v, a`` for a robot."""
        return cls(ca.SX.sym("q", robot.nq), ca.SX.sym("v", robot.nv), ca.SX.sym("a", robot.nv))


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """How one joint's child frame moves, in its own coordinates.

    Attributes:
        placement: Pose in the parent joint's frame.
        angular_velocity: [rad/s].
        angular_acceleration: [rad/s²].
        linear_acceleration: Of the frame's origin, less gravity [m/s²].
    """

    placement: Placement
    angular_velocity: Any
    angular_acceleration: Any
    linear_acceleration: Any


def link_motions(robot: Robot, state: State, gravity: Any = None) -> list[LinkMotion]:
    """Motion of every joint's child frame, in the order of ``robot.joints``, under the robot's or another gravity."""
    still = ca.SX(3, 1)
    weight = constant(robot.gravity) if gravity is None else gravity
    world = LinkMotion(Placement(ca.SX.eye(3), still), still, still, -weight)
    motions: list[LinkMotion] = []
    for joint in robot.joints:
        parent = world if joint.parent < 0 else motions[joint.parent]
        placement = joint_placement(joint, state.q)
        linear, angular = (constant(rows) for rows in motion_subspace(joint))
        v, a = state.v[joint.v], state.a[joint.v]
        R, t = placement
        w = R.T @ parent.angular_velocity
        relative = angular @ v
        spin = skew(parent.angular_velocity)
        carried = parent.linear_acceleration + skew(parent.angular_acceleration) @ t + spin @ (spin @ t)
        motions.append(
            LinkMotion(
                placement,
                w + relative,
                R.T @ parent.angular_acceleration + angular @ a + skew(w) @ relative,
                R.T @ carried + linear @ a + skew(2 * w + relative) @ (linear @ v),
            )
        )
    return motions


def body_regressor(motion: LinkMotion) -> Any:
    """``A``, shape (6, 10): force and moment about the frame's origin as a linear function of the inertial parameters.

    Source: Atkeson, An, Hollerbach, "Estimation of inertial parameters of manipulator loads and links" (1986).
    """
    w, dw, a = motion.angular_velocity, motion.angular_acceleration, motion.linear_acceleration
    force = ca.horzcat(a, skew(dw) + skew(w) @ skew(w), ca.SX(3, 6))
    moment = ca.horzcat(ca.SX(3, 1), -skew(a), _inertia_times(dw) + skew(w) @ _inertia_times(w))
    return ca.vertcat(force, moment)


def inverse_dynamics(robot: Robot, motions: list[LinkMotion], parameters: Any) -> Any:
    """Torques (nv,) of the rigid bodies with ``parameters`` (10 * links,): recursive Newton-Euler, without armature."""
    wrenches = [ca.SX(6, 1) for _ in robot.joints]
    for link, i in enumerate(_carriers(robot)):
        wrenches[i] = body_regressor(motions[i]) @ parameters[10 * link : 10 * link + 10]
    torque = ca.SX(robot.nv, 1)
    for i in reversed(range(len(robot.joints))):
        joint, force, moment = robot.joints[i], wrenches[i][:3], wrenches[i][3:]
        linear, angular = (constant(rows) for rows in motion_subspace(joint))
        torque[joint.v] = linear.T @ force + angular.T @ moment
        if joint.parent >= 0:
            R, t = motions[i].placement
            outer = R @ force
            wrenches[joint.parent] += ca.vertcat(outer, R @ moment + skew(t) @ outer)
    return torque


def regressor(robot: Robot, motions: list[LinkMotion]) -> Any:
    """``Y``, sparse, shape (nv, 10 * links): ``Y θ`` are the torques of the rigid bodies, without armature."""
    jacobians = link_jacobians(robot, [motion.placement for motion in motions])
    columns = [jacobians[i].T @ body_regressor(motions[i]) for i in _carriers(robot)]
    return ca.sparsify(ca.horzcat(*columns))


def link_jacobians(robot: Robot, placements: list[Placement]) -> list[Any]:
    """Jacobian of every joint's child frame, in its own coordinates, shape (6, nv), linear before angular."""
    jacobians: list[Any] = []
    for joint, (R, t) in zip(robot.joints, placements, strict=True):
        jacobian = ca.SX(6, robot.nv)
        if joint.parent >= 0:
            linear, angular = jacobians[joint.parent][:3, :], jacobians[joint.parent][3:, :]
            jacobian = ca.sparsify(ca.vertcat(R.T @ (linear - skew(t) @ angular), R.T @ angular))
        jacobian[:, joint.v] = ca.vertcat(*(constant(rows) for rows in motion_subspace(joint)))
        jacobians.append(jacobian)
    return jacobians


def mass_matrix(robot: Robot, placements: list[Placement], parameters: Any) -> Any:
    """Joint-space inertia (nv, nv) of the rigid bodies by composite bodies, without armature.

    Source: Featherstone, "Rigid Body Dynamics Algorithms" (2008), Table 6.2.
    """
    composite = [_Body(ca.SX(1, 1), ca.SX(3, 1), ca.SX(3, 3)) for _ in robot.joints]
    for link, i in enumerate(_carriers(robot)):
        composite[i] = _Body.of(parameters[10 * link : 10 * link + 10])
    mass = ca.SX(robot.nv, robot.nv)
    for i in reversed(range(len(robot.joints))):
        joint, body = robot.joints[i], composite[i]
        linear, angular = (constant(rows) for rows in motion_subspace(joint))
        force = body.mass * linear - skew(body.moment) @ angular
        moment = skew(body.moment) @ linear + body.inertia @ angular
        mass[joint.v, joint.v] = linear.T @ force + angular.T @ moment
        k = i
        while robot.joints[k].parent >= 0:
            R, t = placements[k]
            force = R @ force
            moment = R @ moment + skew(t) @ force
            k = robot.joints[k].parent
            linear, angular = (constant(rows) for rows in motion_subspace(robot.joints[k]))
            block = linear.T @ force + angular.T @ moment
            mass[robot.joints[k].v, joint.v], mass[joint.v, robot.joints[k].v] = block, block.T
        if joint.parent >= 0:
            composite[joint.parent] += body.seen_from(placements[i])
    return ca.sparsify(mass)


def world_placements(robot: Robot, q: Any) -> list[Placement]:
    """Pose in the world of every joint's child frame, which is also its link's frame."""
    poses: list[Placement] = []
    for joint in robot.joints:
        local = joint_placement(joint, q)
        poses.append(local if joint.parent < 0 else poses[joint.parent] @ local)
    return poses


def _carriers(robot: Robot) -> list[int]:
    """Index of the joint that carries each link, in the order of ``robot.links``."""
    return [i for i, joint in enumerate(robot.joints) if joint.link is not None]


def _inertia_times(w: Any) -> Any:
    """The matrix that takes ``Ixx Ixy Iyy Ixz Iyz Izz`` to ``I w``, shape (3, 6)."""
    x, y, z = w[0], w[1], w[2]
    return ca.sparsify(
        ca.vertcat(ca.horzcat(x, y, 0, z, 0, 0), ca.horzcat(0, x, y, 0, z, 0), ca.horzcat(0, 0, 0, x, y, z))
    )


class _Body(NamedTuple):
    """Mass (1,), first moment (3,) and inertia (3, 3) of a body about a frame's origin."""

    mass: Any
    moment: Any
    inertia: Any

    @classmethod
    def of(cls, theta: Any) -> _Body:
        """The body with ten inertial parameters."""
        xx, xy, yy, xz, yz, zz = (theta[i] for i in range(4, 10))
        inertia = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
        return cls(theta[0], theta[1:4], inertia)

    def seen_from(self, placement: Placement) -> _Body:
        """The same body about the frame in which its own is placed."""
        R, t = placement
        turned = R @ self.moment
        moment = turned + self.mass * t
        half = skew(t) @ skew(turned + 0.5 * self.mass * t)
        return _Body(self.mass, moment, R @ self.inertia @ R.T - half - half.T)

    def __add__(self, other: _Body) -> _Body:  # type: ignore[override]
        """Both bodies as one rigid body."""
        return _Body(self.mass + other.mass, self.moment + other.moment, self.inertia + other.inertia)

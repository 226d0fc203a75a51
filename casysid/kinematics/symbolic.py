"""Poses, Jacobians, centre of mass and momentum as CasADi expressions of the configuration.

Every link's Jacobian is known in its own coordinates (:func:`casysid.dynamics.symbolic.link_jacobians`); a frame's is
that of its link, seen from the frame and turned. Momenta are sums over the links' bodies.
"""

from __future__ import annotations

import enum
from typing import Any

import casadi as ca

from casysid.dynamics.joints import Placement, constant, joint_placement, skew
from casysid.dynamics.symbolic import link_jacobians, world_placements
from casysid.kinematics.frames import WORLD, Frame
from casysid.robot import Robot


class Axes(enum.Enum):
    """Along which axes a spatial velocity (linear, angular) is given, and of which point."""

    WORLD = "the frame's origin, along the world's axes"
    FRAME = "the frame's origin, along its own axes"
    SPATIAL = "the point of the body that is at the world's origin, along the world's axes"


def frame_pose(robot: Robot, frame: Frame, q: Any) -> Placement:
    """Pose of a frame in the world."""
    local = Placement(constant(frame.rotation), constant(frame.translation))
    return local if frame.joint == WORLD else world_placements(robot, q)[frame.joint] @ local


def link_poses(robot: Robot, q: Any) -> Any:
    """Rotation and translation of every joint's child frame side by side, shape (3, 4 n)."""
    return ca.horzcat(*(part for pose in world_placements(robot, q) for part in pose))


def frame_jacobian(robot: Robot, frame: Frame, q: Any, axes: Axes) -> Any:
    """``J``, shape (6, nv): the frame's spatial velocity, linear before angular, is ``J v``."""
    if frame.joint == WORLD:
        return ca.SX(6, robot.nv)
    of_link = link_jacobians(robot, [joint_placement(joint, q) for joint in robot.joints])[frame.joint]
    R, t = constant(frame.rotation), constant(frame.translation)
    linear, angular = R.T @ (of_link[:3, :] - skew(t) @ of_link[3:, :]), R.T @ of_link[3:, :]
    if axes is not Axes.FRAME:
        pose = frame_pose(robot, frame, q)
        linear, angular = pose.rotation @ linear, pose.rotation @ angular
        if axes is Axes.SPATIAL:
            linear = linear + skew(pose.translation) @ angular
    return ca.vertcat(linear, angular)


def center_of_mass(robot: Robot, q: Any, parameters: Any) -> Any:
    """Centre of mass of all links in the world, shape (3,)."""
    moment, mass = ca.SX(3, 1), ca.SX(1, 1)
    for (R, t), theta in _bodies(robot, q, parameters):
        moment += t * theta[0] + R @ theta[1:4]
        mass += theta[0]
    return moment / mass


def momentum_matrix(robot: Robot, q: Any, parameters: Any) -> Any:
    """``A``, shape (6, nv): ``A v`` is the linear momentum, and the angular one about the centre of mass.

    Source: Orin, Goswami, Lee, "Centroidal dynamics of a humanoid robot" (2013), Eq. (24).
    """
    center = center_of_mass(robot, q, parameters)
    jacobians = link_jacobians(robot, [joint_placement(joint, q) for joint in robot.joints])
    carriers = [i for i, joint in enumerate(robot.joints) if joint.link is not None]
    total = ca.SX(6, robot.nv)
    for i, ((R, t), theta) in zip(carriers, _bodies(robot, q, parameters), strict=True):
        linear, angular = jacobians[i][:3, :], jacobians[i][3:, :]
        xx, xy, yy, xz, yz, zz = (theta[k] for k in range(4, 10))
        inertia = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
        push = R @ (theta[0] * linear - skew(theta[1:4]) @ angular)
        twist = R @ (skew(theta[1:4]) @ linear + inertia @ angular)
        total += ca.vertcat(push, twist + skew(t - center) @ push)
    return total


def total_mass(robot: Robot, parameters: Any) -> Any:
    """Mass of all links [kg]."""
    return ca.sum(parameters[list(range(0, 10 * len(robot.links), 10))])


def _bodies(robot: Robot, q: Any, parameters: Any) -> list[tuple[Placement, Any]]:
    """Pose and ten parameters of every link."""
    poses = world_placements(robot, q)
    carriers = [i for i, joint in enumerate(robot.joints) if joint.link is not None]
    return [(poses[i], parameters[10 * k : 10 * k + 10]) for k, i in enumerate(carriers)]

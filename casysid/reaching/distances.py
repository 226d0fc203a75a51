"""Distances between capsules and to obstacles as CasADi expressions of the configuration.

Where nearest points change discretely (the end of a segment, the face of a box), the expressions have kinks; elsewhere
their derivatives are exact.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from casysid.dynamics.symbolic import world_placements
from casysid.excitation import Box, Capsule, HalfSpace
from casysid.excitation.constraints.clearance import Clearance
from casysid.kinematics.frames import WORLD
from casysid.robot import Robot

_TINY = 1e-12  # [m²] where segments cross, their distance has no direction
_HALVINGS = 30  # of a segment: to a billionth of its length


def distances(robot: Robot, q: Any, clearance: Clearance) -> Any:
    """All distances of a clearance, shape (m,), each capsule once for a plane."""
    poses = world_placements(robot, q)

    def ends(capsule: Capsule) -> tuple[Any, Any]:
        a, b = ca.SX(capsule.start.tolist()), ca.SX(capsule.end.tolist())
        if capsule.joint == WORLD:
            return a, b
        R, t = poses[capsule.joint]
        return t + R @ a, t + R @ b

    placed = [ends(capsule) for capsule in clearance.capsules]
    radius = [capsule.radius for capsule in clearance.capsules]
    found = [
        _between(*placed[i], *placed[k]) - radius[i] - radius[k] + allowance
        for (i, k), allowance in zip(clearance.pairs, clearance.allowance.tolist(), strict=True)
    ]
    for i, k in clearance.meetings:
        obstacle = clearance.obstacles[k]
        a, b = placed[i]
        to = _to_plane(a, b, obstacle) if isinstance(obstacle, HalfSpace) else _to_box(a, b, obstacle)
        found.append(to - radius[i])
    return ca.vertcat(*found)


def _between(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Of two segments; Ericson, "Real-Time Collision Detection" (2005), section 5.1.9."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv, uw, vw = ca.dot(u, u), ca.dot(v, v), ca.dot(u, v), ca.dot(u, w), ca.dot(v, w)
    determinant = uu * vv - uv * uv
    flat = determinant <= _TINY * ca.fmax(uu * vv, _TINY)
    s = ca.if_else(flat, 0, _clip((uv * vw - uw * vv) / ca.if_else(flat, 1, determinant)))
    t = _clip((uv * s + vw) / ca.fmax(vv, _TINY))
    s = _clip((uv * t - uw) / ca.fmax(uu, _TINY))
    return ca.sqrt(ca.sumsqr(w + s * u - t * v) + _TINY)


def _to_plane(a: Any, b: Any, plane: HalfSpace) -> Any:
    """Of the nearer end."""
    normal = ca.SX(plane.normal.tolist())
    return ca.fmin(ca.dot(normal, a), ca.dot(normal, b)) - plane.offset


def _to_box(a: Any, b: Any, box: Box) -> Any:
    """Of the nearest point of a segment, negative inside the box.

    It is found by halving, as the signed distance is convex along a segment; the halves do not depend on the
    configuration, and by the envelope theorem the distance's derivative is that at a fixed point.
    """
    u, left, right = b - a, ca.SX(0), ca.SX(1)
    x = ca.SX.sym("x", 3)
    signed = ca.Function("signed", [x], [_signed_box(x, box)])
    slope = ca.Function("slope", [x], [ca.gradient(_signed_box(x, box), x)])
    for _ in range(_HALVINGS):
        middle = (left + right) / 2
        falling = ca.dot(slope(a + middle * u), u) < 0
        left, right = ca.if_else(falling, middle, left), ca.if_else(falling, right, middle)
    return signed(a + (left + right) / 2 * u)


def _signed_box(x: Any, box: Box) -> Any:
    center, half = (box.lower + box.upper) / 2.0, (box.upper - box.lower) / 2.0
    beyond = ca.fabs(x - center.tolist()) - half.tolist()
    inside = ca.mmax(beyond)
    return ca.if_else(inside > 0, ca.sqrt(ca.sumsqr(ca.fmax(beyond, 0)) + _TINY), inside)


def _clip(x: Any) -> Any:
    return ca.fmin(ca.fmax(x, 0), 1)

"""Distances between segments, planes and boxes, many at once, with the points where they are reached.

Points are arrays whose first axis is x, y, z: their sums run over long rows.

A capsule is a segment with a radius. Where the closest points are unique, the distance changes along the line between
them only (envelope theorem), so points and direction are all that a derivative needs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from casysid.arrays import Array

_HALVINGS = 45
_TINY = 1e-12


class Closest(NamedTuple):
    """Distance (...), the two points (3, ...), and the unit direction from the second to the first (3, ...)."""

    distance: Array
    first: Array
    second: Array
    direction: Array


def between_segments(a: Array, b: Array, c: Array, d: Array) -> Closest:
    """Segments from a to b and from c to d, each (3, ...).

    Source: Ericson, "Real-Time Collision Detection" (2005), section 5.1.9.
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw = _dot(u, w), _dot(v, w)
    determinant = uu * vv - uv * uv
    flat = determinant <= _TINY * np.maximum(uu * vv, _TINY)
    s = np.where(flat, 0.0, np.clip((uv * vw - uw * vv) / np.where(flat, 1.0, determinant), 0.0, 1.0))
    t = np.where(vv > _TINY, (uv * s + vw) / np.where(vv > _TINY, vv, 1.0), 0.0)
    clipped = np.clip(t, 0.0, 1.0)
    s = np.where((clipped == t) & ~flat, s, np.clip((uv * clipped - uw) / np.where(uu > _TINY, uu, 1.0), 0.0, 1.0))
    first, second = a + s * u, c + clipped * v
    return _apart(first, second)


def to_planes(points: Array, normal: Array, offset: Array) -> Closest:
    """Points (3, ..., m) above planes ``normal · x = offset``, unit normals (3, m); negative below."""
    normal = _like(normal, points)
    distance = _dot(points, normal) - offset
    return Closest(distance, points, points - distance * normal, np.broadcast_to(normal, points.shape))


def to_boxes(a: Array, b: Array, lower: Array, upper: Array) -> Closest:
    """Segments from a to b (3, ..., m) and boxes along the world's axes (3, m); negative inside.

    The signed distance to a convex body is convex along a segment, so halving by its slope finds the least.
    """
    left, right = np.zeros(a.shape[1:]), np.ones(a.shape[1:])
    lower, upper, u = _like(lower, a), _like(upper, a), b - a
    for _ in range(_HALVINGS):
        middle = (left + right) / 2.0
        _, direction = _signed_box(a + middle * u, lower, upper)
        falling = _dot(direction, u) < 0.0
        left, right = np.where(falling, middle, left), np.where(falling, right, middle)
    best = np.where(left == 0.0, 0.0, np.where(right == 1.0, 1.0, (left + right) / 2.0))
    point = a + best * u
    distance, direction = _signed_box(point, lower, upper)
    inner = (best > 0.0) & (best < 1.0)
    direction = np.where(inner, _level_direction(a, u, left, right, lower, upper), direction)
    return Closest(distance, point, point - distance * direction, direction)


def _level_direction(a: Array, u: Array, left: Array, right: Array, lower: Array, upper: Array) -> Array:
    """The gradient at a least value inside a segment: between those on its two sides, and across the segment.

    They differ where the nearest face of a box changes just there.
    """
    before, after = (_signed_box(a + side * u, lower, upper)[1] for side in (left, right))
    fall, rise = np.minimum(_dot(before, u), 0.0), np.maximum(_dot(after, u), 0.0)
    weight = np.where(rise - fall > _TINY, rise / np.where(rise - fall > _TINY, rise - fall, 1.0), 0.5)
    return np.asarray(weight * before + (1.0 - weight) * after)


def _signed_box(point: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Signed distance to a box and its gradient."""
    center, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    side = np.where(point >= center, 1.0, -1.0)
    beyond = np.abs(point - center) - half
    outside = np.maximum(beyond, 0.0)
    length = np.sqrt(_dot(outside, outside))
    inner = np.max(beyond, axis=0)
    nearest = (beyond == inner).astype(np.float64)
    nearest /= nearest.sum(axis=0)
    is_out = length > _TINY
    gradient = np.where(is_out, outside / np.where(is_out, length, 1.0), nearest) * side
    return np.where(is_out, length, inner), gradient


def _apart(first: Array, second: Array) -> Closest:
    gap = first - second
    distance = np.sqrt(_dot(gap, gap))
    return Closest(distance, first, second, gap / np.maximum(distance, _TINY))


def _dot(x: Array, y: Array) -> Array:
    return np.asarray(x[0] * y[0] + x[1] * y[1] + x[2] * y[2])


def _like(values: Array, points: Array) -> Array:
    """Of shape (3, m), with axes for what points (3, ..., m) have in between."""
    return values.reshape(3, *(1,) * (points.ndim - 2), -1)

"""What frames are to reach: a pose, a position, a rotation, or to look at a point."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from casysid.arrays import Array, frozen
from casysid.dynamics.joints import Placement, skew
from casysid.errors import ParameterError
from casysid.kinematics import Frame, Pose

_TINY = 1e-16  # of a squared sine: below it, sines are rounding


class Residual(NamedTuple):
    """How far a frame is from its target, as expressions.

    Attributes:
        error: What is left to go, the linear [m] and the angular part [rad], each (3,), or None.
        jacobian: How fast they shrink with the joints' velocities, each (3, nv): the gradient of ``½ |error|²`` is
            ``-jacobianᵀ error``, exactly.
        smooth: Squares of their lengths to second order, twice differentiable everywhere.
    """

    error: tuple[Any, Any]
    jacobian: tuple[Any, Any]
    smooth: tuple[Any, Any]

    def weighted(self, weights: Any) -> tuple[Any, Any]:
        """Error and Jacobian of both parts below each other, times their weights (2,)."""
        there = [k for k in range(2) if self.error[k] is not None]
        return tuple(ca.vertcat(*(weights[k] * part[k] for k in there)) for part in (self.error, self.jacobian))

    @property
    def lengths(self) -> Any:
        """Linear and angular length of the error, shape (2,); zero for what is None."""
        return ca.vertcat(*(0 if part is None else ca.norm_2(part) for part in self.error))


@dataclass(frozen=True, eq=False, kw_only=True)
class Target(ABC):
    """What one frame is to reach.

    Attributes:
        frame: Its name, or a frame of one's own.
        weight: Where not everything can be reached: what an error counts beside those of other targets.
        radius: Likewise: the metres that an error of one radian counts as.
    """

    frame: str | Frame
    weight: float = 1.0
    radius: float = 1.0

    def __post_init__(self) -> None:
        for name in ("weight", "radius"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ParameterError(f"target of {self.label}: wanted a positive {name}; got {getattr(self, name)}")

    @property
    def label(self) -> str:
        """The frame's name in quotes."""
        return f"'{self.frame if isinstance(self.frame, str) else self.frame.name}'"

    @property
    @abstractmethod
    def form(self) -> tuple[object, ...]:
        """What two targets share if the same expressions serve both with other numbers."""

    @property
    @abstractmethod
    def numbers(self) -> Array:
        """The target's own, as the residual's expressions take them."""

    @property
    @abstractmethod
    def words(self) -> str:
        """What is wanted, in words."""

    @abstractmethod
    def residual(self, pose: Placement, jacobian: Any, numbers: Any) -> Residual:
        """The error's expressions for the frame's pose and its Jacobian (6, nv) along the world's axes."""

    @abstractmethod
    def lengths(self, poses: Pose) -> tuple[Array, Array]:
        """Lengths of the error at poses (..., ): linear [m] and angular [rad]; zeros where it has no such part."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseTarget(Target):
    """A position, a rotation, or both.

    Attributes:
        position: Of the frame's origin in the world, shape (3,), [m]; None for any.
        rotation: Takes the frame's coordinates to the world's, shape (3, 3); None for any.
    """

    position: Array | None = None
    rotation: Array | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.position is None and self.rotation is None:
            raise ParameterError(f"target of {self.label}: wanted a position, a rotation, or both; got neither")
        if self.position is not None:
            object.__setattr__(self, "position", _point(self.label, "position", self.position))
        if self.rotation is not None:
            R = frozen(self.rotation)
            good = R.shape == (3, 3) and np.isfinite(R).all() and np.allclose(R.T @ R, np.eye(3), rtol=0.0, atol=1e-6)
            if not good or np.linalg.det(R) < 0.0:
                raise ParameterError(f"target of {self.label}: the rotation is no rotation matrix: {R.tolist()}")
            object.__setattr__(self, "rotation", R)

    @property
    def form(self) -> tuple[object, ...]:
        """Which parts there are."""
        return ("pose", self.frame, self.position is None, self.rotation is None)

    @property
    def numbers(self) -> Array:
        """Position, then the rotation's columns."""
        parts = [] if self.position is None else [self.position]
        return np.concatenate([*parts, *([] if self.rotation is None else [self.rotation.ravel("F")])])

    @property
    def words(self) -> str:
        """Position and rotation."""
        at = "" if self.position is None else f" at ({', '.join(f'{x:.6g}' for x in self.position)}) m"
        return f"{self.label}{at}{'' if self.rotation is None else ' in the given rotation'}"

    def residual(self, pose: Placement, jacobian: Any, numbers: Any) -> Residual:
        """Target less position; the rotation vector that is left, along the world's axes."""
        gap = turn = None
        squares: list[Any] = [0, 0]
        if self.position is not None:
            gap = numbers[:3] - pose.translation
            squares[0] = ca.sumsqr(gap)
        if self.rotation is not None:
            wanted = ca.reshape(numbers[-9:], 3, 3)
            turn = _rotation_vector(wanted @ pose.rotation.T)
            squares[1] = ca.sumsqr(wanted - pose.rotation) / 2
        return Residual((gap, turn), (jacobian[:3, :], jacobian[3:, :]), (squares[0], squares[1]))

    def lengths(self, poses: Pose) -> tuple[Array, Array]:
        """Distance, and the angle between the rotations."""
        linear, angular = np.zeros(poses.translation.shape[:-1]), np.zeros(poses.translation.shape[:-1])
        if self.position is not None:
            linear = np.linalg.norm(poses.translation - self.position, axis=-1)
        if self.rotation is not None:
            chord = np.linalg.norm(poses.rotation - self.rotation, axis=(-2, -1)) / np.sqrt(8.0)  # sin(angle / 2)
            angular = 2.0 * np.arcsin(np.minimum(chord, 1.0))
        return linear, angular


@dataclass(frozen=True, eq=False, kw_only=True)
class LookAt(Target):
    """An axis of the frame points at a point, wherever the frame is.

    Attributes:
        point: In the world, shape (3,), [m].
        axis: In the frame, shape (3,): (0, 0, 1) for optical frames of URDF, (0, 0, -1) for cameras of MJCF.
    """

    point: Array
    axis: Array

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "point", _point(self.label, "point", self.point))
        axis = _point(self.label, "axis", self.axis)
        if not np.linalg.norm(axis) > 0.0:
            raise ParameterError(f"target of {self.label}: the axis that looks must not be zero")
        object.__setattr__(self, "axis", frozen(axis / np.linalg.norm(axis)))

    @property
    def form(self) -> tuple[object, ...]:
        """Looking."""
        return ("look", self.frame)

    @property
    def numbers(self) -> Array:
        """Point, then axis."""
        return np.concatenate([self.point, self.axis])

    @property
    def words(self) -> str:
        """The point."""
        return f"{self.label} looking at ({', '.join(f'{x:.6g}' for x in self.point)}) m"

    def residual(self, pose: Placement, jacobian: Any, numbers: Any) -> Residual:
        """The rotation vector from where the axis points to where the point is; it turns as the frame moves, too."""
        sight, gap = pose.rotation @ numbers[3:], numbers[:3] - pose.translation
        distance = ca.sqrt(ca.sumsqr(gap) + _TINY)
        wanted = gap / distance
        cross, cosine = ca.cross(sight, wanted), ca.dot(sight, wanted)
        sine = ca.sqrt(ca.sumsqr(cross) + _TINY**2)
        angle = ca.atan2(sine, cosine)
        opposite = ca.logic_and(sine**2 < _TINY, cosine < 0)  # any axis across leads back
        error = ca.if_else(opposite, ca.pi * _across(sight), cross * angle / sine)
        turning = jacobian[3:, :] - sight @ (sight.T @ jacobian[3:, :])
        rows = turning + skew(wanted) @ jacobian[:3, :] / distance
        return Residual((None, error), (None, rows), (0, ca.sumsqr(sight - wanted)))

    def lengths(self, poses: Pose) -> tuple[Array, Array]:
        """No distance; the angle between sight and point."""
        gap = self.point - poses.translation
        sight = poses.rotation @ self.axis
        cross = np.linalg.norm(np.cross(sight, gap), axis=-1)
        return np.zeros(cross.shape), np.arctan2(cross, np.einsum("...i,...i->...", sight, gap))


def _point(label: str, word: str, values: Any) -> Array:
    point = frozen(values)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise ParameterError(f"target of {label}: wanted three finite numbers as its {word}; got {point.tolist()}")
    return point


def _rotation_vector(R: Any) -> Any:
    """The shortest rotation vector of a rotation matrix; one of the two of a half turn."""
    sines = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / 2
    square = ca.sumsqr(sines)
    cosine = (ca.trace(R) - 1) / 2
    sine = ca.sqrt(square + _TINY**2)
    angle = ca.atan2(sine, cosine)
    outer = R + ca.SX.eye(3)  # at a half turn, twice the axis times itself
    x, y, z = outer[0, 0], outer[1, 1], outer[2, 2]
    column = ca.if_else(ca.logic_and(x >= y, x >= z), outer[:, 0], ca.if_else(y >= z, outer[:, 1], outer[:, 2]))
    half_turn = ca.logic_and(square < _TINY, cosine < 0)
    return ca.if_else(half_turn, angle * column / ca.sqrt(ca.sumsqr(column) + _TINY), sines * angle / sine)


def _across(direction: Any) -> Any:
    """A unit vector across a unit vector."""
    x, y, z = direction[0], direction[1], direction[2]
    side = ca.if_else(ca.fabs(x) < 0.6, ca.vertcat(0, z, -y), ca.vertcat(-z, 0, x))  # 0.6 > 1/√3: never too short
    return side / ca.sqrt(ca.sumsqr(side))

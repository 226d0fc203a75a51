"""Forward kinematics of a robot: CasADi Functions to differentiate or put into a program, NumPy over many samples."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Bulk
from casysid.errors import ParameterError
from casysid.kinematics import symbolic
from casysid.kinematics.checks import checked_parameters, checked_states
from casysid.kinematics.frames import Frame, find_frame, frames_of
from casysid.kinematics.rotations import quaternion_from_rotation, rpy_from_rotation
from casysid.kinematics.symbolic import Axes
from casysid.robot import Robot
from casysid.threads import single_threaded

_INPUTS = {
    "pose": ("q",),
    "link_poses": ("q",),
    "jacobian": ("q",),
    "velocity": ("q", "v"),
    "center_of_mass": ("q", "theta"),
    "center_of_mass_jacobian": ("q", "theta"),
    "momentum_matrix": ("q", "theta"),
    "momentum": ("q", "v", "theta"),
}


class Pose(NamedTuple):
    """Where a frame is, at one configuration or at many."""

    rotation: Array
    """Takes its coordinates to the world's, shape (..., 3, 3)."""
    translation: Array
    """Its origin in the world, shape (..., 3), [m]."""

    @property
    def quaternion(self) -> Array:
        """Unit quaternion (x, y, z, w) with w ≥ 0, shape (..., 4)."""
        return quaternion_from_rotation(self.rotation)

    @property
    def rpy(self) -> Array:
        """Roll, pitch and yaw as URDF has them, shape (..., 3), [rad]."""
        return rpy_from_rotation(self.rotation)


class Kinematics:
    """Forward kinematics of one robot.

    Frames are given by name, or as a :class:`Frame` of one's own. Configurations are Pinocchio's: one, of shape (nq,),
    or N of them, (N, nq), and what comes back has the N in front likewise; velocities (nv,) or (N, nv). Spatial
    velocities are linear before angular. Where inertial parameters matter they are the robot's, unless others are
    given, and only what moves is counted.

    Everything raises :class:`~casysid.errors.ParameterError` where there is no such frame, a shape does not fit, a
    number is not finite, a quaternion is not of unit length, or links whose mass matters have none together.

    Attributes:
        robot: Whose kinematics these are.
    """

    def __init__(self, robot: Robot) -> None:
        """Expressions are made when they are first asked for, and kept."""
        self.robot = robot
        self._q, self._v = ca.SX.sym("q", robot.nq), ca.SX.sym("v", robot.nv)
        self._theta = ca.SX.sym("theta", 10 * len(robot.links))
        self._symbols = {"q": self._q, "v": self._v, "theta": self._theta}
        self._functions: dict[Hashable, Any] = {}
        self._bulks: dict[int, Bulk] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return Kinematics, (self.robot,)

    @cached_property
    def frames(self) -> dict[str, Frame]:
        """All frames with a name, by it."""
        return {frame.name: frame for frame in frames_of(self.robot)}

    def frame(self, frame: str | Frame) -> Frame:
        """The frame of that name, or the very frame."""
        if isinstance(frame, str):
            return self.frames[frame] if frame in self.frames else find_frame(self.robot, frame)
        if not -1 <= frame.joint < len(self.robot.joints):
            raise ParameterError(
                f"frame '{frame.name}': moves with joint {frame.joint}; robot '{self.robot.name}' has joints -1 (the "
                f"world) to {len(self.robot.joints) - 1}"
            )
        return frame

    def pose_function(self, frame: str | Frame) -> Any:
        """``casadi.Function`` ``(q) -> (rotation, translation)``, shapes (3, 3) and (3,)."""
        chosen = self.frame(frame)
        return self._kept("pose", chosen, make=lambda: symbolic.frame_pose(self.robot, chosen, self._q)._asdict())

    def link_poses_function(self) -> Any:
        """``casadi.Function`` ``(q) -> poses``, shape (3, 4 n): rotation and translation of every child frame."""
        return self._kept("link_poses", make=lambda: {"poses": symbolic.link_poses(self.robot, self._q)})

    def jacobian_function(self, frame: str | Frame, axes: Axes = Axes.WORLD) -> Any:
        """``casadi.Function`` ``(q) -> J``, shape (6, nv)."""
        return self._kept("jacobian", self.frame(frame), axes, make=lambda: {"J": self._jacobian(frame, axes)})

    def velocity_function(self, frame: str | Frame, axes: Axes = Axes.WORLD) -> Any:
        """``casadi.Function`` ``(q, v) -> velocity``, shape (6,)."""
        return self._kept(
            "velocity", self.frame(frame), axes, make=lambda: {"velocity": self._jacobian(frame, axes) @ self._v}
        )

    def center_of_mass_function(self) -> Any:
        """``casadi.Function`` ``(q, theta) -> c``: centre of mass of the links, shape (3,); theta (10 links,)."""
        return self._kept(
            "center_of_mass", make=lambda: {"c": symbolic.center_of_mass(self.robot, self._q, self._theta)}
        )

    def center_of_mass_jacobian_function(self) -> Any:
        """``casadi.Function`` ``(q, theta) -> J``, shape (3, nv)."""
        return self._kept(
            "center_of_mass_jacobian",
            make=lambda: {"J": self._momentum[:3, :] / symbolic.total_mass(self.robot, self._theta)},
        )

    def momentum_matrix_function(self) -> Any:
        """``casadi.Function`` ``(q, theta) -> A``, shape (6, nv): ``A v`` is the centroidal momentum."""
        return self._kept("momentum_matrix", make=lambda: {"A": self._momentum})

    def momentum_function(self) -> Any:
        """``casadi.Function`` ``(q, v, theta) -> h``: linear momentum, angular momentum about the centre of mass."""
        return self._kept("momentum", make=lambda: {"h": self._momentum @ self._v})

    def poses(self, frame: str | Frame, q: npt.ArrayLike) -> Pose:
        """Where a frame is."""
        values = self._values(self.pose_function(frame), q)
        columns = values[..., :9].reshape(*values.shape[:-1], 3, 3)
        return Pose(np.swapaxes(columns, -1, -2), values[..., 9:])

    def link_poses(self, q: npt.ArrayLike) -> Pose:
        """Where every joint's child frame is, its link's: rotations (..., n, 3, 3), translations (..., n, 3)."""
        values = self._values(self.link_poses_function(), q)
        values = values.reshape(*values.shape[:-1], -1, 4, 3)
        return Pose(np.swapaxes(values[..., :3, :], -1, -2), values[..., 3, :])

    def jacobians(self, frame: str | Frame, q: npt.ArrayLike, axes: Axes = Axes.WORLD) -> Array:
        """What takes joint velocities to the frame's spatial velocity, shape (..., 6, nv)."""
        return self._matrices(self._values(self.jacobian_function(frame, axes), q))

    def velocities(self, frame: str | Frame, q: npt.ArrayLike, v: npt.ArrayLike, axes: Axes = Axes.WORLD) -> Array:
        """Spatial velocity of a frame, shape (..., 6), [m/s, rad/s]."""
        return self._values(self.velocity_function(frame, axes), q, v)

    def centers_of_mass(self, q: npt.ArrayLike, parameters: npt.ArrayLike | None = None) -> Array:
        """Centre of mass of the links, shape (..., 3), [m]."""
        return self._values(self.center_of_mass_function(), q, parameters=self._masses(parameters))

    def center_of_mass_jacobians(self, q: npt.ArrayLike, parameters: npt.ArrayLike | None = None) -> Array:
        """What takes joint velocities to the centre of mass's velocity, shape (..., 3, nv)."""
        function = self.center_of_mass_jacobian_function()
        return self._matrices(self._values(function, q, parameters=self._masses(parameters)))

    def momentum_matrices(self, q: npt.ArrayLike, parameters: npt.ArrayLike | None = None) -> Array:
        """What takes joint velocities to momenta, shape (..., 6, nv)."""
        return self._matrices(self._values(self.momentum_matrix_function(), q, parameters=self._masses(parameters)))

    def momenta(self, q: npt.ArrayLike, v: npt.ArrayLike, parameters: npt.ArrayLike | None = None) -> Array:
        """Linear momentum, and angular momentum about the centre of mass, shape (..., 6), [kg m/s, kg m²/s]."""
        return self._values(self.momentum_function(), q, v, parameters=self._masses(parameters))

    @cached_property
    def _momentum(self) -> Any:
        return symbolic.momentum_matrix(self.robot, self._q, self._theta)

    def _jacobian(self, frame: str | Frame, axes: Axes) -> Any:
        return symbolic.frame_jacobian(self.robot, self.frame(frame), self._q, axes)

    def _masses(self, parameters: npt.ArrayLike | None) -> Array:
        return checked_parameters(self.robot, self.robot.inertial_parameters if parameters is None else parameters)

    def _kept(self, name: str, *key: Hashable, make: Callable[[], dict[str, Any]]) -> Any:
        """The Function of that name and key, made when it is first asked for."""
        if (name, *key) not in self._functions:
            outputs = {word: ca.densify(expression) for word, expression in make().items()}
            inputs = {word: symbols for word, symbols in self._symbols.items() if word in _INPUTS[name]}
            self._functions[name, *key] = ca.Function(
                name, list(inputs.values()), list(outputs.values()), list(inputs), list(outputs), {"cse": True}
            )
        return self._functions[name, *key]

    @single_threaded()
    def _values(self, function: Any, *states: npt.ArrayLike, parameters: Array | None = None) -> Array:
        """All outputs one after the other, shape (..., numbers)."""
        rows, single = checked_states(self.robot, *states)
        given = [*rows, *([] if parameters is None else [parameters])]
        if single:
            return np.concatenate([part.full().ravel("F") for part in function.call([x.ravel() for x in given])])
        key = id(function)  # these live as long as this
        if key not in self._bulks:
            self._bulks[key] = Bulk(_in_one_column(function))
        return self._bulks[key].evaluate(*given)

    def _matrices(self, values: Array) -> Array:
        """Matrices (..., rows, nv) from their columns one after the other."""
        return np.swapaxes(values.reshape(*values.shape[:-1], self.robot.nv, -1), -1, -2)


def _in_one_column(function: Any) -> Any:
    """The same with all outputs one after the other as one."""
    inputs = function.sx_in()
    column = ca.vertcat(*(ca.vec(output) for output in function.call(inputs)))
    return ca.Function(function.name(), inputs, [column], {"cse": True})

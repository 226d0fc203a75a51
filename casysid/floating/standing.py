"""Motion of a robot that stands on its feet: the base moves, the feet do not, and the legs' joints follow.

``J_f v = 0`` of the feet gives the legs' velocities from the base's, its derivative the accelerations, and Newton's
method the positions. What the feet press is then free but for its sum: the smallest forces are taken, the joints'
torques follow (Mistry, Buchli, Schaal, "Inverse dynamics control of floating base systems using orthogonal
decomposition", 2010).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError, SolverError
from casysid.kinematics import Axes, Kinematics
from casysid.robot import JointKind, Robot
from casysid.threads import single_threaded

MOST_STEPS, PLANTED = 30, 1e-12
"""Of Newton's method at every sample, and how far a foot may be from its place [m]: rounding."""


@dataclass(frozen=True, eq=False)
class StandingMotion:
    """A motion on planted feet.

    Attributes:
        time: Shape (N,), [s].
        q: Shape (N, nq).
        v: Shape (N, nv).
        a: Shape (N, nv).
    """

    time: Array
    q: Array
    v: Array
    a: Array

    def __post_init__(self) -> None:
        for name in ("time", "q", "v", "a"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@single_threaded()
def standing_motion(
    robot: Robot,
    feet: Sequence[str],
    stance: npt.ArrayLike,
    time: npt.ArrayLike,
    *,
    shift: float = 0.04,
    turn: float = 0.15,
    band: tuple[float, float] = (0.2, 1.2),
    components: int = 4,
    seed: int = 0,
) -> StandingMotion:
    """Random sinusoids of the base's six coordinates, the feet where they are in the stance.

    Args:
        robot: With a free base and no more joints than the feet's points hold.
        feet: Frames that stay where they are, as points.
        stance: Configuration in the middle of the motion, shape (nq,).
        time: Shape (N,), [s].
        shift: Largest sum of amplitudes of the base's place [m].
        turn: The same of its orientation, a rotation vector [rad].
        band: Lowest and highest frequency [Hz].
        components: Sinusoids of each coordinate.
        seed: Of the draw.

    Raises:
        ParameterError: The base is not free, or the feet do not hold the joints.
        SolverError: The feet cannot stay where they are.
    """
    if robot.joints[0].kind is not JointKind.FREE_FLYER:
        raise ParameterError(f"standing: the base of robot '{robot.name}' is not free")
    t, rng, kinematics = np.asarray(time, dtype=np.float64), np.random.default_rng(seed), Kinematics(robot)
    x, x1, x2 = _sinusoids(t, np.repeat([shift, turn], 3), band, components, rng)
    q0 = np.asarray(stance, dtype=np.float64)
    wanted = {foot: kinematics.poses(foot, q0).translation for foot in feet}
    q, v, a = np.empty((len(t), robot.nq)), np.empty((len(t), robot.nv)), np.empty((len(t), robot.nv))
    legs = q0[7:]
    R0, data = pin.Quaternion(q0[3:7]).matrix(), robot.model.createData()
    frames = [robot.model.getFrameId(foot) for foot in feet]
    for k in range(len(t)):
        place, R = q0[:3] + x[k, :3], R0 @ pin.exp3(x[k, 3:])
        legs = _planted(robot, data, frames, wanted.values(), place, R, legs)
        q[k] = np.concatenate([place, pin.Quaternion(R).normalized().coeffs(), legs])
        turning = pin.Jexp3(x[k, 3:])
        w = turning @ x1[k, 3:]
        v[k, :6] = np.concatenate([R.T @ x1[k, :3], w])
        dw = turning @ x2[k, 3:] + _rate_of_turning(x[k, 3:], x1[k, 3:]) @ x1[k, 3:]
        a[k, :6] = np.concatenate([R.T @ x2[k, :3] - np.cross(w, v[k, :3]), dw])
    J = np.concatenate([kinematics.jacobians(foot, q, Axes.WORLD)[:, :3] for foot in feet], axis=1)
    if np.linalg.matrix_rank(J[0][:, 6:]) < robot.nv - 6:
        raise ParameterError(f"standing: the feet {', '.join(feet)} do not hold all joints of robot '{robot.name}'")
    held = np.linalg.pinv(J[:, :, 6:])
    v[:, 6:] = -np.einsum("nij,nj->ni", held, np.einsum("nij,nj->ni", J[:, :, :6], v[:, :6]))
    for k in range(len(t)):
        a[k, 6:] = 0.0
        pin.forwardKinematics(robot.model, data, q[k], v[k], a[k])
        pin.updateFramePlacements(robot.model, data)
        drift = [
            pin.getFrameClassicalAcceleration(robot.model, data, f, pin.LOCAL_WORLD_ALIGNED).linear for f in frames
        ]
        a[k, 6:] = -held[k] @ np.concatenate(drift)
    return StandingMotion(t, q, v, a)


def standing_forces(
    kinematics: Kinematics, feet: Sequence[str], q: Array, needed: Array
) -> tuple[Array, dict[str, Array]]:
    """Torques of the joints, shape (N, nv), and forces at the feet along their own axes, shape (N, 3) each.

    Args:
        kinematics: Of the robot.
        feet: That press on the world; three or more, not in a line.
        q: Shape (N, nq).
        needed: Generalised forces of the motion, ``Y θ``, shape (N, nv).
    """
    J = np.concatenate([kinematics.jacobians(foot, q, Axes.FRAME)[:, :3] for foot in feet], axis=1)
    w = np.einsum("nij,nj->ni", np.linalg.pinv(np.swapaxes(J[:, :, :6], 1, 2)), needed[:, :6])
    torque = needed - np.einsum("nij,ni->nj", J, w)
    torque[:, :6] = 0.0
    return torque, {foot: w[:, 3 * k : 3 * k + 3] for k, foot in enumerate(feet)}


def _sinusoids(
    t: Array, size: Array, band: tuple[float, float], components: int, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Values and two derivatives, shape (N, 6)."""
    shape = (len(size), components)
    w = 2.0 * np.pi * rng.uniform(*band, shape)
    amplitude = size[:, None] * rng.dirichlet(np.full(components, 2.0), len(size))
    angle = t[:, None, None] * w + rng.uniform(0.0, 2.0 * np.pi, shape)
    sine, cosine = amplitude * np.sin(angle), amplitude * np.cos(angle)
    return sine.sum(axis=2), (w * cosine).sum(axis=2), -(w * w * sine).sum(axis=2)


def _planted(
    robot: Robot, data: pin.Data, frames: Sequence[int], wanted: object, place: Array, R: Array, legs: Array
) -> Array:
    """Joint positions with which the feet are where they are wanted, by Newton's method from those before."""
    base, targets = np.concatenate([place, pin.Quaternion(R).normalized().coeffs()]), np.concatenate(list(wanted))  # type: ignore[call-overload]
    for _ in range(MOST_STEPS):
        q = np.concatenate([base, legs])
        pin.computeJointJacobians(robot.model, data, q)
        pin.updateFramePlacements(robot.model, data)
        error = targets - np.concatenate([data.oMf[frame].translation for frame in frames])
        if np.abs(error).max() < PLANTED:
            return legs
        J = [pin.getFrameJacobian(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3, 6:] for frame in frames]
        legs = legs + np.linalg.lstsq(np.concatenate(J), error, rcond=None)[0]
    raise SolverError(
        f"standing: the feet of robot '{robot.name}' cannot stay where they are: {np.abs(error).max():.3g} m off; make "
        "the motion of the base smaller"
    )


def _rate_of_turning(x: Array, x1: Array) -> Array:
    """Derivative in time of ``Jexp3`` along ``x + x1 t``, by central differences of a step of its rounding."""
    h = 1e-5
    return np.asarray((pin.Jexp3(x + h * x1) - pin.Jexp3(x - h * x1)) / (2.0 * h))

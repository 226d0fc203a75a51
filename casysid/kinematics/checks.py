"""What configurations, velocities and parameters must be, asked before anything is computed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.robot import Joint, JointKind, Robot

UNIT = 1e-5
"""How far a quaternion or (cos, sin) may be from unit length: what logs written with six digits are off by."""
_UNIT_PARTS = {
    JointKind.CONTINUOUS: slice(0, 2),
    JointKind.PLANAR: slice(2, 4),
    JointKind.SPHERICAL: slice(0, 4),
    JointKind.FREE_FLYER: slice(3, 7),
}


def checked_states(robot: Robot, q: npt.ArrayLike, v: npt.ArrayLike | None = None) -> tuple[list[Array], bool]:
    """Configurations (N, nq), and velocities (N, nv) if given; whether one sample without axis was given.

    Raises:
        ParameterError: A shape does not fit, a number is not finite, or a rotation is not of unit length.
    """
    arrays = [_rows("q", q, robot.nq, robot)]
    if v is not None:
        arrays.append(_rows("v", v, robot.nv, robot))
    if len({array.shape[:-1] for array in arrays}) > 1:
        raise ParameterError(
            f"q and v: wanted as many of one as of the other; got {arrays[0].shape} and {arrays[1].shape}"
        )
    single = arrays[0].ndim == 1
    rows = [np.atleast_2d(array) for array in arrays]
    for joint in robot.joints:
        if joint.kind in _UNIT_PARTS:
            _check_unit(joint, rows[0][:, joint.q][:, _UNIT_PARTS[joint.kind]])
    return rows, single


def checked_parameters(robot: Robot, parameters: npt.ArrayLike) -> Array:
    """Inertial parameters (10 links,).

    Raises:
        ParameterError: The shape does not fit, a number is not finite, or the total mass is not positive.
    """
    theta = np.asarray(parameters, dtype=np.float64)
    if theta.shape != (10 * len(robot.links),) or not np.isfinite(theta).all():
        raise ParameterError(
            f"parameters: wanted {10 * len(robot.links)} finite numbers, ten for each link of robot '{robot.name}'; "
            f"got shape {theta.shape}"
        )
    if not theta[::10].sum() > 0.0:
        raise ParameterError(
            f"robot '{robot.name}': its links' masses sum to {theta[::10].sum():.6g} kg, which has no centre; "
            "give parameters with mass"
        )
    return theta


def _rows(name: str, values: npt.ArrayLike, width: int, robot: Robot) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim not in (1, 2) or array.shape[-1] != width:
        raise ParameterError(
            f"{name}: wanted shape ({width},) or (N, {width}) for robot '{robot.name}'; got {array.shape}"
        )
    if not np.isfinite(array).all():
        sample = int(np.argwhere(~np.isfinite(np.atleast_2d(array)))[0][0])
        raise ParameterError(f"{name}: must be finite; sample {sample} is not: {np.atleast_2d(array)[sample]}")
    return array


def _check_unit(joint: Joint, part: Array) -> None:
    off = np.abs(np.linalg.norm(part, axis=1) - 1.0)
    worst = int(np.argmax(off)) if len(off) else 0
    if len(off) and off[worst] > UNIT:
        words = "(cos, sin)" if part.shape[1] == 2 else "quaternion (x, y, z, w)"
        raise ParameterError(
            f"q: joint '{joint.name}' wants a {words} of unit length; sample {worst} has {part[worst]}"
        )

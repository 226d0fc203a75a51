"""Wrenches that were measured, and contacts whose wrenches were not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.kinematics import Axes, Frame, Kinematics

RESTING = 0.1
"""A frame that touches the world rests if it is slower than this share of the fastest frame's root mean square speed.

Contact forces drop out only of what moves no foot: a foot that slides at a tenth of the robot's speed leaves a tenth of
its friction's power in the equations.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Wrench:
    """A measured wrench of the world on the robot.

    Attributes:
        frame: At whose origin.
        values: Force and moment at every sample, shape (N, 6), [N, N m].
        axes: Along which axes.
    """

    frame: str | Frame
    values: Array
    axes: Axes = Axes.FRAME

    def __post_init__(self) -> None:
        values = frozen(self.values)
        if values.ndim != 2 or values.shape[1] != 6 or not np.isfinite(values).all():
            raise ParameterError(
                f"wrench of {name_of(self.frame)}: wanted finite values (N, 6); got shape {values.shape}"
            )
        object.__setattr__(self, "values", values)


@dataclass(frozen=True, eq=False, kw_only=True)
class Contact:
    """A frame that touches the world with a wrench that nobody measured.

    Attributes:
        frame: It rests while it touches.
        touching: When, boolean, shape (N,).
        is_flat: Whether it cannot turn either, as a flat foot; else it is a point, which has no moment.
    """

    frame: str | Frame
    touching: npt.NDArray[np.bool_]
    is_flat: bool = False

    def __post_init__(self) -> None:
        touching = np.array(self.touching)
        if touching.ndim != 1 or touching.dtype != np.bool_:
            raise ParameterError(
                f"contact of {name_of(self.frame)}: wanted true or false at every sample, (N,); got "
                f"{touching.dtype} of shape {touching.shape}"
            )
        touching.setflags(write=False)
        object.__setattr__(self, "touching", touching)

    @property
    def rows(self) -> int:
        """Of its Jacobian."""
        return 6 if self.is_flat else 3


def name_of(frame: str | Frame) -> str:
    """A frame's name in quotes."""
    return f"'{frame if isinstance(frame, str) else frame.name}'"


def generalised_forces(
    kinematics: Kinematics, q: npt.ArrayLike, torque: npt.ArrayLike, wrenches: Sequence[Wrench]
) -> Array:
    """``τ + Σ J_fᵀ w_f`` at every sample, shape (N, nv).

    Args:
        kinematics: Of the robot.
        q: Configurations, shape (N, nq).
        torque: Of the drives, zeros where there is none, shape (N, nv).
        wrenches: Measured.

    Raises:
        ParameterError: A shape does not fit, or there is no such frame.
    """
    total = np.array(torque, dtype=np.float64)
    for wrench in wrenches:
        jacobians = kinematics.jacobians(wrench.frame, q, wrench.axes)
        if not len(jacobians) == len(total) == len(wrench.values):
            raise ParameterError(
                f"wrench of {name_of(wrench.frame)}: wanted as many samples as q and torque have; got "
                f"{len(wrench.values)}, {len(jacobians)} and {len(total)}"
            )
        total += np.einsum("nij,ni->nj", jacobians, wrench.values)
    return total


def check_contacts(kinematics: Kinematics, q: Array, v: Array, contacts: Sequence[Contact]) -> None:
    """Nothing, if all frames rest while they touch the world.

    Raises:
        ParameterError: One slides; the message says which, how fast, and when first.
    """
    if not contacts:
        return
    speeds = [
        np.linalg.norm(kinematics.velocities(joint.name, q, v)[:, :3], axis=1) for joint in kinematics.robot.joints
    ]
    fastest = max(float(np.sqrt(np.mean(speed**2))) for speed in speeds)
    for contact in contacts:
        velocity = kinematics.velocities(contact.frame, q, v)[contact.touching, :3]
        if not len(velocity):
            continue
        speed = np.linalg.norm(velocity, axis=1)
        usual = float(np.sqrt(np.mean(speed**2)))
        if usual > RESTING * fastest:
            first = int(np.flatnonzero(contact.touching)[np.argmax(speed > RESTING * fastest)])
            raise ParameterError(
                f"contact of {name_of(contact.frame)}: the frame moves at {usual:.3g} m/s (root mean square) while it "
                f"is said to touch, {usual / fastest:.0%} of the robot's fastest joint frame; first in sample {first}. "
                "Feet that slide or roll have friction that does not drop out: correct the flags, or measure the wrench"
            )

"""What each joint may do: position, velocity, acceleration, jerk, torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation.motion.configuration import check_joints
from casysid.robot import JointKind, Robot

FREE_RANGE = {True: 0.3, False: np.pi}
"""Half the range of a joint without position limits: [m] linear, [rad] angular."""
FREE_SPEED = {True: 0.5, False: 2.0}
"""Velocity of a joint without a velocity limit: [m/s], [rad/s]."""
WIDEST = 4.0 * np.pi
"""Limits farther away than this, [rad] or [m], are none."""
FASTEST = 50.0
"""A velocity limit beyond this, [rad/s] or [m/s], is none."""


@dataclass(frozen=True, eq=False, kw_only=True)
class JointLimits:
    """Bounds that the trajectory keeps, each of shape (n,), by degree of freedom; inf for none where allowed.

    Attributes:
        lower: Of the position, finite [rad, m].
        upper: Of the position, finite [rad, m].
        velocity: Of its absolute value, finite [rad/s, m/s].
        acceleration: Likewise [rad/s², m/s²].
        jerk: Likewise [rad/s³, m/s³].
        torque: Likewise [N m, N].
        assumed: What was not in the model and had to be assumed, in words.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("lower", "upper", "velocity", "acceleration", "jerk", "torque"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def check(self, robot: Robot) -> None:
        """Nothing, if every joint can move.

        Raises:
            ParameterError: A joint cannot; the message names it.
        """
        for k, dof in enumerate(robot.dofs):
            if not self.lower[k] < self.upper[k]:
                raise ParameterError(
                    f"limits of joint '{dof}': position must have room to move; got {self.lower[k]:.6g} to "
                    f"{self.upper[k]:.6g}. Correct the limits, or hold the joint (lock it)"
                )
            for name in ("velocity", "acceleration", "jerk", "torque"):
                value = getattr(self, name)[k]
                if not value > 0.0:
                    raise ParameterError(
                        f"limits of joint '{dof}': {name} must be positive, or the joint cannot move; got {value:.6g}. "
                        "Correct the limit, or hold the joint (lock it)"
                    )

    @property
    def half_range(self) -> Array:
        """Of the position, shape (n,)."""
        return np.asarray((self.upper - self.lower) / 2.0)

    @property
    def middle(self) -> Array:
        """Of the position, shape (n,)."""
        return np.asarray((self.upper + self.lower) / 2.0)


def limits_of(
    robot: Robot,
    *,
    position_share: float = 0.95,
    velocity_share: float = 0.9,
    torque_share: float = 0.7,
    acceleration: npt.ArrayLike = np.inf,
    jerk: npt.ArrayLike = np.inf,
) -> JointLimits:
    """Limits from the model file, with a margin.

    The motion as designed keeps them. A robot that follows it overshoots by the errors of its controller, for which the
    shares leave room: an ideal machine at 1 kHz by some thousandths, one with stiction by some hundredths.

    Args:
        robot: Its joints have one degree of freedom each.
        position_share: Share of the position range, about its middle.
        velocity_share: Share of the velocity limit, what is left is for the controller.
        torque_share: Share of the effort limit, what is left is for masses and friction that are not as
            in the file.
        acceleration: Largest [rad/s², m/s²], one for all or (n,).
        jerk: Largest [rad/s³, m/s³], likewise.

    Raises:
        ParameterError: A share is not above 0 and up to 1, or a joint has no room to move or not one degree of freedom.
    """
    check_joints(robot)
    for name, share in (("position", position_share), ("velocity", velocity_share), ("torque", torque_share)):
        if not 0.0 < share <= 1.0:
            raise ParameterError(f"limits: {name}_share must be above 0 and at most 1; got {share}")
    n, assumed = len(robot.dofs), []
    free_speed: tuple[list[str], list[str]] = ([], [])
    lower, upper, velocity = np.empty(n), np.empty(n), np.empty(n)
    for joint in robot.joints:
        k, linear = joint.v.start, joint.kind is JointKind.PRISMATIC
        lower[k], upper[k], free = _range(robot, joint.channels.start, FREE_RANGE[linear])
        if free:
            assumed.append(f"joint '{joint.name}' has no position limits: {lower[k]:.3g} to {upper[k]:.3g} assumed")
        velocity[k] = robot.velocity_limit[k]
        if not velocity[k] <= FASTEST:
            velocity[k] = FREE_SPEED[linear] / velocity_share
            free_speed[linear].append(joint.name)
    assumed += [
        f"no velocity limit, or one of zero, in the file for {', '.join(free_speed[linear])}: {FREE_SPEED[linear]:.3g} "
        f"{'m/s' if linear else 'rad/s'} assumed"
        for linear in (False, True)
        if free_speed[linear]
    ]
    middle, half = (upper + lower) / 2.0, position_share * (upper - lower) / 2.0
    limits = JointLimits(
        lower=middle - half,
        upper=middle + half,
        velocity=velocity_share * velocity,
        acceleration=np.broadcast_to(np.asarray(acceleration, dtype=np.float64), (n,)),
        jerk=np.broadcast_to(np.asarray(jerk, dtype=np.float64), (n,)),
        torque=torque_share * robot.effort_limit,
        assumed=tuple(assumed),
    )
    limits.check(robot)
    return limits


def _range(robot: Robot, channel: int, reach: float) -> tuple[float, float, bool]:
    """Lowest and highest position of a channel, and whether one had to be assumed."""
    low, high = float(robot.position_lower[channel]), float(robot.position_upper[channel])
    no_low, no_high = not low >= -WIDEST, not high <= WIDEST
    if no_low and no_high:
        return -reach, reach, True
    if no_low:
        return high - 2.0 * reach, high, True
    if no_high:
        return low, low + 2.0 * reach, True
    return low, high, False

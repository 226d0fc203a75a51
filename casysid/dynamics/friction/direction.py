"""Where friction acts: transmission coordinates of joints, and of motors that turn several joints at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.robot import JointKind, Robot


@dataclass(frozen=True, eq=False)
class Direction:
    """A transmission coordinate ``s = cᵀ q``; torques along it act on the joints as ``c f``.

    Attributes:
        name: The degree of freedom, or those of a coupling joined by ``+``.
        weights: ``c``, shape (nv,).
        linear: Whether it is a length [m] rather than an angle [rad].
        unlimited: Whether it is the angle of a joint that turns without end, so that only its sine and cosine count.
    """

    name: str
    weights: Array
    linear: bool
    unlimited: bool = False


@dataclass(frozen=True)
class Coupling:
    """A motor or gear that acts on several joints: its coordinate is the weighted sum of theirs.

    The sum counts as a length when all its joints are linear, else as an angle (a ball screw's weight is in rad/m). Its
    name holds the signs of the weights, such as ``joint_5+joint_6``.

    Attributes:
        joints: Names of degrees of freedom.
        weights: One for each.
        kinds: Of friction that it has; None for all that joints have.
    """

    joints: tuple[str, ...]
    weights: tuple[float, ...]
    kinds: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if len(self.joints) < 2 or len(set(self.joints)) != len(self.joints) or len(self.joints) != len(self.weights):
            raise ParameterError(
                "coupling: needs two or more different joints and one weight for each; "
                f"got joints {self.joints} and weights {self.weights}"
            )

    @property
    def name(self) -> str:
        """The joints with the signs of their weights between them."""
        signs = ["" if k == 0 and w >= 0.0 else "+" if w >= 0.0 else "-" for k, w in enumerate(self.weights)]
        return "".join(sign + joint for sign, joint in zip(signs, self.joints, strict=True))


def joint_directions(robot: Robot) -> dict[int, Direction]:
    """The direction of every driven degree of freedom, by its index; a free-flyer has no drive and no friction."""
    identity, directions = np.eye(robot.nv), {}
    for joint in robot.joints:
        if joint.kind is JointKind.FREE_FLYER:
            continue
        for k, dof in enumerate(range(joint.v.start, joint.v.stop)):
            linear = joint.kind is JointKind.PRISMATIC or (joint.kind is JointKind.PLANAR and k < 2)
            unlimited = joint.kind is JointKind.CONTINUOUS
            directions[dof] = Direction(robot.dofs[dof], frozen(identity[dof]), linear, unlimited)
    return directions


def coupling_direction(robot: Robot, coupling: Coupling) -> Direction:
    """The direction of a coupling.

    Raises:
        ParameterError: When a joint is unknown or is a free-flyer.
    """
    driven = {direction.name: direction for direction in joint_directions(robot).values()}
    unknown = [name for name in coupling.joints if name not in driven]
    if unknown:
        raise ParameterError(
            f"coupling: no degree of freedom named {', '.join(unknown)}; known are {', '.join(driven)}"
        )
    weights = sum(w * driven[name].weights for name, w in zip(coupling.joints, coupling.weights, strict=True))
    return Direction(coupling.name, frozen(weights), all(driven[name].linear for name in coupling.joints))


def force_unit(direction: Direction) -> str:
    """Unit of a torque along a direction."""
    return "N" if direction.linear else "N m"


def damping_unit(direction: Direction) -> str:
    """Unit of a torque over a velocity along a direction."""
    return "N s/m" if direction.linear else "N m s/rad"


def speed_unit(direction: Direction) -> str:
    """Unit of a velocity along a direction."""
    return "m/s" if direction.linear else "rad/s"

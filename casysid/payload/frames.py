"""Where a payload is held: the link that carries it, and the frame in which it is told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.inertia import parameters_from_pseudo_inertia, pseudo_inertia
from casysid.robot import Robot


@dataclass(frozen=True, eq=False)
class HoldingFrame:
    """The frame in which a payload is told.

    Attributes:
        name: Of the link, or of the frame that is fixed to it.
        columns: Of the link's ten parameters in the robot's regressor.
        to_link: Takes the payload's parameters to what they add to the link's, shape (10, 10).
    """

    name: str
    columns: npt.NDArray[np.intp]
    to_link: Array


def holding_frame(robot: Robot, name: str | None) -> HoldingFrame:
    """The frame of a name; None for the link at the end of the robot.

    Raises:
        ParameterError: There is no such link or frame, it is fixed to the world, or the robot has several ends.
    """
    if name is None:
        parents = {joint.parent for joint in robot.joints}
        ends = [joint.link for k, joint in enumerate(robot.joints) if k not in parents and joint.link]
        if len(ends) != 1:
            raise ParameterError(
                f"payload: robot '{robot.name}' ends in {', '.join(ends)}; say which link holds it, with --link NAME, "
                "or hold the fingers' joints with --lock JOINT=VALUE"
            )
        name = ends[0]
    if name in robot.links:
        return HoldingFrame(name, _columns(robot, name), np.eye(10))
    model = robot.model
    joint = model.frames[model.getFrameId(name)].parentJoint if model.existFrame(name) else 0
    link = robot.joints[joint - 1].link if joint else None
    if link is None:
        raise ParameterError(
            f"payload: robot '{robot.name}' has no moving link or frame called {name!r}; its links are "
            f"{', '.join(robot.links)}"
        )
    T = model.frames[model.getFrameId(name)].placement.homogeneous
    to_link = [parameters_from_pseudo_inertia(T @ pseudo_inertia(unit) @ T.T) for unit in np.eye(10)]
    return HoldingFrame(name, _columns(robot, link), np.array(to_link).T)


def _columns(robot: Robot, link: str) -> npt.NDArray[np.intp]:
    return 10 * robot.links.index(link) + np.arange(10)

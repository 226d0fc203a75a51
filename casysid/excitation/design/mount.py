"""What a robot with a fixed base stands on, where nobody says it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.excitation.constraints.capsules import Capsule
from casysid.excitation.constraints.clearance import build_clearance
from casysid.excitation.constraints.kinematics import Points
from casysid.excitation.constraints.obstacles import HalfSpace
from casysid.excitation.constraints.solids import FileGeometry, corners
from casysid.kinematics.frames import WORLD
from casysid.robot import Robot

Floor = float | Literal["mount"] | None
"""Height of a floor [m]; ``"mount"``: that of the file, or else the plane on which the base stands; None for none."""


@dataclass(frozen=True, eq=False)
class Mount:
    """The floor that a design keeps above.

    Attributes:
        planes: None, one, or those of the file.
        said: What was found or assumed, in words.
    """

    planes: tuple[HalfSpace, ...]
    said: str = ""


def find_mount(
    robot: Robot, floor: Floor, geometry: FileGeometry, capsules: tuple[Capsule, ...], samples: Array, margin: float
) -> Mount:
    """The floor asked for; else the file's planes; else the plane under the base, if the robot stands upon it.

    That plane is across the base's z axis, at the lowest point of what the file fixes to the base, or at the base's
    origin. The robot stands upon it if what moves is above it on average, and at some samples as a whole.

    Args:
        robot: With a fixed base.
        floor: See :data:`Floor`.
        geometry: Of its file.
        capsules: Around its links.
        samples: Joint positions to judge by, shape (N, n).
        margin: Distance to keep [m].

    Raises:
        ParameterError: The floor is neither a height nor one of the words.
    """
    up = np.array([0.0, 0.0, 1.0])
    if floor is None:
        return Mount((), "no floor")
    if floor != "mount":
        if not (isinstance(floor, int | float) and np.isfinite(floor)):
            raise ParameterError(f'excitation: floor must be a height [m], "mount" or None; got {floor!r}')
        return Mount((HalfSpace("floor", up, float(floor)),))
    if geometry.floors:
        planes = tuple(HalfSpace("floor", normal, offset) for normal, offset in geometry.floors)
        return Mount(planes, "the file's own floor is kept clear of")
    fixed = list(corners(geometry.solids, WORLD))
    height = float(np.concatenate(fixed)[:, 2].min()) if fixed else 0.0
    plane = HalfSpace("floor", up, height)
    where = f"at {height:.3g} m, {'the lowest point of the base' if fixed else 'the origin of the base'}"
    change = "give a height or none to change this"
    moving = [capsule for capsule in capsules if capsule.joint != WORLD]
    if not moving:
        return Mount((), f"no floor, as the file does not say where links are; {change}")
    points = Points(robot)
    middles = np.array([(one.start + one.end) / 2.0 for one in moving])
    joint = np.array([one.joint for one in moving], dtype=np.intp)
    if points.places(points.frames(samples), joint, middles)[2].mean() < height:
        return Mount((), f"no floor, as the robot hangs below its base; {change}")
    kept = build_clearance(robot, moving, (plane,), samples, margin)
    against = kept.distances(samples)[:, len(kept.pairs) :]
    if not (against.min(axis=1, initial=np.inf) >= margin).any():
        return Mount((), f"no floor, as links are below the base wherever the joints are; {change}")
    return Mount((plane,), f"the robot stands on a floor {where}; {change}")

"""Tells model files apart."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy.typing as npt

from casysid.errors import RobotError
from casysid.robot.model import Robot
from casysid.robot.urdf import read_urdf
from casysid.robot.xmltext import parse_xml, read_bytes


def read_robot(
    path: Path,
    *,
    gravity: npt.ArrayLike | None = None,
    floating_base: bool = False,
    locked: Mapping[str, float] | None = None,
) -> Robot:
    """The robot in a URDF or MJCF file; see :meth:`Robot.from_file`.

    Raises:
        RobotError: The file is neither, or cannot be used.
    """
    root = parse_xml(read_bytes(path), path)
    if root.tag == "robot":
        return read_urdf(path, gravity=gravity, floating_base=floating_base, locked=locked, stacklevel=4)
    if root.tag == "mujoco":
        from casysid.robot.mjcf import read_mjcf

        return read_mjcf(path, gravity=gravity, floating_base=floating_base, locked=locked, stacklevel=4)
    raise RobotError(f"{path}: the root element is <{root.tag}>; wanted <robot> (URDF) or <mujoco> (MJCF)")

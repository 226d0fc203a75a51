"""Writes a robot with new parameters in the format that came in, and reads it back to be sure."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import RobotError
from casysid.inertia import mass_properties
from casysid.outputs import whole_file
from casysid.robot.lumping import is_body
from casysid.robot.model import Joint, JointKind, Robot
from casysid.robot.reading import read_robot

_RELATIVE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class WrittenModel:
    """A model file that was written.

    Attributes:
        path: Where it is.
        notes: What the file cannot say, or says in another way than the one that came in.
    """

    path: Path
    notes: tuple[str, ...]


def write_robot(
    robot: Robot,
    path: str | Path,
    inertial_parameters: npt.ArrayLike,
    *,
    damping: npt.ArrayLike | None = None,
    dry_friction: npt.ArrayLike | None = None,
    armature: npt.ArrayLike | None = None,
    keep_as: str | Path | None = None,
) -> WrittenModel:
    """Writes the robot's file with other parameters; everything else in it stays.

    The inertia of a lumped body goes into the link that its joint carries. Links fixed to that keep theirs, if what is
    left is a body; else they become massless. URDF has no place for armature, nor for friction of joints with several
    degrees of freedom: those are left to the notes, and to a comment in the file.

    Args:
        robot: Read from a file, which must still be there.
        path: File to write, in the format of ``robot.source``.
        inertial_parameters: Shape (10 links,), at the joint frames.
        damping: Shape (nv,); None keeps the robot's.
        dry_friction: Shape (nv,); None keeps the robot's.
        armature: Shape (nv,); None keeps the robot's.
        keep_as: Put the file there instead, once it has been read back at its place: it waits for the rest of a run.

    Raises:
        ParameterError: A parameter vector does not fit.
        RobotError: The file does not read back as the same robot; nothing is left behind then.
        OutputError: The file cannot be written; nothing is left behind then.
    """
    path = Path(path)
    wanted = robot.with_parameters(
        inertial_parameters=inertial_parameters, damping=damping, dry_friction=dry_friction, armature=armature
    )
    if not robot.source.is_file():
        raise RobotError(
            f"robot '{robot.name}': its file {robot.source} is not there; only robots read from a file are written"
        )
    text, notes = _text_of(wanted, path.parent)
    impossible = [
        f"link '{link}': its parameters are not those of a body; simulators may refuse the file"
        for link, theta in zip(wanted.links, wanted.inertial_parameters.reshape(-1, 10), strict=True)
        if not is_body(mass_properties(theta))
    ]
    with whole_file(path, keep_as=keep_as) as stream:
        stream.write(text)
        stream.flush()
        if robot.source_format == "urdf" or not impossible:
            _check_same(wanted, _read_back(wanted, Path(stream.name)), path)
    return WrittenModel(path, (*notes, *impossible))


def _text_of(robot: Robot, folder: Path) -> tuple[bytes, list[str]]:
    if robot.source_format == "urdf":
        from casysid.robot.write_urdf import urdf_text

        return urdf_text(robot, folder)
    from casysid.robot.write_mjcf import mjcf_text

    return mjcf_text(robot, folder)


def _read_back(robot: Robot, path: Path) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return read_robot(path, gravity=robot.gravity, floating_base=robot.floating_base, locked=dict(robot.locked))


def _check_same(wanted: Robot, got: Robot, path: Path) -> None:
    """Nothing, if the file says what was meant.

    Raises:
        RobotError: It does not.
    """
    if (wanted.links, wanted.dofs) != (got.links, got.dofs):
        raise RobotError(f"{path}: the written file has other links or joints than {wanted.source}; it was not kept")
    for joint, other in zip(wanted.joints, got.joints, strict=True):
        if not joint.placement.isApprox(other.placement, _RELATIVE_TOLERANCE):
            raise RobotError(f"{path}: joint '{joint.name}' stands elsewhere in the written file; it was not kept")
        _check_friction(wanted, got, joint, path)
    rows = zip(
        wanted.links, wanted.inertial_parameters.reshape(-1, 10), got.inertial_parameters.reshape(-1, 10), strict=True
    )
    for link, theta, read in rows:
        error = np.abs(theta - read) / _scales(theta)
        if not (error <= _RELATIVE_TOLERANCE).all():
            raise RobotError(
                f"{path}: link '{link}' reads back with inertial parameters off by {error.max():.1e}; it was not kept"
            )


def _check_friction(wanted: Robot, got: Robot, joint: Joint, path: Path) -> None:
    if joint.kind not in (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC):
        return
    names = ("damping", "dry_friction") + (("armature",) if wanted.source_format == "mjcf" else ())
    for name in names:
        value, read = getattr(wanted, name)[joint.v], getattr(got, name)[joint.v]
        if not np.allclose(value, read, rtol=_RELATIVE_TOLERANCE, atol=1e-15):
            raise RobotError(f"{path}: joint '{joint.name}' reads back with {name} {read[0]:g}, not {value[0]:g}")


def _scales(theta: Array) -> Array:
    """Magnitudes to which errors of ten parameters are compared: a first moment is at most √(m tr I)."""
    inertia = float(np.abs(theta[4:]).max())
    first = float(np.abs(theta[1:4]).max()) + np.sqrt(abs(theta[0]) * inertia)
    scales = np.concatenate([[abs(theta[0])], np.full(3, first), np.full(6, inertia)])
    return np.asarray(np.maximum(scales, 1e-12))

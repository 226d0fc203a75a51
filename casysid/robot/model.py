"""The robot as casysid sees it: loaded, checked, frozen."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy.typing as npt

from casysid.arrays import Array
from casysid.robot.checks import InertiaFault

SourceFormat = Literal["urdf", "mjcf"]


class JointKind(enum.Enum):
    """The joints that dynamics and channels know."""

    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"
    SPHERICAL = "spherical"
    PLANAR = "planar"
    FREE_FLYER = "free-flyer"


@dataclass(frozen=True, eq=False, kw_only=True)
class Joint:
    """One joint of the kinematic tree, in the order of ``pin.Model`` (its universe left out).

    Attributes:
        name: As in the file.
        kind: What motion it allows.
        parent: Index of the joint before it in :attr:`Robot.joints`, -1 for the world.
        placement: Pose of the joint frame in the parent joint's frame, a ``pin.SE3``.
        axis: Unit axis in the joint frame, shape (3,); zeros where the joint has several degrees of freedom.
        q: Its places in Pinocchio's configuration (nq).
        v: Its places in Pinocchio's velocity (nv).
        channels: Its places among the log's position channels.
        link: The link it carries; None for the massless frame between several MJCF joints of one body.
    """

    name: str
    kind: JointKind
    parent: int
    placement: Any
    axis: Array
    q: slice
    v: slice
    channels: slice
    link: str | None


@dataclass(frozen=True, eq=False, kw_only=True)
class Robot:
    """A kinematic tree with its parameters from the model file.

    Attributes:
        name: As in the file.
        source: The file.
        source_format: Format of the file, and of what is written for it.
        model: The ``pin.Model``. Never modify it. A continuous joint is (cos, sin) there, so nq may exceed nv.
        joints: In Pinocchio's order.
        links: The bodies to identify, in joint order, ten parameters each; fixed children are part of them.
        dofs: Names of the nv degrees of freedom: the joint's name, or ``<joint>_<vx|vy|vz|wx|wy|wz>``.
        channels: Names of the logged positions: the joint's name, or ``<joint>_<x|y|z|qx|qy|qz|qw|theta>``.
        inertial_parameters: The file's, shape (10 links,): per link m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz at
            the joint frame [kg, kg m, kg m²]. Always finite.
        damping: Viscous friction, shape (nv,), [N m s/rad] or [N s/m].
        dry_friction: Coulomb friction, shape (nv,), [N m] or [N].
        armature: Rotor inertia, shape (nv,), [kg m²] or [kg].
        position_lower: Shape (channels,), -inf where there is none.
        position_upper: Shape (channels,), inf where there is none.
        velocity_limit: Shape (nv,), inf where there is none.
        effort_limit: Shape (nv,), inf where there is none.
        gravity: Shape (3,), [m/s²].
        faults: What was wrong with inertial parameters in the file.
        floating_base: Whether a free joint was put under the base of a file that has none.
        locked: Joints held at a position, by name [rad or m].
        file_order: Names of the joints as the file has them; empty where that is Pinocchio's order, which takes the
            children of a link by their names.
    """

    name: str
    source: Path
    source_format: SourceFormat
    model: Any
    joints: tuple[Joint, ...]
    links: tuple[str, ...]
    dofs: tuple[str, ...]
    channels: tuple[str, ...]
    inertial_parameters: Array
    damping: Array
    dry_friction: Array
    armature: Array
    position_lower: Array
    position_upper: Array
    velocity_limit: Array
    effort_limit: Array
    gravity: Array
    faults: tuple[InertiaFault, ...] = ()
    floating_base: bool = False
    locked: tuple[tuple[str, float], ...] = ()
    file_order: tuple[str, ...] = ()

    @property
    def numbered(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Channels and degrees of freedom in the order that a log's numbers count: that of the file."""
        by_name = {joint.name: joint for joint in self.joints}
        joints = [by_name[name] for name in self.file_order] or list(self.joints)
        return (
            tuple(name for joint in joints for name in self.channels[joint.channels]),
            tuple(name for joint in joints for name in self.dofs[joint.v]),
        )

    def __repr__(self) -> str:
        return f"<Robot '{self.name}': {self.nv} degrees of freedom, {len(self.links)} links, from {self.source.name}>"

    @property
    def nq(self) -> int:
        """Length of Pinocchio's configuration."""
        return int(self.model.nq)

    @property
    def nv(self) -> int:
        """Number of degrees of freedom."""
        return int(self.model.nv)

    @classmethod
    def from_file(
        cls,
        path: str | Path,
        *,
        gravity: npt.ArrayLike | None = None,
        floating_base: bool = False,
        locked: Mapping[str, float] | None = None,
    ) -> Robot:
        """The robot in a URDF or MJCF file, told apart by the file's root element.

        Args:
            path: The file.
            gravity: Three numbers [m/s²]; None takes the file's, which for a URDF is (0, 0, -9.81).
            floating_base: Whether the base moves freely.
            locked: Joints to hold, with their positions [rad or m]; what they carry joins the link before them.

        Raises:
            RobotError: The file cannot be used; the message says why and what to do.
        """
        from casysid.robot.reading import read_robot

        return read_robot(Path(path), gravity=gravity, floating_base=floating_base, locked=locked)

    @classmethod
    def from_urdf(
        cls,
        path: str | Path,
        *,
        gravity: npt.ArrayLike | None = None,
        floating_base: bool = False,
        locked: Mapping[str, float] | None = None,
    ) -> Robot:
        """The robot in a URDF file; meshes and other geometry are not looked at. Arguments as for :meth:`from_file`."""
        from casysid.robot.urdf import read_urdf

        return read_urdf(Path(path), gravity=gravity, floating_base=floating_base, locked=locked)

    @classmethod
    def from_mjcf(
        cls,
        path: str | Path,
        *,
        gravity: npt.ArrayLike | None = None,
        floating_base: bool = False,
        locked: Mapping[str, float] | None = None,
    ) -> Robot:
        """The robot in an MJCF file, as MuJoCo compiles it. Arguments as for :meth:`from_file`."""
        from casysid.robot.mjcf import read_mjcf

        return read_mjcf(Path(path), gravity=gravity, floating_base=floating_base, locked=locked)

    @classmethod
    def from_pin(cls, model: Any, *, name: str = "robot", source_format: SourceFormat = "urdf") -> Robot:
        """The robot of a ``pin.Model`` built in memory, copied; every joint carries a link ``<joint>_link``.

        Raises:
            RobotError: A joint is of a kind that casysid does not know.
        """
        from casysid.robot.assembly import assemble_robot

        links = [f"{joint}_link" for joint in list(model.names)[1:]]
        return assemble_robot(model.copy(), links, name=name, source=Path(name), source_format=source_format)

    def with_gravity(self, gravity: npt.ArrayLike) -> Robot:
        """The same robot where its base stands otherwise: gravity in the base's frame, shape (3,), [m/s²].

        Raises:
            RobotError: It is not three finite numbers.
        """
        from casysid.robot.assembly import replace_gravity

        return replace_gravity(self, gravity)

    def with_parameters(
        self,
        *,
        inertial_parameters: npt.ArrayLike | None = None,
        damping: npt.ArrayLike | None = None,
        dry_friction: npt.ArrayLike | None = None,
        armature: npt.ArrayLike | None = None,
    ) -> Robot:
        """The same robot with other parameters, in its fields and in its model; None keeps what is there.

        Args:
            inertial_parameters: Shape (10 links,), physically consistent or not.
            damping: Shape (nv,).
            dry_friction: Shape (nv,).
            armature: Shape (nv,).

        Raises:
            ParameterError: A shape does not fit, a number is not finite, or a link without mass has a first moment.
        """
        from casysid.robot.assembly import replace_parameters

        return replace_parameters(self, inertial_parameters, damping, dry_friction, armature)

"""Logs of robots whose base is free: wrenches at frames, and a base that no motor drives.

The equations of such a robot are ``Y θ = Sᵀ τ + Σ J_fᵀ w_f``: the joints' torques, and the wrenches that the world
applies at frames. The right side is what is measured, so it is put in the place of the torques, sample by sample, and
all that follows is as for any other robot. Columns beside those of every log:

========================================= =============================================================
``fx_<frame> … fz_<frame>``                force of the world on the robot at the frame's origin [N]
``mx_<frame> … mz_<frame>``                its moment about the frame's origin [N m]
``world_fx_<frame> … world_mz_<frame>``    the same along the world's axes; without ``world_`` the frame's own
``contact_<frame>``                        1 while the frame touches the world, 0 else
========================================= =============================================================

Components that are not there are zero. Torques of the free base need no columns: they are zero.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.candidates import POSITION, TORQUE, Labels
from casysid.readers.messages import listing
from casysid.readers.table import Table
from casysid.robot import JointKind, Robot
from casysid.robot.coordinates import configuration_from_channels

if TYPE_CHECKING:
    from casysid.kinematics import Kinematics

COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
_WRENCH = re.compile(rf"(world_)?({'|'.join(COMPONENTS)})_(.+)")
_CONTACT = re.compile(r"contact_(.+)")


@dataclass(frozen=True)
class WrenchColumns:
    """Columns of one wrench.

    Attributes:
        frame: Where it acts.
        in_world: Whether its components are along the world's axes.
        columns: By component; None where it is not there.
    """

    frame: str
    in_world: bool
    columns: tuple[str | None, ...]


def base_dofs(robot: Robot) -> slice | None:
    """Places in v of a free base; None where the base is fixed."""
    first = robot.joints[0]
    return first.v if first.kind is JointKind.FREE_FLYER else None


def with_generalised_forces(table: Table, robot: Robot, source: str) -> Table:
    """The table with generalised forces as torques, for a robot with a free base; else the very table.

    Raises:
        RecordingError: A wrench or a contact names a frame that the robot has not, or a frame touches the world while
            no wrench of it is there.
    """
    base = base_dofs(robot)
    if base is None:
        return table
    wrenches, contacts = find_wrenches(table.names, robot, source), find_contacts(table.names, robot, source)
    silent = [column for frame, column in contacts.items() if frame not in {wrench.frame for wrench in wrenches}]
    if silent:
        raise RecordingError(
            f"{source}: {listing(silent)}: contacts without a wrench; torques cannot be told from contact forces that "
            "nobody measured. Log the wrench (fx_<frame> ... mz_<frame>), leave out stretches in contact, or take "
            "moments of what the contacts leave free (casysid.floating.projected_moments)"
        )
    return GeneralisedTable(table, robot, wrenches, source)


def find_wrenches(names: Sequence[str], robot: Robot, source: str) -> tuple[WrenchColumns, ...]:
    """Wrenches among the columns of a log.

    Raises:
        RecordingError: One names a frame that the robot has not, or is given along both axes.
    """
    found: dict[tuple[str, bool], dict[str, str]] = {}
    for name in names:
        if match := _WRENCH.fullmatch(name):
            _require_frame(robot, match[3], name, source)
            found.setdefault((match[3], match[1] is not None), {})[match[2]] = name
    both = sorted(frame for frame, in_world in found if in_world and (frame, False) in found)
    if both:
        raise RecordingError(
            f"{source}: the wrench of frame '{both[0]}' is given along the world's axes and along its own; keep one"
        )
    return tuple(
        WrenchColumns(frame, in_world, tuple(columns.get(component) for component in COMPONENTS))
        for (frame, in_world), columns in found.items()
    )


def find_contacts(names: Sequence[str], robot: Robot, source: str) -> dict[str, str]:
    """Columns of contact flags by frame.

    Raises:
        RecordingError: One names a frame that the robot has not.
    """
    found = {}
    for name in names:
        if match := _CONTACT.fullmatch(name):
            _require_frame(robot, match[1], name, source)
            found[match[1]] = name
    return found


def _require_frame(robot: Robot, frame: str, column: str, source: str) -> None:
    from casysid.kinematics import frames_of

    names = [one.name for one in frames_of(robot)]
    if frame not in names:
        near = difflib.get_close_matches(frame, names, n=3)
        hint = f"; did you mean {listing(near)}?" if near else ""
        raise RecordingError(
            f"{source}: column '{column}': robot '{robot.name}' has no frame '{frame}'{hint} Frames: {listing(names)}"
        )


@dataclass(frozen=True)
class GeneralisedTable:
    """A table whose torque columns are generalised forces.

    Attributes:
        table: The log.
        robot: Whose base is free.
        wrenches: In the log.
        source: For messages.
    """

    table: Table
    robot: Robot
    wrenches: tuple[WrenchColumns, ...]
    source: str

    @property
    def names(self) -> tuple[str, ...]:
        """The log's columns, and those of the base's torques where it has none."""
        return (*self.table.names, *self._added)

    @property
    def labels(self) -> Labels:
        """As the log's own."""
        return self.table.labels

    @property
    def nameless(self) -> str:
        """As the log's own."""
        return self.table.nameless

    @property
    def seekable(self) -> bool:
        """As the log is."""
        return self.table.seekable

    def place(self, row: int) -> str:
        """As in the log."""
        return self.table.place(row)

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[dict[str, Array]]:
        """Columns as float64, torques with what the wrenches do to them.

        Raises:
            RecordingError: A wrench is not finite.
        """
        torque = [f"{self._spelling}_{dof}" for dof in self.robot.dofs]
        summed = [name for name in names if name in torque] if self.wrenches else []
        more = [*self._positions, *self._components] if summed else []
        asked = dict.fromkeys([*(name for name in names if name not in self._added), *more])
        row = first
        for batch in self.table.batches(list(asked) or list(self.table.names[:1]), first):
            rows = len(next(iter(batch.values())))
            columns = batch | {name: np.zeros(rows) for name in self._added}
            if summed:
                force = self._force(batch, row)
                for name in summed:
                    columns[name] = columns[name] + force[:, torque.index(name)]
            yield {name: columns[name] for name in names}
            row += rows

    def _force(self, batch: Mapping[str, Array], row: int) -> Array:
        """Generalised forces of the wrenches, shape (rows, nv); zero where there is no configuration."""
        from casysid.kinematics import Axes

        position = np.column_stack([batch[name] for name in self._positions])
        for name in self._components:
            bad = np.flatnonzero(~np.isfinite(batch[name]))
            if len(bad):
                raise RecordingError(
                    f"{self.source}: column '{name}' has {len(bad)} values that are no finite numbers, the first at "
                    f"{self.table.place(row + int(bad[0]))}; leave these rows out"
                )
        total = np.zeros((len(position), self.robot.nv))
        good = _has_configuration(self.robot, position)
        if good.any():
            q = configuration_from_channels(self.robot, position[good])
            for wrench in self.wrenches:
                axes = Axes.WORLD if wrench.in_world else Axes.FRAME
                none = np.zeros(len(position))
                w = np.column_stack([none if name is None else batch[name] for name in wrench.columns])[good]
                total[good] += np.einsum("nij,ni->nj", self._kinematics.jacobians(wrench.frame, q, axes), w)
        return total

    @cached_property
    def _kinematics(self) -> Kinematics:
        from casysid.kinematics import Kinematics

        return Kinematics(self.robot)

    @cached_property
    def _spelling(self) -> str:
        """How the log spells torques."""
        there = set(self.table.names)
        return next((word for word in TORQUE.named if f"{word}_{self.robot.dofs[-1]}" in there), TORQUE.named[0])

    @cached_property
    def _positions(self) -> tuple[str, ...]:
        """Columns of the channels' positions; empty where the log has numbers instead of names."""
        there = set(self.table.names)
        for word in POSITION.named:
            names = tuple(f"{word}_{channel}" for channel in self.robot.channels)
            if there.issuperset(names):
                return names
        raise RecordingError(
            f"{self.source}: wrenches need positions by name, q_<channel>: {listing(self.robot.channels)}; "
            f"found {listing(self.table.names)}"
        )

    @cached_property
    def _components(self) -> tuple[str, ...]:
        return tuple(name for wrench in self.wrenches for name in wrench.columns if name is not None)

    @cached_property
    def _added(self) -> tuple[str, ...]:
        """Torques of the base, if the log has those of joints by name and none of the base."""
        base, there = base_dofs(self.robot), set(self.table.names)
        own = tuple(f"{self._spelling}_{dof}" for dof in self.robot.dofs[base]) if base is not None else ()
        joints = [f"{self._spelling}_{dof}" for dof in self.robot.dofs if f"{self._spelling}_{dof}" not in own]
        is_named = there.issuperset(joints) if joints else f"{POSITION.named[0]}_{self.robot.channels[0]}" in there
        return own if is_named and not there.intersection(own) else ()


def _has_configuration(robot: Robot, position: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Where positions are finite and no quaternion is zero; what is wrong elsewhere is told by those who check it."""
    good = np.isfinite(position).all(axis=1)
    for joint in robot.joints:
        if joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER):
            part = position[:, joint.channels.stop - 4 : joint.channels.stop]
            good &= np.any(part != 0.0, axis=1)
    return np.asarray(good)

"""Logs of robots whose base is free: wrenches at frames, contacts, and a base that no motor drives.

The equations of such a robot are ``Y θ = Sᵀ τ + Σ J_fᵀ w_f``: the joints' torques, and the wrenches that the world
applies at frames. The right side is what is measured, so it is put in the place of the torques, sample by sample, and
all that follows is as for any other robot. Columns beside those of every log:

========================================= =============================================================
``fx_<frame> … fz_<frame>``                force of the world on the robot at the frame's origin [N]
``mx_<frame> … mz_<frame>``                its moment about the frame's origin [N m]
``world_fx_<frame> … world_mz_<frame>``    the same along the world's axes; without ``world_`` the frame's own
``contact_<frame>``                        1 while the frame touches the world, 0 else
========================================= =============================================================

Components that are not there are zero. Torques of the free base need no columns: they are zero. Where no joint has a
torque the rows of the base are left, and where a frame touches without a wrench the rows that its force does not enter
(:mod:`casysid.floating`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.candidates import POSITION, TORQUE, Labels, read_names, usual_by_number
from casysid.readers.columns import Layout
from casysid.readers.messages import listing
from casysid.readers.table import Table
from casysid.readers.wrench_columns import WrenchColumns, find_contacts, find_wrenches
from casysid.robot import JointKind, Robot
from casysid.robot.coordinates import configuration_from_channels

if TYPE_CHECKING:
    from casysid.kinematics import Kinematics


def base_dofs(robot: Robot) -> slice | None:
    """Places in v of a free base; None where the base is fixed."""
    first = robot.joints[0]
    return first.v if first.kind is JointKind.FREE_FLYER else None


def with_generalised_forces(table: Table, robot: Robot, source: str) -> Table:
    """The table with generalised forces as torques, for a robot with a free base; else the very table.

    Raises:
        RecordingError: A wrench or a contact names a frame that the robot has not, or nothing says what moves it.
    """
    base = base_dofs(robot)
    if base is None:
        return table
    wrenches, contacts = find_wrenches(table.names, robot, source), find_contacts(table.names, robot, source)
    measured = {wrench.frame for wrench in wrenches}
    unknown = tuple((frame, column) for frame, column in contacts.items() if frame not in measured)
    table = GeneralisedTable(table, robot, wrenches, unknown, tuple(contacts.values()), source)
    if table.silent:
        table.require_forces()
    return table


@dataclass(frozen=True)
class GeneralisedTable:
    """A table whose torque columns are generalised forces.

    Attributes:
        table: The log.
        robot: Whose base is free.
        wrenches: In the log.
        contacts: Frames that touch with unknown wrenches, each with its column.
        flags: All columns of contact flags.
        source: For messages.
        placed: Columns of the channels' positions, once they are known.
        timed: Whether the samples follow each other in time.
        turned: Number of samples whose base quaternion was turned to the sign of the one before, in the last reading.
    """

    table: Table
    robot: Robot
    wrenches: tuple[WrenchColumns, ...]
    contacts: tuple[tuple[str, str], ...]
    flags: tuple[str, ...]
    source: str
    placed: tuple[str, ...] = ()
    timed: bool = False
    turned: list[int] = field(default_factory=lambda: [0], compare=False)

    @property
    def names(self) -> tuple[str, ...]:
        """The log's columns, and those of torques where it has none."""
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

    def completed(self, layout: Layout) -> tuple[GeneralisedTable, Layout]:
        """The layout with contacts, wrenches and torques that nobody measured, and the table that fits it."""
        layout = dataclasses.replace(
            layout,
            contacts=self.contacts,
            wrenches=tuple(wrench.frame for wrench in self.wrenches),
            unmeasured=(*layout.unmeasured, *self._silent_columns),
        )
        return dataclasses.replace(self, placed=layout.position, timed=layout.clock is not None), layout

    @cached_property
    def silent(self) -> bool:
        """Whether the log has no torque of any joint, under any name."""
        joints = [f"{word}_{dof}" for word in TORQUE.named for dof in self.robot.dofs]
        if set(joints) & set(self.table.names) or len(self.robot.dofs) == len(self._base):
            return False
        names = self.table.names, self.robot.channels, self.robot.dofs
        read = [*read_names(*names, self.table.labels), *usual_by_number(TORQUE, names[0], len(names[2]), self.source)]
        return not any(one.quantity in ("torque", "current") and one.columns for one in read)

    def require_forces(self) -> None:
        """Nothing, if wrenches say what moves a robot without torques.

        Raises:
            RecordingError: They do not.
        """
        joints = [dof for dof in self.robot.dofs if dof not in self._base]
        if self.contacts:
            frames = listing([frame for frame, _ in self.contacts])
            raise RecordingError(
                f"{self.source}: no torque of {listing(joints)}, and contacts without a wrench ({frames}): no equation "
                "is left in which all forces are known. Log the joints' torques (tau_<joint>) or the wrenches "
                "(fx_<frame> ... mz_<frame>)"
            )
        if not self.wrenches:
            raise RecordingError(
                f"{self.source}: neither torques (tau_<joint>: {listing(joints)}) nor wrenches (fx_<frame> ... "
                "mz_<frame>); one of them must be there, as motion alone tells no mass. Found: "
                f"{listing(self.table.names)}"
            )

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[dict[str, Array]]:
        """Columns as float64, torques with what the wrenches do to them, quaternions without jumps of their sign.

        Raises:
            RecordingError: A wrench is not finite, or a flag neither 0 nor 1.
        """
        torque = [f"{self._spelling}_{dof}" for dof in self.robot.dofs]
        summed = [name for name in names if name in torque] if self.wrenches else []
        more = [*self._positions, *self._components, *self.flags] if summed else []
        asked = dict.fromkeys([*(name for name in names if name not in self._added), *more])
        row, last = first, np.empty(0)
        self.turned[0] = 0
        for batch in self.table.batches(list(asked) or list(self.table.names[:1]), first):
            rows = len(next(iter(batch.values())))
            columns = batch | {name: np.zeros(rows) for name in self._added}
            self._check_flags({name: batch[name] for name in self.flags if name in batch}, row)
            if summed:
                force = self._force(batch, row)
                for name in summed:
                    columns[name] = columns[name] + force[:, torque.index(name)]
            if self._quaternion and set(self._quaternion) <= set(columns):
                logged = np.column_stack([columns[name] for name in self._quaternion])
                continued = continued_signs(logged, last)
                self.turned[0] += int(np.count_nonzero(np.sum(logged * continued, axis=1) < 0.0))
                last = continued[-1] if len(continued) else last
                columns |= dict(zip(self._quaternion, continued.T, strict=True))
            yield {name: columns[name] for name in names}
            row += rows

    def _check_flags(self, flags: Mapping[str, Array], row: int) -> None:
        for name, values in flags.items():
            bad = np.flatnonzero((values != 0.0) & (values != 1.0))
            if len(bad):
                raise RecordingError(
                    f"{self.source}: column '{name}' must be 1 while the frame touches the world and 0 else; got "
                    f"{values[bad[0]]:g} at {self.table.place(row + int(bad[0]))}"
                )

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
    def _base(self) -> tuple[str, ...]:
        base = base_dofs(self.robot)
        return () if base is None else tuple(self.robot.dofs[base])

    @cached_property
    def _spelling(self) -> str:
        """How the log spells torques."""
        there = set(self.table.names)
        return next((word for word in TORQUE.named if f"{word}_{self.robot.dofs[-1]}" in there), TORQUE.named[0])

    @cached_property
    def _positions(self) -> tuple[str, ...]:
        """Columns of the channels' positions; empty where the log has numbers instead of names."""
        if self.placed:
            return self.placed
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
    def _quaternion(self) -> tuple[str, ...]:
        """Columns of the base's, whose signs may be mended; none before positions are known, or without time."""
        return self.placed[self.robot.joints[0].channels][-4:] if self.timed else ()

    @cached_property
    def _components(self) -> tuple[str, ...]:
        return tuple(name for wrench in self.wrenches for name in wrench.columns if name is not None)

    @cached_property
    def _silent_columns(self) -> tuple[str, ...]:
        """Of torques that nobody measured."""
        return tuple(name for name in self._added if name.removeprefix(f"{self._spelling}_") not in self._base)

    @cached_property
    def _added(self) -> tuple[str, ...]:
        """Torques of the base, if the log has those of joints by name and none of the base; all, if it has none."""
        there = set(self.table.names)
        own = tuple(f"{self._spelling}_{dof}" for dof in self._base)
        joints = [f"{self._spelling}_{dof}" for dof in self.robot.dofs if f"{self._spelling}_{dof}" not in own]
        if self.silent:
            return (*own, *joints)
        is_named = there.issuperset(joints) if joints else f"{POSITION.named[0]}_{self.robot.channels[0]}" in there
        return own if is_named and not there.intersection(own) else ()


def continued_signs(quaternions: Array, last: Array) -> Array:
    """The same orientations, each quaternion on the side of the one before it, ``q`` and ``-q`` being one.

    Args:
        quaternions: Shape (N, 4).
        last: The one before the first, shape (4,), or empty.
    """
    if not len(quaternions):
        return quaternions
    before = quaternions[:1] if not len(last) else last[None]
    away = np.sum(quaternions * np.concatenate([before, quaternions[:-1]]), axis=1) < 0.0
    # the first is held against one whose sign is settled, all others against a logged one
    return np.asarray(quaternions * np.where(np.cumsum(away) % 2 == 1, -1.0, 1.0)[:, None])


def _has_configuration(robot: Robot, position: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Where positions are finite and no quaternion is zero; what is wrong elsewhere is told by those who check it."""
    good = np.isfinite(position).all(axis=1)
    for joint in robot.joints:
        if joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER):
            part = position[:, joint.channels.stop - 4 : joint.channels.stop]
            good &= np.any(part != 0.0, axis=1)
    return np.asarray(good)

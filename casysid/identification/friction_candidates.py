"""Columns of friction and transmission that a robot's joints may turn out to need, beside those of every joint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import (
    PHYSICAL_KINDS,
    Armature,
    Coulomb,
    Coupling,
    Direction,
    FrictionKind,
    FrictionModel,
    JointUse,
    Viscous,
)
from casysid.dynamics.friction import coupling_direction, joint_directions
from casysid.dynamics.friction.wave_numbers import ripple_wave_numbers
from casysid.robot import JointKind, Robot

SIMPLE_JOINTS = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)
COUPLED = (Viscous.kind, Coulomb.kind, Armature.kind), (Viscous.kind, Coulomb.kind), (Armature.kind,)
"""What a transmission between two joints may bring."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """One candidate as kinds of friction along directions.

    Attributes:
        name: Of proposals with the same name at most one is taken.
        kind: Of friction, or ``coupling``.
        columns: Kinds of friction, each with where it acts.
        joints: Degrees of freedom on which they act.
        coupling: The transmission, if it is one.
    """

    name: str
    kind: str
    columns: tuple[tuple[FrictionKind, Direction], ...]
    joints: tuple[int, ...]
    coupling: Coupling | None = None

    @property
    def family(self) -> str:
        """The kind where it comes from how a drive is built, so that a robot's other drives may have it too."""
        return self.kind if self.coupling is None and self.columns[0][0].by_design else ""

    @property
    def description(self) -> str:
        """What a person calls it, with the numbers that enter nonlinearly."""
        kind, direction = self.columns[0]
        if self.coupling is None:
            return kind.describe(direction)
        return f"coupled as {direction.name} by {', '.join(one.kind for one, _ in self.columns)}"


def propose(
    robot: Robot,
    friction: Sequence[FrictionKind],
    couplings: Sequence[Coupling],
    uses: Mapping[int, JointUse],
    kinds: Sequence[type[FrictionKind]] = PHYSICAL_KINDS,
) -> tuple[Proposal, ...]:
    """Everything that may join the given friction and couplings of a robot.

    Args:
        robot: Its joints with one degree of freedom are looked at.
        friction: What every joint has already; kinds of it are not proposed again.
        couplings: Transmissions that are known already.
        uses: How degrees of freedom move, by their index; those that stand get no proposal.
        kinds: Of friction that are asked for candidates.
    """
    known = {kind.kind for kind in friction}
    moving = {
        dof: use
        for dof, use in uses.items()
        if use.speed > 0.0 and robot.joints[joint_of(robot, dof)].kind in SIMPLE_JOINTS
    }
    alone = [
        Proposal(f"{use.direction.name}.{kind.kind}", kind.kind, ((one, use.direction),), (dof,))
        for dof, use in moving.items()
        for kind in kinds
        if kind.kind not in known
        for one in kind.candidates(use)
    ]
    return (*alone, *_transmissions(robot, friction, couplings, moving))


def joint_uses(robot: Robot, speed: Array, width: Array, travel: Array | None = None) -> dict[int, JointUse]:
    """How every driven degree of freedom moves, by its index; ripple is not looked for.

    Args:
        robot: The robot.
        speed: Root mean square velocity of each degree of freedom, shape (nv,).
        width: Of each one's smooth sign, shape (nv,).
        travel: Standard deviation of its position, shape (nv,); None where it is not known.
    """
    return {
        dof: JointUse(direction, float(speed[dof]), float(width[dof]), None if travel is None else float(travel[dof]))
        for dof, direction in joint_directions(robot).items()
    }


def with_ripples(
    uses: Mapping[int, JointUse], position: Array, velocity: Array, residual: Array, band: float
) -> dict[int, JointUse]:
    """The uses with the wave numbers that a residual torque shows.

    Args:
        uses: How degrees of freedom move, by their index.
        position: Of every degree of freedom, samples in order of time, shape (N, nv).
        velocity: Shape (N, nv).
        residual: Torque that a first model leaves, shape (N, nv).
        band: Up to which the equations hold [Hz]: faster waves at the usual speed are not seen.
    """
    found = dict(uses)
    for dof, use in uses.items():
        if use.speed > 0.0:
            s, r, highest = position[:, dof], residual[:, dof], 2.0 * np.pi * band / use.speed
            ripple, dry = (
                ripple_wave_numbers(s, one, highest, unlimited=use.direction.unlimited)
                for one in (r, r * np.tanh(velocity[:, dof] / use.width))
            )
            found[dof] = replace(use, ripple=ripple, friction_ripple=dry)
    return found


def joined(friction: Sequence[FrictionKind], couplings: Sequence[Coupling], taken: Sequence[Proposal]) -> FrictionModel:
    """Friction and couplings with the proposals that were taken, all joints of a kind in one."""
    alone = [kind for one in taken if one.coupling is None for kind, _ in one.columns]
    coupled = [one.coupling for one in taken if one.coupling is not None]
    return FrictionModel(tuple(friction), tuple(couplings)).joined_by(alone, coupled)


def _transmissions(
    robot: Robot,
    friction: Sequence[FrictionKind],
    couplings: Sequence[Coupling],
    moving: Mapping[int, JointUse],
) -> Iterator[Proposal]:
    """Motors that turn with the sum or the difference of two neighbouring joints of the same kind of motion."""
    taken = [set(coupling.joints) for coupling in couplings]
    for first, second in _neighbours(robot, moving):
        one, other = moving[first].direction, moving[second].direction
        names = (one.name, other.name)
        if set(names) in taken or one.linear != other.linear:
            continue
        for sign in (1.0, -1.0):
            for wanted in COUPLED:
                kinds = [kind for kind in friction if kind.kind in wanted]
                if len(kinds) < len(wanted):
                    continue
                coupling = Coupling(names, (1.0, sign), tuple(kind.kind for kind in kinds))
                direction = coupling_direction(robot, coupling)
                own = {direction.name: moving[first].width + moving[second].width}
                columns = tuple((kind.with_width(own), direction) for kind in kinds)
                yield Proposal("+".join(names), "coupling", columns, (first, second), coupling)


def _neighbours(robot: Robot, moving: Mapping[int, JointUse]) -> Iterator[tuple[int, int]]:
    for joint in robot.joints:
        if joint.parent >= 0:
            first, second = robot.joints[joint.parent].v.start, joint.v.start
            if first in moving and second in moving:
                yield first, second


def joint_of(robot: Robot, dof: int) -> int:
    """Index of the joint that has a degree of freedom."""
    return next(k for k, joint in enumerate(robot.joints) if joint.v.start <= dof < joint.v.stop)

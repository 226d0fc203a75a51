"""Columns of friction and transmission that a robot's joints may turn out to need, beside those of every joint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from casysid.arrays import Array
from casysid.dynamics import (
    Armature,
    AsymmetricViscous,
    Coulomb,
    Coupling,
    Direction,
    FrictionColumn,
    LoadedCoulomb,
    PowerViscous,
    Spring,
    Stribeck,
    Viscous,
)
from casysid.dynamics.friction import coupling_direction, joint_directions
from casysid.robot import JointKind, Robot

STRIBECK_VELOCITIES = (0.05, 0.15, 0.4, 1.0)
"""Candidates, in root mean square velocities of the joint."""
EXPONENTS = (0.5, 2.0, 3.0)
"""Candidates of viscous friction's power, beside one."""
SIMPLE_JOINTS = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)
COUPLED = (Viscous, Coulomb, Armature), (Viscous, Coulomb), (Armature,)
"""What a transmission between two joints may bring."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """One candidate as columns along directions.

    Attributes:
        name: Of proposals with the same name at most one is taken.
        kind: Of friction, or ``coupling``.
        columns: Each with where it acts.
        joints: Degrees of freedom on which they act.
        coupling: The transmission, if it is one.
    """

    name: str
    kind: str
    columns: tuple[tuple[FrictionColumn, Direction], ...]
    joints: tuple[int, ...]
    coupling: Coupling | None = None

    @property
    def family(self) -> str:
        """The kind where it comes from how a drive is built, so that a robot's other drives may have it too."""
        return self.kind if self.kind in (Stribeck.kind, PowerViscous.kind, LoadedCoulomb.kind) else ""


def propose(
    robot: Robot, friction: Sequence[FrictionColumn], couplings: Sequence[Coupling], speed: Array, width: Array
) -> tuple[Proposal, ...]:
    """Everything that may join the given friction and couplings of a robot.

    Args:
        robot: Its joints with one degree of freedom are looked at.
        friction: What every joint has already; kinds of it are not proposed again.
        couplings: Transmissions that are known already.
        speed: Root mean square velocity of each degree of freedom, shape (nv,); those that stand get no proposal.
        width: Of each one's smooth sign, shape (nv,).
    """
    known = {column.kind for column in friction}
    moving = {
        dof: direction
        for dof, direction in joint_directions(robot).items()
        if speed[dof] > 0.0 and robot.joints[joint_of(robot, dof)].kind in SIMPLE_JOINTS
    }
    widths = tuple(width.tolist())
    alone = [
        Proposal(f"{direction.name}.{column.kind}", column.kind, ((column, direction),), (dof,))
        for dof, direction in moving.items()
        for column in _columns_of_a_joint(robot, dof, direction, float(speed[dof]), widths)
        if column.kind not in known
    ]
    return (*alone, *_transmissions(robot, friction, couplings, moving, widths))


def _columns_of_a_joint(
    robot: Robot, dof: int, direction: Direction, speed: float, width: tuple[float, ...]
) -> Iterator[FrictionColumn]:
    name = direction.name
    yield AsymmetricViscous((name,))
    for share in STRIBECK_VELOCITIES:
        if share * speed > width[dof]:
            yield Stribeck(width, {name: share * speed})
    for exponent in EXPONENTS:
        yield PowerViscous(width, {name: exponent})
    yield LoadedCoulomb(width, (name,))
    if robot.joints[joint_of(robot, dof)].kind is not JointKind.CONTINUOUS:
        yield Spring((name,))


def _transmissions(
    robot: Robot,
    friction: Sequence[FrictionColumn],
    couplings: Sequence[Coupling],
    moving: Mapping[int, Direction],
    width: tuple[float, ...],
) -> Iterator[Proposal]:
    """Motors that turn with the sum or the difference of two neighbouring joints of the same kind of motion."""
    taken = [set(coupling.joints) for coupling in couplings]
    for first, second in _neighbours(robot, moving):
        names = (moving[first].name, moving[second].name)
        if set(names) in taken or moving[first].linear != moving[second].linear:
            continue
        for sign in (1.0, -1.0):
            for kinds in COUPLED:
                columns = [column for column in friction if isinstance(column, kinds)]
                if len(columns) < len(kinds):
                    continue
                coupling = Coupling(names, (1.0, sign), tuple(column.kind for column in columns))
                direction = coupling_direction(robot, coupling)
                made = tuple((Coulomb(width) if isinstance(one, Coulomb) else one, direction) for one in columns)
                yield Proposal("+".join(names), "coupling", made, (first, second), coupling)


def _neighbours(robot: Robot, moving: Mapping[int, Direction]) -> Iterator[tuple[int, int]]:
    for joint in robot.joints:
        if joint.parent >= 0:
            first, second = robot.joints[joint.parent].v.start, joint.v.start
            if first in moving and second in moving:
                yield first, second


def joint_of(robot: Robot, dof: int) -> int:
    """Index of the joint that has a degree of freedom."""
    return next(k for k, joint in enumerate(robot.joints) if joint.v.start <= dof < joint.v.stop)

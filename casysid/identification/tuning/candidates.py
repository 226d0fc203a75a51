"""One set of moments with every column that may be asked for, from which each smaller model is read off."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pinocchio as pin

from casysid.dynamics import (
    PHYSICAL_KINDS,
    Armature,
    Direction,
    DriveState,
    FrictionColumn,
    FrictionKind,
    JointUse,
    LoadedCoulomb,
    MaxwellSlip,
    Parameter,
    Regressor,
    SharpCoulomb,
    build_regressor,
    extend_regressor,
    with_width,
)
from casysid.dynamics.friction import joint_directions
from casysid.identification.friction_candidates import Proposal, joined, joint_uses, propose
from casysid.identification.passes import Passes
from casysid.identification.settings import Settings
from casysid.identification.tuning.drive_gains import scaled
from casysid.moments import Indices, Moments
from casysid.robot import Robot

DISPLACEMENTS = (0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
"""Of the elements of friction before sliding, in standard deviations of the position, half a decade apart. They go down
to where an element turns as sharply as a step, at the reversal of the position and not of a smoothed velocity. Whole
decades left twice the error where friction has its way before sliding."""
SHARPER = 10.0
"""Width of the usual smooth sign over that of the sharp one: a decade."""
CLEAR_OF_NOISE = 3.0
"""Standard deviations of the smoothed positions' noise that an element must be wide: a narrower one turns with it."""
POSES = 100
"""Of a recording in which it is asked which joints gravity loads."""
ROUNDING = 1e-9
"""Of the most loaded joint's torque: less is the arithmetic's."""


@dataclass(frozen=True)
class FileGravity(FrictionColumn):
    """What the model file's own bodies ask for at rest: no friction, but a column to test clocks by."""

    kind: ClassVar[str] = "file_gravity"
    is_friction: ClassVar[bool] = False

    def unit(self, direction: Direction) -> str:
        """None."""
        return "1"

    def torque(self, direction: Direction, state: DriveState) -> Any:
        """Of the file's parameters."""
        return state.static_torque(None)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Moments of the usual model, of what may join it, and of the file's gravity.

    Attributes:
        base: The usual model.
        regressor: Of all columns, those of ``base`` first.
        moments: Of ``regressor``.
        proposals: What may join, with the columns of each.
        gravity: Columns of the file's gravity by degree of freedom; only of those that have one.
    """

    base: Regressor
    regressor: Regressor
    moments: Moments
    proposals: tuple[tuple[Proposal, tuple[int, ...]], ...]
    gravity: dict[int, int]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Of all columns."""
        return self.regressor.parameters

    def model(self, taken: Sequence[tuple[int, ...]] = ()) -> Indices:
        """Columns of the usual model with some proposals'."""
        return np.array([*range(len(self.base.names)), *(column for columns in taken for column in columns)])


def usual_friction(passes: Passes, settings: Settings) -> tuple[FrictionKind, ...]:
    """The friction asked for; and where the data may choose, sharp and loaded dry friction and that before sliding.

    These cost next to nothing where they are not, since an estimator that weighs groups leaves a whole kind out.
    """
    width: Any = settings.coulomb_width or tuple(passes.width.tolist())
    friction = with_width(settings.friction, width)
    if passes.band.cutoff is None or not settings.choose_friction:
        return friction
    directions, single, smallest = joint_directions(passes.robot), _single(passes), CLEAR_OF_NOISE * passes.noise
    clear = {
        directions[dof].name: [
            share * passes.travel[dof] for share in DISPLACEMENTS if share * passes.travel[dof] > smallest[dof]
        ]
        for dof in directions
        if dof in single
    }
    displacements = {name: tuple(several) for name, several in clear.items() if several}
    usual: list[FrictionKind] = [SharpCoulomb(tuple((passes.width / SHARPER).tolist()))]
    if loaded := [directions[dof].name for dof in _loaded(passes) if dof in directions]:
        usual.append(LoadedCoulomb(width, tuple(loaded)))
    if displacements:
        usual.append(MaxwellSlip(displacements))
    there = [one.kind for one in friction]
    return (*friction, *(one for one in usual if one.kind not in there))


def gather_candidates(passes: Passes, settings: Settings, uses: Mapping[int, JointUse] | None = None) -> Candidates:
    """One pass over the recordings with all columns.

    Args:
        passes: Over what is fitted.
        settings: Its friction and couplings are the usual model's.
        uses: How the joints move; None takes it from the passes.
    """
    columns = _columns(passes, settings, uses)
    return Candidates(moments=passes.moments(columns.regressor), **columns._asdict())


def with_torque_gains(
    candidates: Candidates, passes: Passes, settings: Settings, uses: Mapping[int, JointUse] | None = None
) -> Candidates:
    """The same for other gains of the joints' torques, without a pass; ``settings`` as they were but for these."""
    columns, moments = _columns(passes, settings, uses), candidates.moments
    before, after = (one.template.sensing.gains for one in (candidates.regressor, columns.regressor))
    dofs = [passes.robot.dofs.index(moments.joints[row]) for row in moments.moving_rows]
    factors = np.array(after)[dofs] / np.array(before)[dofs]
    return Candidates(moments=scaled(moments, factors), **columns._asdict())


class _Columns(NamedTuple):
    """All of :class:`Candidates` but the moments."""

    base: Regressor
    regressor: Regressor
    proposals: tuple[tuple[Proposal, tuple[int, ...]], ...]
    gravity: dict[int, int]


def _columns(passes: Passes, settings: Settings, uses: Mapping[int, JointUse] | None = None) -> _Columns:
    robot, friction = passes.robot, usual_friction(passes, settings)
    base = build_regressor(
        robot,
        friction=friction,
        couplings=settings.couplings,
        quasi_static=bool(settings.quasi_static),
        torque_gains=settings.torque_gains,
    )
    asked = settings.choose_friction and passes.band.cutoff is not None
    uses = uses or joint_uses(robot, passes.speed, passes.width, passes.travel)
    proposals = _proposals(robot, settings, friction, uses) if asked else ()
    directions = joint_directions(robot) if passes.band.cutoff is not None else {}
    gravity = [(FileGravity(), directions[dof]) for dof in directions]
    additions = [*gravity, *(column for proposal in proposals for column in proposal.columns)]
    regressor = extend_regressor(base, additions) if additions else base
    first = len(base.names) + len(gravity)
    return _Columns(
        base,
        regressor,
        tuple(_with_columns(proposals, regressor, len(base.parts) + len(gravity), first)),
        {dof: len(base.names) + k for k, dof in enumerate(directions)},
    )


def _with_columns(
    proposals: Sequence[Proposal], regressor: Regressor, part: int, first: int
) -> list[tuple[Proposal, tuple[int, ...]]]:
    """Each proposal with its columns, which follow each other from ``first``, those of part number ``part``."""
    found = []
    for proposal in proposals:
        count = sum(len(one.columns) for one in regressor.parts[part : part + len(proposal.columns)])
        found.append((proposal, tuple(range(first, first + count))))
        part, first = part + len(proposal.columns), first + count
    return found


def _proposals(
    robot: Robot, settings: Settings, friction: Sequence[FrictionKind], uses: Mapping[int, JointUse]
) -> tuple[Proposal, ...]:
    kinds = tuple(kind for kind in PHYSICAL_KINDS if kind is not MaxwellSlip)
    proposals = propose(robot, friction, settings.couplings, uses, kinds)
    if not settings.quasi_static:
        return proposals
    return tuple(one for one in proposals if Armature.kind not in [kind.kind for kind, _ in one.columns])


def _loaded(passes: Passes) -> list[int]:
    """Degrees of freedom that the file's bodies load by their weight; that of all others is rounding."""
    model, data = passes.robot.model, passes.robot.model.createData()
    largest = np.zeros(passes.robot.nv)
    for motion in passes.sparse_motions:
        for q in motion.q[:: max(1, len(motion.q) // POSES)]:
            largest = np.maximum(largest, np.abs(pin.computeGeneralizedGravity(model, data, q)))
    return np.flatnonzero(largest > ROUNDING * largest.max(initial=0.0)).tolist()


def _single(passes: Passes) -> set[int]:
    """Degrees of freedom that are joints of their own."""
    return {joint.v.start for joint in passes.robot.joints if joint.v.stop - joint.v.start == 1}


def final_regressor(candidates: Candidates, settings: Settings, taken: Sequence[Proposal]) -> Regressor:
    """The usual model with the proposals that were taken, each kind of friction once."""
    model = joined(candidates.base.friction, settings.couplings, taken)
    return build_regressor(
        candidates.base.robot,
        friction=model.columns,
        couplings=model.couplings,
        quasi_static=bool(settings.quasi_static),
        torque_gains=settings.torque_gains,
    )


def moments_of(
    regressor: Regressor, candidates: Candidates, taken: Sequence[tuple[Proposal, tuple[int, ...]]]
) -> Moments:
    """The moments of a final regressor, read off those of all candidates."""
    columns = candidates.model([places for _, places in taken])
    by_name = {candidates.parameters[column].name.split(" #")[0]: int(column) for column in columns}
    moments = candidates.moments.select_columns([by_name[name] for name in regressor.names])
    return dataclasses.replace(moments, columns=regressor.names)

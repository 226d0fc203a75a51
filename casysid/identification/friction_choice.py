"""Kinds of friction and transmission chosen by the data, joint by joint.

All candidates share one pass over the data: their columns stand side by side in one set of moments, from which every
smaller model is read off.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import Armature, extend_regressor
from casysid.identification.friction_candidates import Proposal, joined, joint_uses, propose
from casysid.identification.friction_evidence import Candidate, Finding, build_evidence, choose_candidates
from casysid.identification.friction_laws import physics_rows
from casysid.identification.problem import (
    MOTION_TO_TORQUE_BAND,
    Mask,
    coulomb_width,
    make_motions,
    regressor_for,
    sum_moments,
)
from casysid.identification.settings import Settings
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import smoothing_cutoff


@dataclass(frozen=True)
class ChosenFriction:
    """One kind of friction that joined, or one coupling.

    Attributes:
        joints: On which it acts.
        kind: Of friction; ``coupling`` for a transmission.
        words: What a person calls it, with its numbers.
        error_before: Held-out torque error of its joints in cross-validation, relative to their torque, without it.
        error_after: And with it.
    """

    joints: tuple[str, ...]
    kind: str
    words: str
    error_before: float
    error_after: float

    @property
    def sentence(self) -> str:
        """Such as ``joint_2: Stribeck (v_s = 0.1 rad/s): held-out error 12.0 % → 9.0 %``."""
        change = f"{100.0 * self.error_before:.3g} % → {100.0 * self.error_after:.3g} %"
        return f"{' and '.join(self.joints)}: {self.words}: held-out error {change}"

    def to_json(self) -> dict[str, object]:
        """Plain numbers, lists and words."""
        return {**dataclasses.asdict(self), "joints": list(self.joints)}


@dataclass(frozen=True)
class FrictionChoice:
    """What the data added to the friction that was given.

    Attributes:
        settings: Those given, with the columns and couplings that were chosen.
        chosen: What joined, in the order in which it did.
        asked: How many candidates there were.
    """

    settings: Settings
    chosen: tuple[ChosenFriction, ...] = ()
    asked: int = field(default=0)


def choose_friction(
    robot: Robot,
    recordings: Sequence[Recording],
    cutoff: float | None,
    settings: Settings,
    relative_width: float | Array,
    moving_only: Mask | bool = False,
) -> FrictionChoice:
    """Friction columns and couplings that cross-validation over stretches of time asks for.

    None without time, nor where the positions' noise is so heavy that it would pass for friction of another kind.

    Args:
        robot: The robot.
        recordings: What is fitted.
        cutoff: Of the low-pass [Hz].
        settings: Its friction and couplings are what every choice starts from.
        relative_width: Of the smooth sign, in root mean square velocities.
        moving_only: As for :func:`~casysid.identification.problem.build_problem`.
    """
    if cutoff is None or _any_noisy(recordings, MOTION_TO_TORQUE_BAND * cutoff):
        return FrictionChoice(_with_friction(settings, ()))
    motions = make_motions(robot, recordings, cutoff, settings, moving_only=moving_only, quick=True)
    base = regressor_for(robot, motions, settings, relative_width)
    speed = np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in motions], axis=0))
    width = coulomb_width(motions, relative_width)
    if settings.coulomb_width is not None:
        width = np.full(robot.nv, settings.coulomb_width)
    proposals = propose(robot, settings.friction, settings.couplings, joint_uses(robot, speed, width))
    if settings.quasi_static:
        proposals = tuple(one for one in proposals if Armature.kind not in [column.kind for column, _ in one.columns])
    if not proposals:
        return FrictionChoice(_with_friction(settings, ()))
    regressor = extend_regressor(base, [column for proposal in proposals for column in proposal.columns])
    moments = sum_moments(regressor, motions, cutoff, settings)
    first, candidates = len(base.names), []
    for proposal in proposals:
        columns = tuple(range(first, first + len(proposal.columns)))
        candidates.append(Candidate(proposal.name, columns, proposal.joints, proposal.family))
        first += len(columns)
    evidence = build_evidence(moments, regressor.prior, physics_rows(regressor), len(motions))
    findings = choose_candidates(evidence, range(len(base.names)), candidates)
    taken = [(proposals[candidates.index(finding.candidate)], finding) for finding in findings]
    return FrictionChoice(
        _with_friction(settings, [proposal for proposal, _ in taken]),
        tuple(_chosen(robot, proposal, finding) for proposal, finding in taken),
        len(proposals),
    )


def _any_noisy(recordings: Sequence[Recording], smoothing: float) -> bool:
    """Whether some positions are too noisy to be smoothed as high as usual [Hz]."""
    return any(
        one.time is not None and smoothing_cutoff(one.time, one.position, smoothing) < smoothing for one in recordings
    )


def _with_friction(settings: Settings, taken: Sequence[Proposal]) -> Settings:
    """The settings with what was taken."""
    model = joined(settings.friction, settings.couplings, taken)
    return dataclasses.replace(settings, friction=model.columns, couplings=model.couplings, choose_friction=False)


def _chosen(robot: Robot, proposal: Proposal, finding: Finding) -> ChosenFriction:
    joints = tuple(robot.dofs[joint] for joint in proposal.joints)
    return ChosenFriction(joints, proposal.kind, proposal.description, finding.error_before, finding.error_after)

"""How much of each joint's torque the model explains, as a controller feels it.

Under computed torque ``ë + K_d ė + K_p e = M̂⁻¹(τ̂ - τ)``: what the model misses of the torque is what feedback has to
supply, and the tracking error is that share of the error of feedback alone. Torque that varies is judged about its
mean: an offset explains a constant, and nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from casysid.arrays import Array
from casysid.errors import SolverError
from casysid.estimation import Ridge
from casysid.estimation.cross_validation import contiguous_folds
from casysid.identification.prediction import TorqueError
from casysid.identification.result import IdentificationResult
from casysid.identification.verdict.criteria import Criterion, Word, names
from casysid.moments import Moments

WHOLE, WHOLE_AT_ALL = 0.2, 0.5
"""Share of all joints' torque that may be missed: accepted, and not rejected."""
JOINT, JOINT_AT_ALL = 0.4, 0.75
"""Share of one joint's varying torque likewise."""
SILENT = 1e-6
"""Share of its own size that torque varies by which was not measured."""
FOLDS = 5
"""Of cross-validation where nothing is held out."""
FELT = "computed torque leaves the missed share of the torque, and of the error of feedback alone, to feedback"


@dataclass(frozen=True)
class Unexplained:
    """What the model misses on data that judge it.

    Attributes:
        result: Of the identification.
    """

    result: IdentificationResult

    @property
    def judge(self) -> TorqueError:
        """On held-out data if there are any."""
        return self.result.held_out or self.result.train

    @cached_property
    def by_joint(self) -> Array:
        """Missed over varying torque, roots of energies, shape (nv,); nan where torque does not vary.

        Without held-out data no less than in cross-validation over blocks of time.
        """
        missed = _missed(self.judge)
        return missed if self.result.held_out else np.fmax(missed, cross_validated(self.result.moments, self.result))

    @cached_property
    def silent(self) -> tuple[str, ...]:
        """Joints whose torque never changes."""
        return tuple(dof for dof, share in zip(self.result.robot.dofs, self.by_joint, strict=True) if np.isnan(share))

    @cached_property
    def set_aside(self) -> tuple[str, ...]:
        """Joints that nothing explains."""
        dofs = self.result.robot.dofs
        return tuple(
            dof for dof, share in zip(dofs, self.by_joint, strict=True) if np.isnan(share) or share > JOINT_AT_ALL
        )

    @cached_property
    def whole(self) -> float:
        """Missed over all torque of the joints that are not set aside."""
        kept = [dof not in self.set_aside for dof in self.result.robot.dofs]
        if not any(kept):
            return float("inf")
        measured, predicted = (np.concatenate(x)[:, kept] for x in (self.judge.measured, self.judge.predictions))
        return float(np.linalg.norm(measured - predicted) / max(float(np.linalg.norm(measured)), 1e-300))


def torque_criteria(unexplained: Unexplained) -> Iterator[Criterion]:
    """Of the whole and of every joint."""
    result, whole = unexplained.result, unexplained.whole
    at_all = whole > WHOLE_AT_ALL
    yield Criterion(
        name="torque missed",
        value=whole,
        limit=WHOLE_AT_ALL if at_all else WHOLE,
        word=Word.REJECTED if at_all else Word.DOUBTFUL,
        reason=f"The model misses {whole:.0%} of the torque, which feedback has to supply. Excite more, and look for "
        "what the model lacks; usable where that is enough.",
        origin=FELT,
    )
    yield from _each_joint(unexplained)
    file = result.file.relative
    error = unexplained.judge.relative
    yield Criterion(
        name="against the model file",
        value=error / file if file > 0.0 else float(error > 0.0),
        limit=float(np.nextafter(1.0, 0.0)),
        word=Word.REJECTED,
        reason=f"The model file's own parameters predict better: {file:.1%} torque error, not {error:.1%}.",
        origin="what is no better than what was there is no improvement",
    )


def _each_joint(unexplained: Unexplained) -> Iterator[Criterion]:
    dofs = unexplained.result.robot.dofs
    rest = 2 * len(unexplained.set_aside) <= len(dofs)
    beside = " It is set aside, and the rest is judged without it: usable for the other joints" if rest else ""
    for dof, share in zip(dofs, unexplained.by_joint, strict=True):
        silent, lost = np.isnan(share), dof in unexplained.set_aside
        found = (
            f"Torque of {dof} never changes: was it measured"
            if silent
            else f"Torque of {dof} is not explained, {share:.0%} of its variation is missed: is it of this motion"
            if lost
            else f"Torque of {dof}: {share:.0%} of its variation is missed. A controller of it leans on feedback"
        )
        yield Criterion(
            name="torque missed",
            joint=dof,
            value=float("inf") if silent else float(share),
            limit=JOINT_AT_ALL if lost else JOINT,
            word=Word.REJECTED if lost and not rest else Word.DOUBTFUL,
            reason=f"{found}{'?' if lost else ''}{beside if lost else ''}{'' if lost and not rest else '.'}",
            origin=FELT,
        )


def _missed(error: TorqueError) -> Array:
    measured, predicted = np.concatenate(error.measured), np.concatenate(error.predictions)
    varying = np.sqrt(np.sum((measured - measured.mean(axis=0)) ** 2, axis=0))
    size = np.maximum(np.linalg.norm(measured, axis=0), 1e-300)
    missed = np.linalg.norm(measured - predicted, axis=0) / np.maximum(varying, 1e-300)
    return np.asarray(np.where(varying > SILENT * size, missed, np.nan))


def cross_validated(moments: Moments, result: IdentificationResult) -> Array:
    """What blocks of time predicted from the others miss of each joint's varying torque, shape (nv,)."""
    moving = moments.away_from_rest()
    folds, prior = contiguous_folds(moving.blocks, FOLDS), result.regressor.prior
    missed = np.zeros(len(moving.joints))
    for fold in folds:
        training = moving.select_blocks(np.setdiff1d(np.arange(moving.blocks), fold))
        try:
            found = Ridge(standard_errors=False).estimate(training, prior).parameters
        except SolverError:
            return np.full(len(missed), np.inf)
        missed += moving.select_blocks(fold).residual_energy(found).sum(axis=0)
    return np.sqrt(missed / np.maximum(_varying_energy(moving, result), 1e-300))


def _varying_energy(moments: Moments, result: IdentificationResult) -> Array:
    """Of each joint's torque about its mean, shape (joints,); about zero where the model has no offset."""
    energy, count = moments.target_energy().sum(axis=0), moments.count.sum(axis=0)
    offsets = {one.owner: k for k, one in enumerate(result.regressor.parameters) if one.kind == "offset"}
    for joint, dof in enumerate(moments.joints):
        own, squares = moments.of_joint(joint)
        place = np.flatnonzero(own == offsets.get(dof, -1))
        if len(place) and count[joint]:
            column = squares.sum(axis=0)[place[0]]
            if column[place[0]] > 0.0:
                energy[joint] -= column[-1] ** 2 / column[place[0]]
    return np.maximum(energy, 0.0)


def named(unexplained: Unexplained) -> str:
    """Joints that are set aside."""
    return names(unexplained.set_aside)

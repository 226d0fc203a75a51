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
from casysid.identification.aside import SILENT, UNEXPLAINED, missed_on_blocks
from casysid.identification.prediction import TorqueError
from casysid.identification.result import IdentificationResult
from casysid.identification.verdict.criteria import Criterion, Word

WHOLE, WHOLE_AT_ALL = 0.2, 0.5
"""Share of all joints' torque that may be missed: accepted, and not rejected."""
JOINT = 0.4
"""Share of one joint's varying torque that may be missed."""
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
        if self.result.held_out:
            return missed
        return np.asarray(np.fmax(missed, missed_on_blocks(self.result.moments, self.result.regressor)))

    @cached_property
    def silent(self) -> tuple[str, ...]:
        """Joints whose torque never changes."""
        return tuple(dof for dof, share in zip(self.result.robot.dofs, self.by_joint, strict=True) if np.isnan(share))

    @cached_property
    def set_aside(self) -> tuple[str, ...]:
        """Joints that nothing explains."""
        dofs = self.result.robot.dofs
        return tuple(
            dof for dof, share in zip(dofs, self.by_joint, strict=True) if np.isnan(share) or share > UNEXPLAINED
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
    reason = (
        f"The model misses {whole:.0%} of the torque, which feedback has to supply. Excite more, and look for what the "
        "model lacks; usable where that is enough."
        if np.isfinite(whole)
        else "Nothing explains these torques in any joint."
    )
    yield Criterion(
        name="torque missed",
        value=whole,
        limit=WHOLE_AT_ALL if at_all else WHOLE,
        word=Word.REJECTED if at_all else Word.DOUBTFUL,
        reason=reason,
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
            limit=UNEXPLAINED if lost else JOINT,
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

"""What the data can say at all: whether some were held out, whether they agree, and which joints they show."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from casysid.identification.result import IdentificationResult
from casysid.identification.verdict.criteria import Criterion, Word, names
from casysid.identification.verdict.explained import Unexplained

MUCH_WORSE, WORTH_A_REMARK = 2.0, 0.1
"""Held-out error over the fitted one, and held-out error at least, where they do not agree."""
STILL = 1e-12
"""Square of a speed [rad/s, m/s]."""


def data_criteria(unexplained: Unexplained) -> Iterator[Criterion]:
    """Agreement of what was fitted and what was not, and joints that never moved."""
    result = unexplained.result
    fitted = max(result.train.relative, 1e-300)
    if result.held_out is None:
        missed = float(np.nanmax(unexplained.by_joint)) if not np.isnan(unexplained.by_joint).all() else float("inf")
        value, words = 0.0, f"Blocks of time predicted from the others miss up to {missed:.1%} of a joint's torque."
    else:
        missed = result.held_out.relative
        value = missed / fitted if missed > WORTH_A_REMARK else 0.0
        words = (
            f"Held-out recordings are missed by {missed:.1%}, the fitted ones by {fitted:.1%}: they hold motion or "
            "friction that was not fitted. Fit more recordings, of other motions."
        )
    yield Criterion(
        name="agreement",
        value=value,
        limit=MUCH_WORSE,
        word=Word.DOUBTFUL,
        reason=words,
        origin="errors of recordings of one robot differ by less than a factor of two",
    )
    still = still_joints(result)
    yield Criterion(
        name="joints at rest",
        value=float(len(still)),
        limit=0.0,
        word=Word.DOUBTFUL,
        reason=f"Never moved: {names(still)}. Its friction and much of its inertia cannot be identified; usable "
        "while it rests there.",
        origin="no motion, no inertial torque and no friction",
    )


def still_joints(result: IdentificationResult) -> tuple[str, ...]:
    """Degrees of freedom that never move in what was fitted."""
    v = np.concatenate([motion.v for motion in result.train_motions])
    return tuple(dof for dof, moves in zip(result.robot.dofs, np.any(v**2 >= STILL, axis=0), strict=True) if not moves)

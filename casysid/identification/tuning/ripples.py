"""Waves over the joints' positions in the torque that the usual model leaves."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from casysid.dynamics import JointUse, continued_positions
from casysid.estimation import Estimate
from casysid.identification.friction_candidates import joint_uses, with_ripples
from casysid.identification.passes import Passes
from casysid.identification.tuning.candidates import Candidates


def ripple_uses(passes: Passes, candidates: Candidates, usual: Estimate) -> Mapping[int, JointUse] | None:
    """How joints move, with the wave numbers that the residual torque shows; None where it shows none.

    Args:
        passes: Over what is fitted.
        candidates: Whose usual model was fitted.
        usual: Its fit.
    """
    assert passes.band.cutoff is not None
    motions, regressor = passes.sparse_motions, candidates.base
    residual = [m.tau - regressor.predict(usual.parameters, m.q, m.v, m.a, time=m.time) for m in motions]
    uses = with_ripples(
        joint_uses(passes.robot, passes.speed, passes.width, passes.travel),
        np.concatenate([continued_positions(passes.robot, motion.q) for motion in motions]),
        np.concatenate([motion.v for motion in motions]),
        np.concatenate(residual),
        passes.band.cutoff,
    )
    return uses if any(use.ripple or use.friction_ripple for use in uses.values()) else None

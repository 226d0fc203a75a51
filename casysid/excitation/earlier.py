"""What earlier recordings already know, so that the next motion is designed for what they do not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.excitation.problem import ExcitationProblem
from casysid.recording import Recording
from casysid.signals import motion_band, motion_from_recording

CUTOFF_OVER_BAND = 3.0
"""Low-pass cut-off over the frequency that holds nearly all of a recording's motion."""
HIGHEST_SHARE_OF_RATE = 0.35
"""Of the rate of samples; no cut-off is higher."""


def after_recordings(
    problem: ExcitationProblem, recordings: Sequence[Recording], *, cutoff: float | None = None
) -> ExcitationProblem:
    """The same problem, knowing what recordings tell under its torque noise.

    Args:
        problem: Whose columns and noise are used.
        recordings: Of the same robot.
        cutoff: Of the low-pass [Hz]; None takes three times the motion's band.

    Raises:
        ParameterError: There is no recording.
    """
    if not recordings:
        raise ParameterError("excitation: wanted at least one earlier recording; got none")
    return problem.knowing_gram(sum((_gram(problem, one, cutoff) for one in recordings), 0.0))


def _gram(problem: ExcitationProblem, recording: Recording, cutoff: float | None) -> Array:
    """``Σ σ⁻² x xᵀ`` of all columns, shape (p, p)."""
    if recording.time is not None and cutoff is None:
        band = float(motion_band(recording.time, recording.position).max())
        cutoff = min(CUTOFF_OVER_BAND * max(band, 1.0 / recording.duration), HIGHEST_SHARE_OF_RATE * recording.rate)
    motion = motion_from_recording(problem.robot, recording, None if recording.time is None else cutoff)
    regressor = problem.information.regressor
    moments = accumulate_moments(regressor, motion.q, motion.v, motion.a, motion.tau, blocks=1)
    return np.asarray(moments.pooled(problem.information.noise_std**-2.0).xx)

"""The low-pass cut-off, settled by the data.

Every candidate is a whole small identification. Its score is the cross-validated torque error, each joint's relative to that
joint's own torque seen through the same low-pass, and the geometric mean over joints: the band in which the rigid-body model
explains the largest share of the torque. Too low a cut-off would remove motion and bias the parameters, which no later step can
mend, so candidates begin at three times the frequency that holds 99 % of the velocity's energy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.estimation import Ridge, cross_validated_energy
from casysid.identification.problem import build_problem
from casysid.identification.settings import Settings
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import motion_band

BAND_MARGIN = 3.0
HIGHEST_SHARE_OF_RATE = 0.35
LOWEST_PERIODS = 4.0
STEP = np.sqrt(2.0)
CANDIDATE_ROWS = 12_000


@dataclass(frozen=True, eq=False)
class CutoffChoice:
    """A cut-off and why it was taken.

    Attributes:
        cutoff: [Hz]; None when nothing was filtered.
        candidates: Cut-offs that were tried [Hz], shape (k,).
        error: Their cross-validated relative torque error, geometric mean over joints, shape (k,).
        motion_band: Frequency below which 99 % of the velocity's energy lies, the fastest joint's [Hz].
        reason: In words.
    """

    cutoff: float | None
    candidates: Array
    error: Array
    motion_band: float
    reason: str


def choose_cutoff(
    robot: Robot,
    recordings: Sequence[Recording],
    settings: Settings,
    progress: Callable[[float], None] = lambda share: None,
) -> CutoffChoice:
    """The candidate of least cross-validated error; ``progress`` is told the share done."""
    nothing = frozen([])
    if any(recording.time is None for recording in recordings):
        return CutoffChoice(None, nothing, nothing, 0.0, "samples without time are taken as logged")
    band = max(float(motion_band(recording.time, recording.position).max()) for recording in recordings)  # type: ignore[arg-type]
    if settings.cutoff is not None:
        return CutoffChoice(settings.cutoff, nothing, nothing, band, "given")
    candidates = candidate_cutoffs(
        band, min(recording.rate for recording in recordings), max(recording.duration for recording in recordings)
    )
    errors = []
    for k, cutoff in enumerate(candidates):
        errors.append(cutoff_error(robot, recordings, float(cutoff), settings))
        progress((k + 1) / len(candidates))
    best = int(np.argmin(errors))
    return CutoffChoice(
        float(candidates[best]),
        frozen(candidates),
        frozen(errors),
        band,
        f"least cross-validated torque error of {len(candidates)} cut-offs from {candidates[0]:.3g} to {candidates[-1]:.3g} Hz",
    )


def candidate_cutoffs(band: float, rate: float, duration: float) -> Array:
    """Cut-offs in steps of √2 from three times the motion's band up to 0.35 times the sampling rate [Hz]."""
    highest = HIGHEST_SHARE_OF_RATE * rate
    lowest = min(max(BAND_MARGIN * band, LOWEST_PERIODS / duration), highest)
    return lowest * STEP ** np.arange(int(np.log(highest / lowest) / np.log(STEP)) + 1)


def cutoff_error(robot: Robot, recordings: Sequence[Recording], cutoff: float, settings: Settings) -> float:
    """Cross-validated relative torque error at one cut-off, geometric mean over joints that feel any torque."""
    problem = build_problem(robot, recordings, cutoff, settings, rows=max(CANDIDATE_ROWS // len(recordings), 500))
    energy = cross_validated_energy(Ridge(), problem.moments, problem.regressor.prior)
    target = problem.moments.target_energy().sum(axis=0)
    felt = target > 0
    return float(np.exp(0.5 * np.mean(np.log(np.maximum(energy[felt], 1e-300) / target[felt]))))

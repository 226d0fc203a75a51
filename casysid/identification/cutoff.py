"""The low-pass cut-off, settled by the data.

Every candidate is a whole small identification. Its score is the cross-validated torque error, each joint's relative to
that joint's own torque seen through the same low-pass, and the geometric mean over joints: the band in which the
rigid-body model explains the largest share of the torque. Too low a cut-off would remove motion and bias the
parameters, which no later step can mend, so candidates begin at three times the frequency that holds 95 % of the
velocity's energy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.estimation import Ridge, cross_validated_energy
from casysid.identification.problem import USUAL_WIDTH, build_problem
from casysid.identification.settings import Settings
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import motion_band
from casysid.threads import single_threaded

BAND_MARGIN = 3.0
ENERGY_IN_BAND = 0.95
HIGHEST_SHARE_OF_RATE = 0.2
LOWEST_PERIODS = 4.0
COARSE_STEP = 2.0
FINE_STEP = float(np.sqrt(2.0))
HOPELESS, HOPELESS_IN_A_ROW = 1.25, 3
"""So many cut-offs in a row, each worse than the best by this factor, end the search upwards."""


@dataclass(frozen=True, eq=False)
class CutoffChoice:
    """A cut-off and why it was taken.

    Attributes:
        cutoff: Of the torque as it is seen and judged [Hz]; None when nothing was filtered.
        candidates: Cut-offs that were tried [Hz], shape (k,).
        error: Their cross-validated relative torque error, geometric mean over joints, shape (k,).
        motion_band: Frequency below which 95 % of the velocity's energy lies, the fastest joint's [Hz].
        reason: In words.
        equations: Cut-off of the equations' average, where it is another [Hz]; see
            :mod:`casysid.identification.equation_band`.
    """

    cutoff: float | None
    candidates: Array
    error: Array
    motion_band: float
    reason: str
    equations: float | None = None

    @property
    def fitted(self) -> float | None:
        """Up to where torques are fitted [Hz]."""
        return self.equations or self.cutoff


@single_threaded()
def choose_cutoff(
    robot: Robot,
    recordings: Sequence[Recording],
    settings: Settings,
    *,
    relative_width: float | Array = USUAL_WIDTH,
    step: float = FINE_STEP,
    progress: Callable[[float], None] = lambda share: None,
) -> CutoffChoice:
    """The candidate of least cross-validated error.

    Args:
        robot: The robot.
        recordings: What is fitted.
        settings: A cut-off given there is taken as it is.
        relative_width: Of Coulomb's smooth sign, in root mean square velocities.
        step: Ratio of neighbouring candidates.
        progress: Told the share done.
    """
    nothing = frozen([])
    if any(recording.time is None for recording in recordings):
        return CutoffChoice(None, nothing, nothing, 0.0, "samples without time are taken as logged")
    band = _motion_band(recordings)
    if settings.cutoff is not None:
        return CutoffChoice(settings.cutoff, nothing, nothing, band, "given")
    candidates = candidate_cutoffs(*_band_rate_duration(recordings), step)
    errors = []
    for k, cutoff in enumerate(candidates):
        errors.append(cutoff_error(robot, recordings, float(cutoff), settings, relative_width))
        progress((k + 1) / len(candidates))
        if min(errors[-HOPELESS_IN_A_ROW:]) > HOPELESS * min(errors):
            break
    candidates = candidates[: len(errors)]
    best = int(np.argmin(errors))
    return CutoffChoice(
        float(candidates[best]),
        frozen(candidates),
        frozen(errors),
        band,
        f"least cross-validated torque error of {len(candidates)} from {candidates[0]:.3g} to {candidates[-1]:.3g} Hz",
    )


def _motion_band(recordings: Sequence[Recording]) -> float:
    """The fastest joint's band, in the median recording [Hz]."""
    bands = [
        motion_band(recording.time, recording.position, ENERGY_IN_BAND).max()
        for recording in recordings
        if recording.time is not None
    ]
    return float(np.median(bands))


def _band_rate_duration(recordings: Sequence[Recording]) -> tuple[float, float, float]:
    rates, durations = zip(*((recording.rate, recording.duration) for recording in recordings), strict=True)
    return _motion_band(recordings), min(rates), max(durations)


def lowest_cutoff(recordings: Sequence[Recording]) -> float:
    """The lowest cut-off that keeps the motion [Hz]."""
    return float(candidate_cutoffs(*_band_rate_duration(recordings))[0])


def candidate_cutoffs(band: float, rate: float, duration: float, step: float = FINE_STEP) -> Array:
    """Cut-offs in even ratios from three times the motion's band up to 0.35 times the sampling rate [Hz]."""
    highest = HIGHEST_SHARE_OF_RATE * rate
    lowest = min(max(BAND_MARGIN * band, LOWEST_PERIODS / duration), highest)
    return np.asarray(lowest * step ** np.arange(int(np.log(highest / lowest) / np.log(step)) + 1))


def cutoff_error(
    robot: Robot, recordings: Sequence[Recording], cutoff: float, settings: Settings, relative_width: float | Array
) -> float:
    """Cross-validated relative torque error at one cut-off, geometric mean over joints that feel any torque."""
    problem = build_problem(robot, recordings, cutoff, settings, relative_width=relative_width, quick=True)
    energy = cross_validated_energy(Ridge(standard_errors=False), problem.moments, problem.regressor.prior)
    target = problem.moments.target_energy().sum(axis=0)
    felt = target > 0
    return float(np.exp(0.5 * np.mean(np.log(np.maximum(energy[felt], 1e-300) / target[felt]))))

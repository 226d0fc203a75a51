"""How far up in frequency the equations are averaged where the encoders' noise is taken out.

The cut-off is where the model explains the largest share of the torque seen through it. That is soon above the motion,
where most of the torque's noise is gone. But the parameters are not surest there: a wider average keeps more of what
quick motion and friction's jumps tell, and if the torque's noise is white the widest is best. Least squares could not
use it, because the noise of the motion would bias it; once that is taken out, what speaks against a wide average is
how much the parameters scatter. They are fitted to the recordings without one stretch of time after the other, at a few
cut-offs, and the one is taken at which the torques they predict, all seen through the lowest cut-off, differ least. The
stretches left out must not be predicted worse for it: then the model itself fails further up.

Source: the delete-a-group jackknife (Efron 1982, *The Jackknife, the Bootstrap and Other Resampling Plans*, ch. 3).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.estimation import ErrorsInVariables, Ridge
from casysid.estimation.cross_validation import contiguous_folds
from casysid.identification.cutoff import COARSE_STEP, HIGHEST_SHARE_OF_RATE, CutoffChoice
from casysid.identification.problem import Mask, build_problem
from casysid.identification.settings import Settings
from casysid.moments import Moments
from casysid.recording import Recording
from casysid.robot import Robot

FOLDS = 10
"""Stretches of time that are left out one after the other."""
HOPELESS = 1.5
"""A cut-off at which parameters scatter so many times as much as at the best ends the search upwards."""


def choose_equation_band(
    robot: Robot,
    recordings: Sequence[Recording],
    choice: CutoffChoice,
    settings: Settings,
    relative_width: float | Array,
    moving_only: Mask | bool,
) -> CutoffChoice:
    """The choice with the cut-off of the equations: its own, or a higher one at which parameters scatter less.

    Args:
        robot: The robot.
        recordings: What is fitted.
        choice: A cut-off that was given, or a method that does not reckon with noise, keeps it for the equations.
        settings: As for the final fit.
        relative_width: Of Coulomb's smooth sign, in root mean square velocities.
        moving_only: As for :func:`~casysid.identification.problem.build_problem`.
    """
    if choice.cutoff is None or settings.cutoff is not None or not isinstance(settings.method, ErrorsInVariables):
        return choice
    highest = HIGHEST_SHARE_OF_RATE * min(recording.rate for recording in recordings)
    steps = max(int(np.log(highest / choice.cutoff) / np.log(COARSE_STEP)), 0)
    candidates = choice.cutoff * COARSE_STEP ** np.arange(steps + 1)
    trials: list[_Trial] = []
    for cutoff in candidates:
        problem = build_problem(
            robot, recordings, cutoff, settings, relative_width=relative_width, moving_only=moving_only, quick=True
        )
        moments, prior = problem.moments, problem.regressor.prior
        if not trials:
            seen = moments
            lowest = Ridge(standard_errors=False).estimate(moments, prior)
            ridge = Ridge(strength=lowest.diagnostics.get("strength", 0.0), standard_errors=False)
        trials.append(_left_out(ridge, moments, seen, prior, lowest.noise_std**-2.0))
        if trials[-1].scatter > HOPELESS * min(trial.scatter for trial in trials):
            break
    found = [trial.scatter if trial.error <= trials[0].error else np.inf for trial in trials]
    best = int(np.argmin(found))
    if best == 0:
        return choice
    return dataclasses.replace(
        choice,
        equations=float(candidates[best]),
        reason=f"{choice.reason}; equations up to {candidates[best]:.3g} Hz, where parameters scatter least",
    )


@dataclass(frozen=True)
class _Trial:
    """Parameters fitted without one stretch of time after the other, leaning on the prior alike at every cut-off.

    Attributes:
        scatter: Jackknife variance of the torques that they predict.
        error: Squared error of the torques predicted for the stretches left out.
    """

    scatter: float
    error: float


def _left_out(ridge: Ridge, moments: Moments, seen: Moments, prior: Array, weights: Array) -> _Trial:
    """Fit ``moments``, judge by ``seen``, the same blocks of time through the lowest cut-off."""
    whole = ridge.estimate(moments, prior)
    metric, folds = seen.pooled(weights).xx, contiguous_folds(moments.blocks, FOLDS)
    scatter = error = 0.0
    for left_out in folds:
        kept = np.setdiff1d(np.arange(moments.blocks), left_out)
        found = ridge.estimate(moments.select_blocks(kept), prior).parameters
        difference = found - whole.parameters
        scatter += float(difference @ metric @ difference) * (len(folds) - 1) / len(folds)
        error += float(seen.select_blocks(left_out).residual_energy(found).sum(axis=0) @ weights)
    return _Trial(scatter, error)

"""How far up in frequency the equations are averaged where the encoders' noise is taken out.

The cut-off is where the model explains the largest share of the torque seen through it. That is soon above the motion,
where most of the torque's noise is gone. But the parameters are not surest there: a wider average keeps more of what
quick motion and friction's jumps tell, and if the torque's noise is white the widest is best. Least squares could not
use it, because the noise of the motion would bias it; once that is taken out, what speaks against a wide average is
how much the parameters scatter. They are fitted to the recordings without one stretch of time after the other, at a few
cut-offs, and the one is taken at which the torques they predict, all seen through the lowest cut-off, differ least.

Source: the delete-a-group jackknife (Efron 1982, *The Jackknife, the Bootstrap and Other Resampling Plans*, ch. 3).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

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
    found: list[float] = []
    for cutoff in candidates:
        problem = build_problem(
            robot, recordings, cutoff, settings, relative_width=relative_width, moving_only=moving_only, quick=True
        )
        moments, prior = problem.moments, problem.regressor.prior
        if not found:
            weights = Ridge(standard_errors=False).estimate(moments, prior).noise_std ** -2.0
            metric = moments.pooled(weights).xx
        found.append(scatter(moments, prior, metric))
        if found[-1] > HOPELESS * min(found):
            break
    best = int(np.argmin(found))
    if best == 0:
        return choice
    return dataclasses.replace(
        choice,
        equations=float(candidates[best]),
        reason=f"{choice.reason}; equations up to {candidates[best]:.3g} Hz, where parameters scatter least",
    )


def scatter(moments: Moments, prior: Array, metric: Array) -> float:
    """Jackknife variance of parameters in a metric (p, p), every stretch of time left out once."""
    whole = Ridge(standard_errors=False).estimate(moments, prior)
    ridge = Ridge(strength=whole.diagnostics.get("strength", 0.0), standard_errors=False)
    folds = contiguous_folds(moments.blocks, FOLDS)
    total = 0.0
    for left_out in folds:
        kept = np.setdiff1d(np.arange(moments.blocks), left_out)
        difference = ridge.estimate(moments.select_blocks(kept), prior).parameters - whole.parameters
        total += float(difference @ metric @ difference)
    return total * (len(folds) - 1) / len(folds)

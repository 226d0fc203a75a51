"""Whether equations at the ends of a recording's stretches count, settled by the data.

Two things are poorly known there. Smoothing of the positions sees one side only, so accelerations of a joint that moves
at an end are poor. And a robot that starts or stops is so slow that noise hides which way friction acts. The few
equations at the ends can then hold more error than all others together. Where the model itself misses the torque by
more, nothing is gained by leaving them out.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from casysid.estimation import Ridge
from casysid.identification.cutoff import lowest_cutoff
from casysid.identification.excerpts import excerpts
from casysid.identification.problem import USUAL_WIDTH, make_motions, regressor_for, sum_moments
from casysid.identification.settings import Settings
from casysid.recording import Recording
from casysid.robot import Robot

LEAST_EXCESS = 5.0
"""Ends are left out where they are missed by so many times as much as all else, root mean square over joints."""


def choose_ends(robot: Robot, recordings: Sequence[Recording], settings: Settings) -> bool:
    """Whether the ends count; what the settings say, if they do."""
    if settings.ends is not None:
        return settings.ends
    return end_excess(robot, recordings, settings) <= LEAST_EXCESS


def end_excess(robot: Robot, recordings: Sequence[Recording], settings: Settings) -> float:
    """How many times as much parameters fitted to all else miss the torque at the ends; 0 without time.

    Args:
        robot: The robot.
        recordings: What is fitted.
        settings: As for the final fit.
    """
    if any(recording.time is None for recording in recordings):
        return 0.0
    parts = excerpts(recordings)
    cutoff = lowest_cutoff(parts)
    motions = make_motions(robot, parts, cutoff, settings, moving_only=False, quick=True)
    regressor = regressor_for(robot, motions, settings, USUAL_WIDTH)
    inner = [dataclasses.replace(one, standing=np.repeat(~one.settled[:, None], robot.nv, axis=1)) for one in motions]
    counting_all = dataclasses.replace(settings, ends=True)
    whole, inside = (sum_moments(regressor, ones, cutoff, counting_all) for ones in (motions, inner))
    fitted = Ridge(standard_errors=False).estimate(inside, regressor.prior)
    weights = fitted.noise_std**-2.0
    energy = [one.residual_energy(fitted.parameters).sum(axis=0) @ weights for one in (whole, inside)]
    rows = [one.count.sum() for one in (whole, inside)]
    if not (rows[0] > rows[1] > 0.0 and energy[1] > 0.0):
        return 0.0
    return float(np.sqrt(max(energy[0] - energy[1], 0.0) / (rows[0] - rows[1]) / (energy[1] / rows[1])))

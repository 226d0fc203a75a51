"""Which joints' equations are taken only while they move, settled by the data.

Friction holds a standing joint with any torque up to the break-away. Where it does, no parameters explain the torque of
a stand, and to fit it spoils those that explain motion. Where torques of stands are explained about as well as those of
motion, they tell of weight and of friction and stay.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import Coulomb
from casysid.estimation import Ridge
from casysid.identification.problem import USUAL_WIDTH, Mask, make_motions, regressor_for, sum_moments
from casysid.identification.settings import Settings
from casysid.recording import Recording
from casysid.robot import Robot

LEAST_EXCESS = 2.5
"""Stands count as unexplained when they are missed by so many times as much as motion is, root mean square. Of eight
real robots' logs, those with more predict unseen torque better without their stands, those with less better with."""


def choose_moving_only(
    robot: Robot,
    recordings: Sequence[Recording],
    cutoff: float | None,
    settings: Settings,
    relative_width: float | Array = USUAL_WIDTH,
) -> Mask:
    """Degrees of freedom whose stands parameters fitted to motion cannot explain, shape (nv,)."""
    if cutoff is None or not any(isinstance(column, Coulomb) for column in settings.friction):
        return np.zeros(robot.nv, dtype=bool)
    moving = make_motions(robot, recordings, cutoff, settings, moving_only=True, quick=True)
    if all(motion.standing.all() for motion in moving):
        return np.zeros(robot.nv, dtype=bool)
    whole = [dataclasses.replace(motion, standing=np.zeros_like(motion.standing)) for motion in moving]
    regressor = regressor_for(robot, moving, settings, relative_width)
    of_whole, of_moving = (sum_moments(regressor, motions, cutoff, settings) for motions in (whole, moving))
    fitted = Ridge(standard_errors=False).estimate(of_moving, regressor.prior).parameters
    energy = [moments.residual_energy(fitted).sum(axis=0) for moments in (of_whole, of_moving)]
    rows = [moments.count.sum(axis=0) for moments in (of_whole, of_moving)]
    stands, stand_rows = energy[0] - energy[1], rows[0] - rows[1]
    return np.asarray(stands * rows[1] > LEAST_EXCESS**2 * energy[1] * stand_rows)

"""How sharply Coulomb friction changes its sign, settled by the data.

A step at zero velocity fits a stiff drive; a lubricated or elastic one changes over a band of slow motion. The width of
the smooth sign enters nonlinearly, so a few widths are tried, each a whole small identification, and every joint takes
the one that predicts its own torque best on blocks of time left out. All joints share a trial, because a joint's width
acts on its own torque alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import Coulomb
from casysid.estimation import Ridge, cross_validated_energy
from casysid.identification.problem import USUAL_WIDTH, Mask, make_motions, regressor_for, sum_moments
from casysid.identification.settings import Settings
from casysid.recording import Recording
from casysid.robot import Robot

RELATIVE_WIDTHS = (3e-4, 1.5e-3, USUAL_WIDTH, 2e-2, 6e-2)
"""Candidates, in root mean square velocities of the joint."""
WORTHWHILE_GAIN = 0.10
"""The sharpest width within this share of the least error is taken. A step is the model; a slope needs strong evidence,
because it trades viscous friction against Coulomb's."""


def choose_relative_width(
    robot: Robot,
    recordings: Sequence[Recording],
    cutoff: float | None,
    settings: Settings,
    moving_only: Mask | bool = False,
    progress: Callable[[float], None] = lambda share: None,
) -> Array:
    """Width of each degree of freedom's smooth sign, in root mean square velocities, shape (nv,).

    Args:
        robot: The robot.
        recordings: What is fitted.
        cutoff: Of the equations [Hz].
        settings: A width given there is left alone.
        moving_only: As for :func:`~casysid.identification.problem.build_problem`.
        progress: Told the share done.
    """
    if settings.coulomb_width is not None or not any(isinstance(column, Coulomb) for column in settings.friction):
        return np.full(robot.nv, USUAL_WIDTH)
    motions = make_motions(robot, recordings, cutoff, settings, moving_only=moving_only, quick=True)
    energy = []
    for k, width in enumerate(RELATIVE_WIDTHS):
        regressor = regressor_for(robot, motions, settings, width)
        moments = sum_moments(regressor, motions, cutoff, settings)
        energy.append(cross_validated_energy(Ridge(standard_errors=False), moments, regressor.prior))
        progress((k + 1) / len(RELATIVE_WIDTHS))
    error = np.sqrt(energy)  # (widths, nv)
    good_enough = error <= (1.0 + WORTHWHILE_GAIN) * error.min(axis=0)
    return np.asarray(np.array(RELATIVE_WIDTHS)[np.argmax(good_enough, axis=0)])

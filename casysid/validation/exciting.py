"""The motion with which a rehearsal excites its machine."""

from __future__ import annotations

import enum

import numpy as np

from casysid.excitation import FourierSeries, build_excitation, choose_series, design_set, limits_of
from casysid.excitation.design.result import Progress
from casysid.robot import Robot
from casysid.simulation.reference import Trajectory
from casysid.simulation.trajectories import design_sinusoids
from casysid.validation.playback import DesignedMotion

MOST_MOTIONS = 3
"""So many motions that complement each other fill a recording; a longer one repeats them."""


class Excitation(enum.StrEnum):
    """What moves the machine while the recording to fit is made."""

    SINUSOIDS = "sinusoids"
    DESIGNED = "designed"


def excite(
    robot: Robot, kind: Excitation, *, duration: float, rate: float, seed: int, progress: Progress | None = None
) -> Trajectory:
    """A motion of a duration [s], recorded at a rate [Hz].

    Raises:
        ParameterError: It is to be designed, and the robot's joints or limits do not allow that.
    """
    if kind is Excitation.SINUSOIDS:
        return design_sinusoids(robot, duration=duration, seed=seed)
    series, count, periods = plan_set(choose_series(limits_of(robot), rate), duration)
    problem = build_excitation(robot, series=series, periods=periods, rate=rate)
    return DesignedMotion.of(design_set(problem, count, starts=2, seed=seed, progress=progress))


def plan_set(usual: FourierSeries, duration: float) -> tuple[FourierSeries, int, int]:
    """The series, how many complementary motions, and how many periods of each, that fill a duration [s]."""
    count = int(np.clip(duration // usual.period, 1, MOST_MOTIONS))
    periods = max(1, round(duration / (count * usual.period)))
    return FourierSeries(duration / (count * periods), usual.harmonics), count, periods

"""A designed motion played on a simulated machine under computed torque, and whether the machine kept the limits."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.excitation import ExcitationDesign, ExcitationProblem, ExcitationTrajectory, Verification, verify_recorded
from casysid.excitation.motion.fourier import Motion
from casysid.simulation import IDEAL, PD, ControlModel, Plant, Reference, SimulatedRun
from casysid.threads import single_threaded
from casysid.validation.tracking import track

BANDWIDTH = 6.0
"""Of the feedback [Hz]: stiff, as one records."""
SAME_PLACE = 1e-9
"""How far apart, [rad, m], an end and a start may be to count as one place."""


@dataclass(frozen=True, eq=False)
class DesignedMotion:
    """Designed motions one after another, as a controller follows them; they start again after the last one.

    Attributes:
        trajectories: Of one robot, each starting where the one before it ends.
    """

    trajectories: tuple[ExcitationTrajectory, ...]

    def __post_init__(self) -> None:
        for first, second in itertools.pairwise(self.trajectories):
            gap = np.abs(second.start - first.start)
            if gap.max() > SAME_PLACE:
                dof = first.robot.dofs[int(np.argmax(gap))]
                raise ParameterError(
                    f"designed motion: every trajectory must start where the one before it ends; joint '{dof}' would "
                    f"jump by {gap.max():.3g}. Design the later ones with start=trajectory.start of the first"
                )

    @classmethod
    def of(cls, designs: Sequence[ExcitationDesign]) -> DesignedMotion:
        """The motions of some designs."""
        return cls(tuple(design.trajectory for design in designs))

    @property
    def duration(self) -> float:
        """Of all of them [s]."""
        return float(sum(one.duration for one in self.trajectories))

    def sample(self, time: Array) -> Reference:
        """The motion at times (N,), [s]."""
        time = np.asarray(time, dtype=np.float64)
        since = np.cumsum([0.0, *(one.duration for one in self.trajectories)])
        within = time % since[-1]
        place = np.clip(np.searchsorted(since, within, side="right") - 1, 0, len(self.trajectories) - 1)
        robot = self.trajectories[0].robot
        position, velocity, acceleration = (np.empty((len(time), len(robot.dofs))) for _ in range(3))
        for k, trajectory in enumerate(self.trajectories):
            rows = place == k
            moved = trajectory.motion(within[rows] - since[k])
            position[rows], velocity[rows], acceleration[rows] = moved[:3]
        return Reference.from_channels(robot, time, position, velocity, acceleration)


@dataclass(frozen=True, eq=False, kw_only=True)
class Playback:
    """A designed motion as a machine carried it out.

    Attributes:
        run: What happened.
        verification: Its margins: of true positions, velocities, accelerations where they are limited, distances and
            boxes, and of the torque that the actuators gave.
    """

    run: SimulatedRun
    verification: Verification


@single_threaded()
def play(
    design: ExcitationDesign,
    plant: Plant | None = None,
    *,
    within: ExcitationProblem | None = None,
    rate: float = 500.0,
    bandwidth: float = BANDWIDTH,
    seed: int = 0,
) -> Playback:
    """Play all periods of a design in MuJoCo under computed torque by the model file, and check the limits.

    Args:
        design: The motion.
        plant: The machine; None is one that is as the model file says, with perfect motors and sensors.
        within: Whose limits are to be kept; None is the design's own problem, whose limits have a margin to the file's.
        rate: Of the controller and of the check [Hz].
        bandwidth: Of the feedback [Hz].
        seed: Of the sensors' noise.

    Raises:
        RobotError: The robot cannot be simulated.
    """
    robot = design.problem.robot
    believed = ControlModel.from_robot(robot)
    machine = Plant(robot, IDEAL, believed.parameters) if plant is None else plant
    gains = PD.tuned(robot, machine.parameters, bandwidth=bandwidth)
    motion = DesignedMotion.of([design])
    run = track(machine, believed, gains, motion, rate=rate, duration=motion.duration, seed=seed)
    moved = Motion(run.channels, run.v, run.a, np.full_like(run.a, np.nan))
    checked = verify_recorded(within or design.problem, run.reference.time, moved, run.tau)
    return Playback(run=run, verification=checked)

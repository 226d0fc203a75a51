"""Recordings of simulated robots, whose truth is known."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import cache

from casysid.bundled import find_model
from casysid.identification import Preparation, Settings, prepare
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.simulation import (
    IDEAL,
    PD,
    ComputedTorque,
    ControlModel,
    Plant,
    PlantSettings,
    SimulatedRun,
    design_sinusoids,
    simulate,
)

RATE = 500.0


@cache
def bundled_robot(name: str) -> Robot:
    return Robot.from_file(find_model(name))


@cache
def simulated_run(name: str, seed: int, settings: PlantSettings = IDEAL, duration: float = 8.0) -> SimulatedRun:
    """The robot under computed torque with its true parameters along sinusoids of the seed."""
    robot = bundled_robot(name)
    plant = Plant(robot, settings)
    control = ComputedTorque(ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters))
    motion = design_sinusoids(robot, duration=duration, seed=seed)
    return simulate(plant, control, motion, rate=RATE, duration=duration, seed=seed)


def prepared(robot: Robot, recordings: Recording | Sequence[Recording], settings: Settings) -> Preparation:
    """What the pipeline makes of recordings, noise included, where nothing but the band is left to the data."""
    fixed = dataclasses.replace(settings, choose_friction=False, delay=0.0, time_scale=1.0, consistency=None)
    return prepare(robot, recordings, fixed, noise_too=True)

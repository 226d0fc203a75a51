"""Robots that behave like real ones, simulated in MuJoCo, where the truth is known."""

from casysid.simulation.controllers import PD, Command, ComputedTorque, Controller, GravityCompensation
from casysid.simulation.model import ControlModel
from casysid.simulation.operational_space import OperationalSpace
from casysid.simulation.plant import Plant
from casysid.simulation.reference import Reference, Trajectory
from casysid.simulation.result import RunStatus, SimulatedRun
from casysid.simulation.run import simulate
from casysid.simulation.settings import (
    IDEAL,
    NO_MECHANICS,
    PERFECT_ACTUATION,
    PERFECT_SENSING,
    PLAIN_MECHANICS,
    Actuation,
    Mechanics,
    PlantSettings,
    Sensing,
)
from casysid.simulation.trajectories import Sinusoids, design_sinusoids

__all__ = [
    "IDEAL",
    "NO_MECHANICS",
    "PD",
    "PERFECT_ACTUATION",
    "PERFECT_SENSING",
    "PLAIN_MECHANICS",
    "Actuation",
    "Command",
    "ComputedTorque",
    "ControlModel",
    "Controller",
    "GravityCompensation",
    "Mechanics",
    "OperationalSpace",
    "Plant",
    "PlantSettings",
    "Reference",
    "RunStatus",
    "Sensing",
    "SimulatedRun",
    "Sinusoids",
    "Trajectory",
    "design_sinusoids",
    "simulate",
]

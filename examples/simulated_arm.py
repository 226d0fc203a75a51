"""A two-link arm in MuJoCo, with friction, noise and all, for examples without a real one."""

import casysid
from casysid.simulation import PD, ControlModel, design_sinusoids

ROBOT = casysid.Robot.from_file(casysid.find_model("two_link"))


def record(seed: int, robot: casysid.Robot = ROBOT, duration: float = 8.0) -> casysid.Recording:
    """A recording of the robot under computed torque, along another motion for each seed."""
    plant = casysid.Plant(robot)
    control = casysid.ComputedTorque(
        ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters)
    )
    motion = design_sinusoids(robot, duration=duration, seed=seed)
    return casysid.simulate(plant, control, motion, rate=500.0, duration=duration, seed=seed).recording

"""Files as found in the field, with placeholder limits, heavy damping or links without inertia, can be rehearsed."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from casysid.errors import CasysidWarning
from casysid.robot import Robot
from casysid.simulation import PD, ComputedTorque, ControlModel, Plant, RunStatus, design_sinusoids, simulate

DATA = Path(__file__).parents[3] / "shared" / "data"
FILES = sorted(DATA.glob("*/*.urdf"))


@pytest.mark.skipif(not FILES, reason="the real robots' files are not beside this checkout")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_real_robots_file_makes_a_plant_that_true_parameters_track(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CasysidWarning)  # some files' inertias are no bodies'
        robot = Robot.from_file(path)
    plant = Plant(robot)
    controller = ComputedTorque(ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters))
    motion = design_sinusoids(robot, duration=2.0, ramp=0.5)
    run = simulate(plant, controller, motion, rate=500.0, duration=2.0)
    assert run.status is RunStatus.COMPLETED
    assert np.abs(run.q - run.reference.q).max() < 0.05
    assert run.saturated.max() < 0.01

"""Tracking errors are those of the truth, and a robot that ran away has none."""

import dataclasses

import numpy as np
import pytest

from casysid.bundled import find_model
from casysid.errors import CasysidWarning, ParameterError
from casysid.estimation import OrdinaryLeastSquares
from casysid.identification import Settings
from casysid.projection import build_projection, project
from casysid.robot import Robot
from casysid.simulation import PD, ControlModel, OperationalSpace, Plant, RunStatus, design_sinusoids, simulate
from casysid.validation import measure_tracking, track, true_coefficients
from tests.simulated import prepared, simulated_run


def test_errors_are_root_mean_squares_of_the_true_motion():
    run = simulated_run("two_link", 0)
    tracking = measure_tracking(Plant(Robot.from_file(find_model("two_link"))), run)
    np.testing.assert_allclose(tracking.position, np.sqrt(np.mean((run.reference.q - run.q) ** 2, axis=0)))
    np.testing.assert_allclose(tracking.velocity, np.sqrt(np.mean((run.reference.v - run.v) ** 2, axis=0)))
    assert tracking.means()["feedback"] == pytest.approx(np.sqrt(np.mean(run.feedback**2, axis=0)).mean())
    assert tracking.to_json(("a", "b"))["position"]["b"] == tracking.position[1]


def test_a_robot_that_ran_away_has_no_tracking_error():
    robot = Robot.from_file(find_model("two_link"))
    plant, motion = Plant(robot), design_sinusoids(robot, duration=2.0, ramp=0.5)
    model = ControlModel.from_robot(robot, -30.0 * plant.parameters)
    with pytest.warns(CasysidWarning, match="was stopped"):
        run = track(plant, model, PD(robot, 0.0, 0.0), motion, rate=500.0, duration=2.0)
    assert not measure_tracking(plant, run).completed
    assert measure_tracking(plant, run).means() == dict.fromkeys(("position", "velocity", "feedback"), np.inf)


@pytest.fixture(scope="module")
def arm():
    """The arm, least squares on four seconds of it, and that estimate's projection."""
    robot = Robot.from_file(find_model("arm.xml"))
    plant = Plant(robot)
    motion = design_sinusoids(robot, duration=4.0, seed=0, ramp=0.5)
    gains = PD.tuned(robot, plant.parameters)
    run = track(plant, ControlModel.from_robot(robot), gains, motion, rate=500.0, duration=4.0)
    problem = prepared(robot, run.recording, Settings(cutoff=20.0))
    estimate = OrdinaryLeastSquares().estimate(problem.moments)
    projection = build_projection(problem.regressor.parameters)
    answer = project(projection, estimate.parameters, estimate.metric, problem.regressor.prior)
    return plant, problem.regressor, estimate.parameters, answer.parameters


def reach(plant, model):
    """The hand follows a path in operational space."""
    controller = OperationalSpace(model=model, joint="wrist_abduction", point=np.array([0.0, 0.0, -0.05]))
    motion = design_sinusoids(plant.robot, duration=1.5, seed=7, ramp=0.5)
    return simulate(plant, controller, motion, rate=480.0, duration=1.5)


def test_an_inconsistent_estimate_cannot_control_in_operational_space(arm):
    plant, regressor, inconsistent, _ = arm
    with pytest.raises(ParameterError, match="not positive definite, and the controller divides by it"):
        reach(plant, ControlModel(regressor, inconsistent))


def test_its_projection_can(arm):
    plant, regressor, _, projected = arm
    limit = reach(plant, ControlModel(regressor, true_coefficients(plant, regressor)))
    run = reach(plant, ControlModel(regressor, projected))
    assert run.status is limit.status is RunStatus.COMPLETED
    errors = [measure_tracking(plant, one).means()["position"] for one in (run, limit)]
    assert errors[0] < 4.0 * errors[1]


def test_tracking_is_frozen():
    tracking = measure_tracking(Plant(Robot.from_file(find_model("two_link"))), simulated_run("two_link", 0))
    with pytest.raises(dataclasses.FrozenInstanceError):
        tracking.completed = False
    with pytest.raises(ValueError, match="read-only"):
        tracking.position[0] = 1.0

"""From a recording to parameters, where the truth is known."""

import dataclasses
import json

import numpy as np
import pytest

from casysid.dynamics import Armature
from casysid.errors import ParameterError, RecordingError
from casysid.estimation import Ridge, Status, WeightedLeastSquares
from casysid.identification import Settings, identify
from casysid.identification.output import write_result
from casysid.identification.verdict import judge
from casysid.inertia import Consistency
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import BandAverage
from casysid.simulation import IDEAL, NO_MECHANICS, Plant, PlantSettings
from tests.simulated import bundled_robot, simulated_run

REAL = PlantSettings()
QUICK = Settings(cutoff=12.0)


@pytest.fixture(scope="module")
def result():
    """A two-link arm with everything that real robots do, cut-off and friction settled by the data."""
    train, test = simulated_run("two_link.urdf", 0, REAL).recording, simulated_run("two_link.urdf", 1, REAL).recording
    return identify(bundled_robot("two_link.urdf"), train, held_out=[test])


@pytest.mark.parametrize("model", ["two_link.xml", "scara.xml"])
def test_rigid_bodies_are_recovered_through_smoothing_and_differentiation(model):
    robot, rigid = bundled_robot(model), dataclasses.replace(IDEAL, mechanics=NO_MECHANICS)
    found = identify(robot, simulated_run(model, 0, rigid).recording, Settings(cutoff=40.0, friction=(Armature(),)))
    other = simulated_run(model, 1, rigid)
    plant = Plant(robot, rigid)
    truth = np.zeros(len(found.regressor.names))
    truth[: robot.inertial_parameters.size] = plant.parameters[: robot.inertial_parameters.size]
    truth[[name.endswith(".armature") for name in found.regressor.names]] = plant.parameters[-robot.nv :]
    exact, got = (found.regressor.predict(theta, other.q, other.v, other.a) for theta in (truth, found.parameters))
    assert np.linalg.norm(got - exact) < 0.01 * np.linalg.norm(exact)


def test_held_out_torque_is_predicted_on_a_robot_with_all_effects(result):
    assert result.status is Status.CONVERGED
    assert result.held_out.relative < 0.03
    assert result.held_out.relative < 0.6 * result.file.relative
    assert result.held_out.relative_unfiltered >= 0.9 * result.held_out.relative


def test_errors_are_what_they_say(result):
    """Measured and predicted torque averaged by the same windows, away from the ends."""
    motion, cutoff = result.held_out_motions[0], result.cutoff.errors
    predicted = result.regressor.predict(result.parameters, motion.q, motion.v, motion.a, time=motion.time)
    inner = np.flatnonzero(motion.settled)
    assert 0 < len(inner) < len(motion)
    average = BandAverage(motion.time, cutoff).weights(inner)
    residual, measured = average @ (motion.tau - predicted)[inner], average @ motion.tau[inner]
    error = np.linalg.norm(residual) / np.linalg.norm(measured)
    assert result.held_out.relative == pytest.approx(error, rel=1e-9)
    assert result.held_out.rmse == pytest.approx(np.sqrt(np.mean(residual**2, axis=0)), rel=1e-9)
    by_joint = np.linalg.norm(residual, axis=0) / np.linalg.norm(measured, axis=0)
    assert result.held_out.relative_by_joint == pytest.approx(by_joint, rel=1e-9)
    unfiltered = np.linalg.norm((motion.tau - predicted)[inner]) / np.linalg.norm(motion.tau[inner])
    assert result.held_out.relative_unfiltered == pytest.approx(unfiltered, rel=1e-9)


def test_the_answer_is_consistent_by_default(result):
    assert result.is_physically_consistent
    assert result.smallest_pseudo_inertia_eigenvalue > 0
    assert judge(result).accepted, judge(result).reasons


def test_result_json_holds_the_contract(result, tmp_path):
    write_result(result, tmp_path)
    content = json.loads((tmp_path / "result.json").read_text())
    assert set(content) >= {
        "status", "method", "joints", "samples", "seconds", "relative_error", "torque_rmse", "physically_consistent",
        "smallest_pseudo_inertia_eigenvalue", "base_parameters", "links", "friction", "verdict",
    }  # fmt: skip
    assert content["joints"] == list(result.robot.dofs)
    assert set(content["friction"][result.robot.dofs[0]]) >= {"viscous", "coulomb", "offset", "armature"}
    link = content["links"][result.robot.links[0]]
    assert len(link["center_of_mass"]) == 3
    assert len(link["inertia"]) == len(link["std"]["inertia"]) == len(link["identifiable"]["inertia"]) == 6
    assert content["samples"]["held_out"] == result.held_out.samples
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize("model", ["two_link.urdf", "two_link.xml"])
def test_the_written_model_reproduces_the_prediction(model, tmp_path):
    robot = bundled_robot(model)
    run = simulated_run(model, 0, REAL)
    found = identify(robot, run.recording, dataclasses.replace(QUICK, choose_friction=False))
    write_result(found, tmp_path)
    written = Robot.from_file(tmp_path / f"identified.{model.split('.')[1]}")
    motion = found.train_motions[0]
    parameters = np.array(found.parameters)
    parameters[: 10 * len(robot.links)] = written.inertial_parameters
    parameters[10 * len(robot.links) :][: robot.nv] = written.damping
    parameters[10 * len(robot.links) + robot.nv :][: robot.nv] = written.dry_friction
    predicted = found.regressor.predict(parameters, motion.q, motion.v, motion.a)
    own = found.regressor.predict(found.parameters, motion.q, motion.v, motion.a)
    assert np.abs(predicted - own).max() < 1e-9 * np.abs(motion.tau).max()


def test_an_inconsistent_model_is_withheld_unless_asked_for(tmp_path):
    robot = bundled_robot("two_link.urdf")
    run = simulated_run("two_link.urdf", 0, REAL)
    prior = np.array(robot.inertial_parameters)
    prior[[4, 6, 9]] *= -1.0
    broken = robot.with_parameters(inertial_parameters=prior)
    found = identify(broken, run.recording, dataclasses.replace(QUICK, consistency=None, method=Ridge(strength=1e6)))
    assert not found.is_physically_consistent
    assert not judge(found).accepted
    assert "withheld" in write_result(found, tmp_path)[0]
    assert not (tmp_path / "identified.urdf").exists()
    write_result(found, tmp_path, export_inconsistent=True)
    assert (tmp_path / "identified.urdf").exists()


@pytest.mark.parametrize("consistency", [Consistency.INERTIA, Consistency.FULL])
def test_consistency_costs_little_where_the_truth_is_consistent(consistency):
    train, test = simulated_run("two_link.urdf", 0, REAL).recording, simulated_run("two_link.urdf", 1, REAL).recording
    robot = bundled_robot("two_link.urdf")
    found = identify(robot, train, dataclasses.replace(QUICK, consistency=consistency), held_out=[test])
    assert found.held_out.relative < 1.03 * found.unconstrained.relative


def test_unordered_samples_are_taken_as_logged():
    run = simulated_run("two_link.urdf", 0)
    order = np.random.default_rng(0).permutation(len(run.q))
    samples = Recording(
        channels=run.recording.channels,
        dofs=run.recording.dofs,
        position=run.channels[order],
        velocity=run.v[order],
        acceleration=run.a[order],
        torque=run.tau[order],
    )
    found = identify(bundled_robot("two_link.urdf"), samples, Settings(method=WeightedLeastSquares()))
    assert found.cutoff.cutoff is None
    assert found.train.relative < 0.01


def test_several_recordings_are_fitted_together():
    parts = [simulated_run("two_link.urdf", seed, REAL).recording for seed in (0, 1)]
    found = identify(bundled_robot("two_link.urdf"), parts, dataclasses.replace(QUICK, delay=0.0))
    assert found.train.samples == sum(len(part) for part in parts)


def test_a_joint_at_rest_is_named():
    recording = simulated_run("two_link.urdf", 0, REAL).recording
    position = np.array(recording.position)
    position[:, 1] = 0.3
    still = dataclasses.replace(recording, position=position, velocity=None)
    verdict = judge(identify(bundled_robot("two_link.urdf"), still, QUICK))
    assert any("Never moved: " + bundled_robot("two_link.urdf").dofs[1] in reason for reason in verdict.reasons)
    assert not verdict.accepted


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Settings(cutoff=-1.0), ParameterError, "cut-off must be a positive number of Hz; got -1"),
        (lambda: Settings(blocks=2), ParameterError, "blocks must be at least 4"),
        (lambda: Settings(threads=0), ParameterError, "threads must be at least 1"),
        (lambda: identify(bundled_robot("two_link.urdf"), []), RecordingError, "at least one recording"),
    ],
)
def test_bad_requests_are_named(make, error, message):
    with pytest.raises(error, match=message):
        make()

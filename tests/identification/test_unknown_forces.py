"""Logs of robots with a free base through the whole identification: which equations are taken, and what they tell."""

import dataclasses

import numpy as np
import pytest

from casysid.bundled import find_model
from casysid.dynamics import build_regressor
from casysid.errors import ParameterError, RecordingError
from casysid.estimation import OrdinaryLeastSquares
from casysid.floating import Contact, free_projector, standing_forces, standing_motion, unknown_directions
from casysid.identification import Settings, identify
from casysid.kinematics import Kinematics
from casysid.recording import open_recording, read_recording
from casysid.robot import Robot
from casysid.robot.coordinates import channels_from_configuration

SAMPLES = 200
FEET = ("foot_fl", "foot_fr", "foot_rl", "foot_rr")
STANCE = np.array([0.0, 0.0, 0.31, 0.0, 0.0, 0.0, 1.0] + [0.0, 0.75, -1.5] * 4)
PLAIN = Settings(method=OrdinaryLeastSquares(), consistency=None, choose_friction=False)


def write(path, log):
    rows = zip(*(map(repr, np.asarray(values, dtype=float).tolist()) for values in log.values()), strict=True)
    path.write_text("\n".join([",".join(log), *map(",".join, rows)]) + "\n")
    return path


def motion(robot, seed, samples=SAMPLES):
    return standing_motion(robot, FEET, STANCE, np.linspace(0.0, 40.0, samples), seed=seed)


@pytest.fixture(scope="module")
def machine():
    """The quadruped with other parameters than its file's, and its log: samples without order, nothing noisy."""
    robot = Robot.from_file(find_model("quadruped.xml"))
    regressor, m = build_regressor(robot), motion(robot, 0)
    theta = regressor.prior * np.random.default_rng(3).uniform(0.8, 1.25, len(regressor.prior))
    theta[[p.kind == "coulomb" for p in regressor.parameters]] = 0.0  # its smooth sign would turn elsewhere
    tau, wrenches = standing_forces(Kinematics(robot), FEET, m.q, regressor.predict(theta, m.q, m.v, m.a))
    channels = channels_from_configuration(robot, m.q)
    log = {f"q_{name}": x for name, x in zip(robot.channels, channels.T, strict=True)}
    log |= {f"v_{name}": x for name, x in zip(robot.dofs, m.v.T, strict=True)}
    log |= {f"a_{name}": x for name, x in zip(robot.dofs, m.a.T, strict=True)}
    torques = {f"tau_{name}": x for name, x in zip(robot.dofs[6:], tau.T[6:], strict=True)}
    pressed = {f"f{axis}_{foot}": x for foot, w in wrenches.items() for axis, x in zip("xyz", w.T, strict=True)}
    flags = {f"contact_{foot}": np.ones(SAMPLES) for foot in FEET}
    return robot, (regressor, theta), log, torques, pressed, flags


def ways(machine):
    robot, _, log, torques, pressed, flags = machine
    return {
        "all of base and joints": (log | torques | pressed | flags, False, ()),
        "the six of the base alone": (log | pressed, False, robot.dofs[6:]),
        "null space of the contact Jacobians": (log | torques | flags, True, ()),
    }


def test_three_ways_agree_without_noise(machine, tmp_path):
    """In all that each can see, on another motion, though the file's parameters are far from the truth."""
    robot, (regressor, theta) = machine[:2]
    m = motion(robot, 1, 50)
    contacts = [Contact(frame=foot, touching=np.ones(50, dtype=bool)) for foot in FEET]
    wanted, believed = (regressor.predict(vector, m.q, m.v, m.a) for vector in (theta, regressor.prior))
    for word, (log, planted, unmeasured) in ways(machine).items():
        result = identify(robot, open_recording(write(tmp_path / "log.csv", log), robot), PLAIN)
        assert word in result.choices.equations
        P = free_projector(unknown_directions(Kinematics(robot), m.q, contacts if planted else (), unmeasured))
        size, seen = (
            np.abs(np.einsum("nij,nj->ni", P, torque)).max()
            for torque in (wanted, result.regressor.predict(result.parameters, m.q, m.v, m.a) - wanted)
        )
        assert seen < 1e-6 * size, word
        assert np.abs(np.einsum("nij,nj->ni", P, believed - wanted)).max() > 1e-3 * size
        assert result.train.relative < 1e-6


def test_measured_contacts_need_no_projection(machine, tmp_path):
    robot, _, log, torques, pressed, flags = machine
    one = read_recording(write(tmp_path / "log.csv", log | torques | pressed | flags), robot)
    assert (one.contacts, one.wrenches) == ((), FEET)


def test_a_recording_with_contacts_is_written_and_read_back(machine, tmp_path):
    robot, _, log, torques, _, flags = machine
    flags = {**flags, "contact_foot_rr": (np.arange(SAMPLES) < 100).astype(float)}
    one = read_recording(write(tmp_path / "log.csv", log | torques | flags), robot)
    other = read_recording(one.write(tmp_path / "again.csv"), robot)
    assert other.contacts == FEET
    np.testing.assert_array_equal(other.touching, one.touching)
    assert other.touching[:, 3].sum() == 100
    assert other.split(0.5)[1].touching.shape == (SAMPLES // 2, 4)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda log, t, p, f: log, RecordingError, "neither torques .* nor wrenches"),
        (lambda log, t, p, f: log | f, RecordingError, "no equation is left in which all forces are known"),
        (lambda log, t, p, f: log | t | f | {"contact_foot_fl": np.full(SAMPLES, 2.0)}, RecordingError, "must be 1"),
        (lambda log, t, p, f: log | t | {"contact": np.ones(SAMPLES)}, RecordingError, "of no frame"),
        (lambda log, t, p, f: log | t | {"contact_foot": np.ones(SAMPLES)}, RecordingError, "did you mean foot_"),
    ],
)
def test_logs_that_tell_too_little_are_refused(machine, tmp_path, change, error, message):
    robot, _, *parts = machine
    with pytest.raises(error, match=message):
        read_recording(write(tmp_path / "log.csv", change(*parts)), robot)


def test_a_foot_that_slides_while_flagged_is_named(machine, tmp_path):
    robot, _, log, torques, _, flags = machine
    log = log | {"v_knee_fl": log["v_knee_fl"] + np.random.default_rng(0).normal(size=SAMPLES)}
    recording = read_recording(write(tmp_path / "log.csv", log | torques | flags), robot)
    with pytest.raises(ParameterError, match=r"contact of 'foot_fl': the frame moves"):
        identify(robot, recording, PLAIN)


def test_recordings_with_other_unknown_forces_are_not_mixed(machine, tmp_path):
    robot, *_ = machine
    paths = [write(tmp_path / f"{k}.csv", log) for k, (log, *_) in enumerate(ways(machine).values())]
    recordings = [read_recording(path, robot) for path in paths[::2]]
    with pytest.raises(RecordingError, match="other forces are unknown"):
        identify(robot, recordings, dataclasses.replace(PLAIN))

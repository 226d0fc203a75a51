"""Wrench and contact columns of robots with a free base."""

import numpy as np
import pinocchio as pin
import pytest

from casysid.errors import RecordingError
from casysid.kinematics import Axes, Kinematics
from casysid.recording import open_recording, read_recording
from casysid.robot import JointKind
from tests.strategies import random_motion, random_robot

SAMPLES = 60


@pytest.fixture(scope="module")
def robot():
    return random_robot(np.random.default_rng(0), [JointKind.FREE_FLYER, JointKind.REVOLUTE, JointKind.REVOLUTE])


@pytest.fixture
def columns(robot):
    """A log of samples without order, on a foot that is the last link, with the forces that Newton wants."""
    q, v, a = random_motion(robot, np.random.default_rng(1), SAMPLES)
    data = robot.model.createData()
    needed = np.array([pin.rnea(robot.model, data, *state) for state in zip(q, v, a, strict=True)])
    J = Kinematics(robot).jacobians("joint_3_link", q, Axes.FRAME)
    w = np.array([np.linalg.solve(one[:, :6].T, tau[:6]) for one, tau in zip(J, needed, strict=True)])
    tau = needed - np.einsum("nij,ni->nj", J, w)
    log = {f"q_{name}": q[:, k] for k, name in enumerate(robot.channels)}
    log |= {f"v_{name}": v[:, k] for k, name in enumerate(robot.dofs)}
    log |= {f"a_{name}": a[:, k] for k, name in enumerate(robot.dofs)}
    log |= {f"tau_{name}": tau[:, k] for k, name in enumerate(robot.dofs) if k >= 6}
    log |= {f"{part}_joint_3_link": w[:, k] for k, part in enumerate(("fx", "fy", "fz", "mx", "my", "mz"))}
    return log, needed


def write(path, log):
    rows = zip(*(map(repr, np.asarray(values, dtype=float).tolist()) for values in log.values()), strict=True)
    path.write_text("\n".join([",".join(log), *map(",".join, rows)]) + "\n")
    return path


def test_wrenches_and_torques_make_what_newton_wants(robot, columns, tmp_path):
    log, needed = columns
    path = write(tmp_path / "log.csv", log)
    for recording in (read_recording(path, robot), open_recording(path, robot).in_memory()):
        np.testing.assert_allclose(recording.torque, needed, atol=1e-9 * np.abs(needed).max())


def test_wrenches_along_the_worlds_axes_are_the_same(robot, columns, tmp_path):
    log, needed = columns
    q = np.column_stack([log[f"q_{name}"] for name in robot.channels])
    R = Kinematics(robot).poses("joint_3_link", q).rotation
    parts = ("fx", "fy", "fz"), ("mx", "my", "mz")
    for names in parts:
        local = np.column_stack([log.pop(f"{name}_joint_3_link") for name in names])
        world = np.einsum("nij,nj->ni", R, local)
        log |= {f"world_{name}_joint_3_link": world[:, k] for k, name in enumerate(names)}
    recording = read_recording(write(tmp_path / "log.csv", log), robot)
    np.testing.assert_allclose(recording.torque, needed, atol=1e-9 * np.abs(needed).max())


def test_components_that_are_not_there_are_zero(robot, columns, tmp_path):
    log, _ = columns
    zero = {name: values * (not name.startswith(("mx", "fy"))) for name, values in log.items()}
    fewer = {name: values for name, values in log.items() if not name.startswith(("mx", "fy"))}
    one, other = (read_recording(write(tmp_path / f"{k}.csv", x), robot) for k, x in enumerate((zero, fewer)))
    np.testing.assert_array_equal(one.torque, other.torque)


def test_without_wrenches_the_base_has_no_torque(robot, columns, tmp_path):
    log = {name: values for name, values in columns[0].items() if name[:2] not in ("fx", "fy", "fz", "mx", "my", "mz")}
    recording = read_recording(write(tmp_path / "log.csv", log), robot)
    assert not recording.torque[:, :6].any()
    np.testing.assert_array_equal(recording.torque[:, 6], log["tau_joint_2"])


def test_a_base_whose_torques_are_logged_keeps_them(robot, columns, tmp_path):
    log, _ = columns
    base = {f"tau_{name}": np.arange(SAMPLES) + k for k, name in enumerate(robot.dofs[:6])}
    plain = {name: values for name, values in log.items() if name[:2] not in ("fx", "fy", "fz", "mx", "my", "mz")}
    recording = read_recording(write(tmp_path / "log.csv", plain | base), robot)
    np.testing.assert_array_equal(recording.torque[:, 2], np.arange(SAMPLES) + 2.0)


def test_a_fixed_base_leaves_such_columns_aside(columns, tmp_path):
    robot = random_robot(np.random.default_rng(0), [JointKind.REVOLUTE])
    rng = np.random.default_rng(0)
    log = {"time": np.arange(60) * 0.01, "q_joint_1": rng.normal(size=60), "tau_joint_1": rng.normal(size=60)}
    recording = read_recording(write(tmp_path / "log.csv", log | {"fx_tool": np.ones(60)}), robot)
    assert recording.unused_columns == ("fx_tool",)
    np.testing.assert_array_equal(recording.torque[:, 0], log["tau_joint_1"])


def without_names(log):
    return {name: values for name, values in log.items() if not name.startswith(("q_", "v_", "a_", "tau_"))}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda log: log | {"fx_foot": np.zeros(SAMPLES)}, "column 'fx_foot': robot .* has no frame 'foot'"),
        (lambda log: log | {"contact_joint_4": np.zeros(SAMPLES)}, "no frame 'joint_4'; did you mean joint_"),
        (lambda log: log | {"contact_joint_2": np.full(SAMPLES, 0.5)}, "'contact_joint_2' must be 1 while .* got 0.5"),
        (lambda log: log | {"contact": np.zeros(SAMPLES)}, "column 'contact' says of no frame that it touches"),
        (lambda log: log | {"world_fx_joint_3_link": np.zeros(SAMPLES)}, "along the world's axes and along its own"),
        (
            lambda log: log | {"fz_joint_3_link": np.where(np.arange(SAMPLES) == 7, np.nan, 1.0)},
            "'fz_joint_3_link' has 1 values that are no finite numbers, the first at .*9",
        ),
        (lambda log: log | {"q_joint_1_qw": np.zeros(SAMPLES), "q_joint_1_qx": np.zeros(SAMPLES)}, "quaternion"),
        (lambda log: {k: v for k, v in log.items() if k != "tau_joint_2"}, "no column .*tau_joint_2"),
    ],
)
def test_bad_columns_get_one_message(robot, columns, tmp_path, change, message):
    log = change(columns[0])
    if "quaternion" in message:
        log |= {"q_joint_1_qy": np.zeros(SAMPLES), "q_joint_1_qz": np.zeros(SAMPLES)}
    with pytest.raises(RecordingError, match=message):
        read_recording(write(tmp_path / "log.csv", log), robot)

"""The same numbers in C, in Pinocchio, in MuJoCo, and after a journey through files."""

import json
import shutil
import subprocess

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.model import read_model, write_model
from casysid.robot import JointKind
from casysid.robot.coordinates import channels_from_configuration
from casysid.simulation.coordinates import Coordinates
from tests.model.models import model_of, plain_models, rich_friction, rich_models
from tests.simulated import bundled_robot
from tests.strategies import random_motion

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def close(got, wanted, tolerance):
    np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance * (1.0 + np.abs(wanted).max(initial=0.0)))


def true_rigid_torque(model, q, v, a):
    """Of bodies and rotors alone, without what the recordings' gains make of it."""
    rest = model.values_of("offset")
    return (np.einsum("nij,nj->ni", model.mass_matrix(q), a) + model.bias(q, v)) / model.torque_gains - rest


@settings(max_examples=6)
@given(plain_models(), seeds)
def test_pinocchio_has_the_same_torques(model, rng):
    q, v, a = random_motion(model.robot, rng, 4)
    other = model.pinocchio()
    data = other.createData()
    got = [pin.rnea(other, data, *state) for state in zip(q, v, a, strict=True)]
    close(np.array(got), true_rigid_torque(model, q, v, a), 1e-9)
    np.testing.assert_array_equal(other.damping, model.damping)
    np.testing.assert_array_equal(other.upperDryFrictionLimit, model.dry_friction)


@settings(max_examples=6)
@given(plain_models((JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC, JointKind.SPHERICAL)), seeds)
def test_mujoco_has_the_same_torques(model, rng):
    """In MuJoCo's order, which is the robot's for these kinds of joints; quaternions have w first."""
    robot, machine = model.robot, model.mujoco()
    machine.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    data = mujoco.MjData(machine)
    for q, v, a in zip(*random_motion(robot, rng, 4), strict=True):
        channels, coordinates = channels_from_configuration(robot, q[None])[0], Coordinates(robot)
        for joint in robot.joints:
            at = machine.joint(joint.name)
            here = channels[joint.channels]
            data.qpos[at.qposadr[0] : at.qposadr[0] + len(here)] = np.roll(here, 1) if len(here) == 4 else here
        rates = np.concatenate([at for at in (machine.joint(joint.name).dofadr for joint in robot.joints)])
        places = np.concatenate([
            np.arange(start, start + joint.v.stop - joint.v.start)
            for start, joint in zip(rates, robot.joints, strict=True)
        ])  # fmt: skip
        data.qvel[places], data.qacc[places] = v, a
        mujoco.mj_inverse(machine, data)
        wanted = true_rigid_torque(model, q[None], v[None], a[None])[0] + model.damping * v
        close(coordinates.force(channels, data.qfrc_inverse[places]), wanted, 1e-9)
        np.testing.assert_array_equal(machine.dof_frictionloss[places], model.dry_friction)
        np.testing.assert_array_equal(machine.dof_armature[places], model.armature)


def test_springs_are_in_mujoco_and_all_else_is_told():
    robot = bundled_robot("two_link.urdf")
    model = model_of(robot, np.random.default_rng(0), rich_friction(robot), gains=(1.0, 1.25))
    np.testing.assert_array_equal(model.mujoco().jnt_stiffness, model.values_of("stiffness"))
    told = " ".join(model.simulator_notes())
    for word in ("shoulder.offset", "elbow.maxwell_slip_2", "stiffness of the joints", "elbow 1.25", "sticks"):
        assert word in told
    assert "shoulder.viscous" not in told


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")
@settings(max_examples=4)
@given(st.one_of(rich_models(min_joints=2), plain_models()))
def test_c_agrees_and_is_warned_of_nothing(tmp_path_factory, model):
    folder = tmp_path_factory.mktemp("c")
    paths = model.write_c(folder, "arm")
    assert [path.name for path in paths] == ["arm.h", "arm.c", "test_arm.c", "CMakeLists.txt"]
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wno-unused-variable", "-Wno-unused-function", "-Werror", "-O2"]
    subprocess.run(["gcc", *flags, "arm.c", "test_arm.c", "-lm", "-o", "test"], cwd=folder, check=True)
    done = subprocess.run(["./test"], cwd=folder, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "")


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")
def test_the_c_test_finds_a_wrong_number(tmp_path):
    model_of(bundled_robot("two_link.urdf"), np.random.default_rng(0)).write_c(tmp_path)
    source = tmp_path / "robot_model.c"
    source.write_text(source.read_text().replace("sin(", "1.000001 * sin(", 1))
    subprocess.run(["gcc", "robot_model.c", "test_robot_model.c", "-lm", "-o", "test"], cwd=tmp_path, check=True)
    done = subprocess.run(["./test"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert "torque: off by" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cmake") is None, reason="there is no CMake")
def test_cmake_builds_and_tests_it(tmp_path):
    model_of(bundled_robot("head.urdf"), np.random.default_rng(0)).write_c(str(tmp_path))
    for command in (["cmake", "-S", ".", "-B", "b"], ["cmake", "--build", "b"], ["ctest", "--test-dir", "b"]):
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)


@pytest.mark.parametrize("name", ["", "7up", "a-b", "é"])
def test_names_that_c_does_not_have_are_refused(name, tmp_path):
    with pytest.raises(ParameterError, match="C identifier"):
        model_of(bundled_robot("two_link.urdf"), np.random.default_rng(0)).write_c(tmp_path, name)
    assert not any(tmp_path.iterdir())


@settings(max_examples=6)
@given(st.one_of(rich_models(), plain_models(tuple(JointKind))), seeds)
def test_files_keep_every_number(tmp_path_factory, model, rng):
    folder = tmp_path_factory.mktemp("model")
    write_model(model, folder)
    back = read_model(str(folder))
    np.testing.assert_array_equal(back.parameters, model.parameters)
    q, v, a = random_motion(model.robot, rng, 4)
    for got, wanted in zip(back.torque(q, v, a, std=True), model.torque(q, v, a, std=True), strict=True):
        close(got, wanted, 1e-12)
    for name in ("damping", "dry_friction", "torque_gains"):
        np.testing.assert_array_equal(getattr(back, name), getattr(model, name))
    for name in (
        "position_lower",
        "position_upper",
        "velocity_limit",
        "effort_limit",
        "gravity",
        "inertial_parameters",
    ):
        np.testing.assert_array_equal(getattr(back.robot, name), getattr(model.robot, name), name)
    assert back.robot.dofs == model.robot.dofs
    assert back.robot.links == model.robot.links
    assert [joint.kind for joint in back.robot.joints] == [joint.kind for joint in model.robot.joints]


@pytest.mark.parametrize("name", ["two_link.urdf", "scara.xml", "head.urdf", "arm.xml"])
def test_bundled_robots_come_back_with_their_limits(name, tmp_path):
    model = model_of(bundled_robot(name), np.random.default_rng(0))
    write_model(model, tmp_path)
    back = read_model(tmp_path).robot
    for name in ("position_lower", "position_upper", "velocity_limit", "effort_limit", "gravity"):
        np.testing.assert_array_equal(getattr(back, name), getattr(model.robot, name), name)
    assert (back.source, back.locked, back.floating_base) == (
        model.robot.source, model.robot.locked, model.robot.floating_base,
    )  # fmt: skip


BROKEN = {
    "robot/joints/1/parent": [1, -2, True, "0", None],
    "robot/joints/0/kind": ["helical", None],
    "robot/joints/0/axis": [[0, 0, 2], [0, 0], "z", [0, 0, None]],
    "robot/joints/0/rotation": [[[1, 0, 0], [0, 1, 0], [0, 0, 2]], [[1]], None],
    "robot/dofs": [["a", "b"], 3],
    "robot/gravity": [[0, 0], [0, 0, 1e300]],
    "robot/inertial_parameters": [[1.0], None],
    "robot/effort_limit": [[1.0], "none"],
    "friction_model": [3, {}, {"columns": [{"kind": "magic"}], "couplings": []}],
    "torque_gains": [[1.0], [0.0, 1.0], None],
    "parameters": [[], {}],
    "parameters/values": [[1.0], None],
    "parameters/names": [["a"], 7],
    "damping": [[1.0], [True, False]],
}


@pytest.mark.parametrize(("path", "value"), [(path, value) for path, values in BROKEN.items() for value in values])
def test_a_file_that_somebody_edited_is_refused_in_one_sentence(path, value, tmp_path):
    write_model(model_of(bundled_robot("two_link.urdf"), np.random.default_rng(0)), tmp_path)
    content = json.loads((tmp_path / "model.json").read_text())
    place = content
    *keys, last = path.split("/")
    for key in keys:
        place = place[int(key) if isinstance(place, list) else key]
    place[last] = value
    (tmp_path / "model.json").write_text(json.dumps(content))
    with pytest.raises(ParameterError, match=r"model\.json"):
        read_model(tmp_path)


@pytest.mark.parametrize("content", [b"", b"PK", b"[]"])
def test_a_broken_covariance_is_refused(content, tmp_path):
    write_model(model_of(bundled_robot("two_link.urdf"), np.random.default_rng(0)), tmp_path)
    (tmp_path / "model.npz").write_bytes(content)
    with pytest.raises(ParameterError, match=r"model\.npz"):
        read_model(tmp_path)
    (tmp_path / "model.npz").unlink()
    assert read_model(tmp_path).scatter is None

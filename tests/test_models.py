"""The bundled models: one machine in two files, physically consistent, and found by name."""

import runpy
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from casysid.bundled import bundled_models, find_model
from casysid.errors import RobotError
from casysid.robot import Robot

NAMES = ("arm", "head", "hopper", "quadrotor", "quadruped", "scara", "two_link")
FLOATING = ("hopper", "quadrotor", "quadruped")
ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module", params=NAMES)
def name(request):
    return request.param


def test_all_models_are_bundled():
    assert bundled_models() == NAMES


def test_a_name_finds_the_urdf_and_a_suffix_chooses(name):
    assert find_model(name).name == f"{name}.urdf"
    assert find_model(f"{name}.xml").name == f"{name}.xml"


def test_a_path_that_exists_wins_over_a_name(tmp_path, monkeypatch):
    (tmp_path / "head").write_text("<robot/>")
    monkeypatch.chdir(tmp_path)
    assert find_model("head") == Path("head")


@pytest.mark.parametrize("wrong", ["hat", "no/such/head", "head.json", ""])
def test_an_unknown_name_lists_the_known_ones(wrong):
    with pytest.raises(RobotError, match="arm, head, hopper, quadrotor, quadruped, scara, two_link"):
        find_model(wrong)


def test_urdf_and_mjcf_have_the_same_inverse_dynamics(name):
    model = mujoco.MjModel.from_xml_path(str(find_model(f"{name}.xml")))
    reference = pin.buildModelFromUrdf(str(find_model(name)))
    reference.armature = model.dof_armature.copy()  # URDF cannot say it
    disable = mujoco.mjtDisableBit
    model.opt.disableflags |= disable.mjDSBL_CONTACT | disable.mjDSBL_LIMIT | disable.mjDSBL_FRICTIONLOSS
    data, reference_data, rng = mujoco.MjData(model), reference.createData(), np.random.default_rng(0)
    at = slice(6 if name in FLOATING else 0, None)  # a base that rests: its coordinates are others in MuJoCo
    for _ in range(50):
        mujoco.mj_resetData(model, data)
        values = rng.normal(size=(3, model.nv))[:, at] * ((1.0,), (3.0,), (20.0,))
        data.qpos[model.nq - values.shape[1] :], data.qvel[at], data.qacc[at] = values
        mujoco.mj_inverse(model, data)
        q = data.qpos.copy()
        if name in FLOATING:
            q[3:7] = 0.0, 0.0, 0.0, 1.0  # MuJoCo's quaternions begin with w
        tau = pin.rnea(reference, reference_data, q, data.qvel.copy(), data.qacc.copy())
        wanted = tau + reference.damping * data.qvel
        np.testing.assert_allclose(data.qfrc_inverse, wanted, rtol=0, atol=1e-9 * max(np.abs(wanted).max(), 1.0))


def test_urdf_and_mjcf_load_as_the_same_robot(name):
    urdf, mjcf = Robot.from_file(find_model(name)), Robot.from_file(find_model(f"{name}.xml"))
    assert urdf.links == mjcf.links
    assert urdf.dofs == mjcf.dofs
    for field in ("inertial_parameters", "damping", "dry_friction", "position_lower", "position_upper", "effort_limit"):
        np.testing.assert_allclose(getattr(urdf, field), getattr(mjcf, field), rtol=1e-12, atol=1e-14)
    assert (mjcf.armature[6 if name in FLOATING else 0 :] > 0).all()


def test_every_link_is_a_body_without_symmetry(name):
    robot = Robot.from_file(find_model(name))
    assert robot.faults == ()
    for theta in robot.inertial_parameters.reshape(-1, 10):
        pseudo_inertia = pin.PseudoInertia.FromDynamicParameters(theta).toMatrix()
        assert np.linalg.eigvalsh(pseudo_inertia)[0] > 0
        assert np.abs(theta[[5, 7, 8]]).min() > 1e-4 * theta[[4, 6, 9]].max()


def test_every_limit_is_finite_and_zero_is_within(name):
    robot = Robot.from_file(find_model(name))
    assert (robot.position_lower <= 0).all()
    assert (robot.position_upper >= 0).all()
    places, ways = (7, 6) if name in FLOATING else (0, 0)  # what is free has no limits
    assert np.isfinite(np.concatenate([robot.position_lower[places:], robot.position_upper[places:]])).all()
    assert np.isfinite(np.concatenate([robot.velocity_limit[ways:], robot.effort_limit[ways:]])).all()


def test_the_zero_pose_touches_nothing(name):
    model = mujoco.MjModel.from_xml_path(str(find_model(f"{name}.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


def test_the_arm_has_the_published_lengths():
    robot = Robot.from_file(find_model("arm"))
    at = {joint.name: joint.placement.translation for joint in robot.joints}
    assert -(at["upper_arm_rotation"] + at["elbow"])[2] == pytest.approx(0.287)
    assert -(at["forearm_rotation"] + at["wrist_flexion"])[2] == pytest.approx(0.278)
    assert (at["elbow"][0], -at["forearm_rotation"][0]) == (0.0381, 0.0025)


def test_the_files_are_what_the_tables_say(name, tmp_path):
    make = runpy.run_path(str(ROOT / "scripts" / "make_models.py"))
    make["write_model"](make["Machine"].read(make["TABLES"] / f"{name}.toml"), tmp_path)
    assert {file.name for file in tmp_path.iterdir()} | {f"{name}.png"} == {
        file.name for file in (ROOT / "models" / name).iterdir()
    }
    for file in tmp_path.iterdir():
        assert file.read_text(encoding="utf-8") == (ROOT / "models" / name / file.name).read_text(encoding="utf-8")


def test_the_payload_of_the_quadrotor_is_what_its_table_says():
    empty, loaded = (Robot.from_file(find_model(name)) for name in ("quadrotor", "quadrotor_loaded"))
    payload = (loaded.inertial_parameters - empty.inertial_parameters).ravel()
    np.testing.assert_allclose(payload[:4], 0.25 * np.array([1.0, 0.02, -0.012, -0.08]), atol=2e-6)


def test_the_gallery_shows_every_model():
    gallery = (ROOT / "models" / "README.md").read_text(encoding="utf-8")
    for name in NAMES:
        assert f"]({name}/{name}.png)" in gallery
        assert f"`casysid rehearse {name}`" in gallery

"""What an identification leaves in its folder is the model that it found."""

import json

import numpy as np
import pytest

import casysid
from casysid.errors import ParameterError
from casysid.estimation import WeightedLeastSquares
from casysid.identification import Settings, identify
from casysid.simulation import PlantSettings
from tests.simulated import bundled_robot, simulated_run


@pytest.fixture(scope="module", params=["two_link.urdf", "two_link.xml"])
def written(request, tmp_path_factory):
    recording = simulated_run(request.param, 0, PlantSettings()).recording
    first, second = recording.split(0.7)
    result = identify(bundled_robot(request.param), first, held_out=[second])
    folder = tmp_path_factory.mktemp("run")
    casysid.write_result(result, str(folder))
    return result, folder


def test_torques_and_their_errors_are_the_same_after_the_journey(written):
    result, folder = written
    saved, motion = casysid.read_result(str(folder)), result.train_motions[0]
    state = motion.q, motion.v, motion.a
    scale = np.abs(motion.tau).max()
    expected = result.predict_torque(*state)
    for model in (result.model, saved.model):
        torque, std = model.torque(*state, time=np.arange(len(motion)), std=True)
        np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-12 * scale)
        assert ((std > 0.0) & (std < 0.2 * scale)).all()
    np.testing.assert_array_equal(saved.parameters, result.parameters)
    np.testing.assert_array_equal(saved.moments.columns, result.moments.columns)
    assert saved.accepted == json.loads((folder / "result.json").read_text())["verdict"]["accepted"]


def test_parameters_have_the_shape_that_functions_want(written):
    result, folder = written
    assert result.inertial_parameters.shape == result.robot.inertial_parameters.shape
    identified = result.robot.with_parameters(inertial_parameters=result.inertial_parameters)
    np.testing.assert_array_equal(identified.inertial_parameters, result.inertial_parameters)
    np.testing.assert_array_equal(casysid.read_result(folder).inertial_parameters, result.inertial_parameters)


def test_drives_are_beside_a_file_that_has_no_place_for_them(written):
    result, folder = written
    if result.robot.source_format == "mjcf":
        assert not (folder / "drive.yaml").exists()
        return
    lines = (folder / "drive.yaml").read_text().splitlines()
    start = lines.index('  "elbow":')
    for k, (name, unit) in enumerate((("armature", "kg m^2"), ("damping", "N m s/rad"), ("dry_friction", "N m")), 1):
        assert lines[start + k] == f"    {name}: {float(getattr(result.model, name)[1])!r}  # {unit}"
    assert sum(line.startswith('  "') for line in lines) == 2 + len(result.parameters) - 20


def test_objects_introduce_themselves_in_a_line(written):
    result, folder = written
    for one, word in (
        (result, "held-out"),
        (result.robot, "2 degrees of freedom"),
        (casysid.read_result(folder), "ed,"),
    ):
        assert word in repr(one)
        assert len(repr(one)) < 250
        assert str(one) == repr(one)


@pytest.mark.parametrize("content", [None, "[]", "{", '{"verdict": 3}'])
def test_a_folder_without_a_result_is_refused(content, tmp_path):
    if content is not None:
        (tmp_path / "result.json").write_text(content)
    with pytest.raises(ParameterError, match=r"result\.json"):
        casysid.read_result(tmp_path)


def test_a_result_of_an_earlier_version_is_told_what_is_missing(tmp_path):
    settings = Settings(method=WeightedLeastSquares(), cutoff=12.0, choose_friction=False)
    recording = simulated_run("two_link.urdf", 0, PlantSettings()).recording
    casysid.write_result(identify(bundled_robot("two_link.urdf"), recording, settings), tmp_path)
    (tmp_path / "model.json").unlink()
    with pytest.raises(ParameterError, match=r"model\.json.*no such file"):
        casysid.read_result(tmp_path)

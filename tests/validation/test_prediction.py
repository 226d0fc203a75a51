"""A model file judged on recordings: its own parameters, and nothing else."""

import dataclasses
import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from casysid.bundled import find_model
from casysid.cli.rehearse import rehearse as rehearse_verb
from casysid.cli.validate import validate as validate_verb
from casysid.errors import ParameterError
from casysid.identification import Settings, identify
from casysid.identification.output import write_result
from casysid.robot import Robot
from casysid.simulation import PlantSettings
from casysid.validation import EarlierResult, read_earlier_result, validate
from tests.simulated import bundled_robot, simulated_run

CUTOFF = 20.0
app = typer.Typer()
app.command()(validate_verb)
app.command()(rehearse_verb)


@pytest.fixture(scope="module")
def recordings():
    return [simulated_run("two_link", seed, PlantSettings()).recording for seed in (0, 1)]


@pytest.fixture(scope="module")
def identified(recordings, tmp_path_factory):
    """Folder with an identified model and its result."""
    out = tmp_path_factory.mktemp("identified")
    settings = Settings(cutoff=CUTOFF, coulomb_width=0.02)
    write_result(identify(bundled_robot("two_link"), recordings[0], settings), out)
    return out


def test_the_files_own_parameters_are_judged(recordings):
    validation = validate(bundled_robot("two_link"), recordings, cutoff=CUTOFF)
    content = validation.to_json()
    assert content["samples"] == sum(len(recording) for recording in recordings)
    assert len(content["recordings"]) == 2
    assert set(content["torque_rmse"]) == set(bundled_robot("two_link").dofs)
    np.testing.assert_array_equal(validation.parameters, validation.regressor.prior)
    each = [part["relative_error"] for part in content["recordings"]]
    assert min(each) <= content["relative_error"] <= max(each)


def test_an_identified_file_needs_its_result_for_what_urdf_cannot_hold(recordings, identified):
    robot = Robot.from_file(identified / "identified.urdf")
    earlier = read_earlier_result(identified / "result.json")
    alone = validate(robot, recordings[1:], cutoff=CUTOFF).total.relative
    whole = validate(robot, recordings[1:], earlier=earlier).total.relative
    assert earlier.cutoff == CUTOFF
    assert whole < alone
    assert whole < 0.05


def test_signs_clock_and_gains_of_the_result_are_those_of_the_identification(recordings, identified):
    robot, earlier = Robot.from_file(identified / "identified.urdf"), read_earlier_result(identified / "result.json")
    plain = validate(robot, recordings[1:], earlier=earlier).total
    gains = dict(zip(robot.dofs, (0.8, 1.25), strict=True))
    recording = recordings[1]
    read = dataclasses.replace(
        recording.flipped([f"tau_{robot.dofs[0]}"]).with_time_scaled(0.5), torque=recording.torque * [-0.8, 1.25]
    )
    earlier = dataclasses.replace(earlier, flip=(f"tau_{robot.dofs[0]}",), time_scale=2.0, torque_gains=gains)
    again = validate(robot, [read], earlier=earlier).total
    assert again.relative_by_joint == pytest.approx(plain.relative_by_joint, rel=1e-6)


def test_another_robots_result_is_refused(recordings, identified):
    drives = read_earlier_result(identified / "result.json").drives
    other = EarlierResult(drives={f"left_{owner}": kinds for owner, kinds in drives.items()})
    with pytest.raises(ParameterError, match="Is this the result of another robot"):
        validate(bundled_robot("two_link"), recordings, earlier=other, cutoff=CUTOFF)
    with pytest.raises(ParameterError, match="at least one recording"):
        validate(bundled_robot("two_link"), [])


@pytest.mark.parametrize("text", ["", "{}", '{"friction": {}}', "[1]"])
def test_a_file_that_is_no_result_is_refused(tmp_path, text):
    path = tmp_path / "result.json"
    path.write_text(text)
    with pytest.raises(ParameterError, match=r"wanted the result\.json of an identification"):
        read_earlier_result(path)
    with pytest.raises(ParameterError, match=r"wanted the result\.json of an identification"):
        read_earlier_result(tmp_path / "absent.json")


def test_validate_writes_json_and_prints_a_table(recordings, identified, tmp_path):
    logs = [
        recording.write(tmp_path / f"run{k}.csv") or tmp_path / f"run{k}.csv" for k, recording in enumerate(recordings)
    ]
    arguments = ["validate", identified / "identified.urdf", *logs, "--result", identified / "result.json"]
    answer = CliRunner().invoke(app, [str(one) for one in [*arguments, "--out", tmp_path / "out"]])
    assert answer.exit_code == 0, answer.output
    assert answer.stdout.strip().endswith("validation.json")
    content = json.loads((tmp_path / "out" / "validation.json").read_text())
    assert content["cutoff"]["hz"] == CUTOFF
    assert content["relative_error"] < 0.05
    assert "By recording" in answer.stderr


def test_bad_input_ends_with_two_and_one_message(tmp_path):
    answer = CliRunner().invoke(app, ["validate", str(find_model("two_link")), str(tmp_path / "absent.csv")])
    assert answer.exit_code == 2
    assert "error:" in answer.stderr
    answer = CliRunner().invoke(app, ["rehearse", "two_link", "--duration", "1", "--out", str(tmp_path)])
    assert answer.exit_code == 2
    assert "--duration wants 4 to 3600 s" in answer.stderr

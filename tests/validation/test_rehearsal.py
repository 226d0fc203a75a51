"""A rehearsal finds what it has hidden, and says how well."""

import dataclasses
import json

import numpy as np
import pytest

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.excitation import after_result, build_excitation
from casysid.identification import Settings
from casysid.report.rehearsal_pictures import write_rehearsal_pictures
from casysid.report.validation_tables import rehearsal_tables
from casysid.robot import Robot
from casysid.simulation import IDEAL
from casysid.validation import Excitation, RehearsalSettings, rehearse, true_coefficients, write_rehearsal


@pytest.fixture(scope="module")
def rehearsal():
    stages = []
    settings = RehearsalSettings(duration=6.0, identification=Settings(cutoff=20.0, coulomb_width=0.02))
    answer = rehearse(Robot.from_file(find_model("two_link")), settings, lambda stage, share: stages.append(stage))
    assert {"record", "record again", "moments", "track: identified"} <= set(stages)
    return answer


def test_identified_parameters_come_nearer_to_the_truth_than_the_files(rehearsal):
    error = {name: values.mean() for name, values in rehearsal.torque_error.items()}
    assert error["identified"] < 0.4 * error["file"]
    assert error["identified"] < 1.5 * error["true"] + 0.01
    assert rehearsal.base.improvement() < 0.6


def test_tracking_improves_to_near_the_limit(rehearsal):
    position = {name: tracking.means()["position"] for name, tracking in rehearsal.tracking.items()}
    assert position["identified"] < 0.7 * position["file"]
    assert position["identified"] < 1.2 * position["true"]


def test_base_parameters_make_the_torque_that_all_parameters_make(rehearsal):
    regressor, base, run = rehearsal.result.regressor, rehearsal.result.structural, rehearsal.held_out
    theta = true_coefficients(rehearsal.plant, regressor)
    leading = np.zeros_like(theta)
    leading[base.independent] = rehearsal.base.true
    states = (run.q[::50], run.v[::50], run.a[::50])
    np.testing.assert_allclose(regressor.predict(leading, *states), regressor.predict(theta, *states), atol=1e-6)


def test_a_rehearsal_on_disk_is_whole(rehearsal, tmp_path):
    write_rehearsal(rehearsal, tmp_path)
    pictures = write_rehearsal_pictures(rehearsal, tmp_path)
    content = json.loads((tmp_path / "rehearsal.json").read_text())
    assert set(content["tracking"]) == {"file", "identified", "true"}
    assert set(content["true_torque_error"]["identified"]["by_joint"]) == set(rehearsal.plant.robot.dofs)
    assert len(content["base_parameters"]["combinations"]) == rehearsal.result.structural.rank
    assert (tmp_path / "identified.urdf").exists()
    assert (tmp_path / "result.json").exists()
    known = after_result(build_excitation(rehearsal.plant.robot), tmp_path).known
    values = np.linalg.eigvalsh(known)
    assert values[-1] > 0.0
    assert values[0] > -1e-9 * values[-1]
    assert len(pictures) == 3
    for path in pictures:
        assert path.read_bytes().startswith(b"\x89PNG")
    assert not list(tmp_path.glob("*.part"))
    assert all(table.rows for _, table in rehearsal_tables(rehearsal))


def test_a_designed_motion_tells_more_than_sinusoids(rehearsal):
    settings = dataclasses.replace(rehearsal.settings, excitation=Excitation.DESIGNED)
    designed = rehearse(rehearsal.plant.robot, settings)
    std, other = (dict(zip(one.base.names, one.base.std, strict=True)) for one in (designed, rehearsal))
    both = [name for name in std if name in other]
    assert len(both) > 0.7 * len(other)
    assert np.exp(np.mean([np.log(std[name] / other[name]) for name in both])) < 0.7
    np.testing.assert_array_equal(designed.held_out.reference.q, rehearsal.held_out.reference.q)


def test_an_ideal_machine_is_found_closely():
    """Its dry friction is Coulomb's: beside others like it in the usual model its coefficient would be shared."""
    known = Settings(cutoff=60.0, coulomb_width=0.02, choose_friction=False)
    settings = RehearsalSettings(duration=5.0, plant=IDEAL, identification=known, seed=1)
    answer = rehearse(Robot.from_file(find_model("two_link")), settings)
    assert answer.base.improvement() < 0.2
    assert answer.tracking["identified"].means()["position"] < 2e-3


@pytest.mark.parametrize(("change", "message"), [({"duration": 1.0}, "at least 4 s"), ({"seed": -1}, "from 0 up")])
def test_settings_without_sense_are_refused(change, message):
    with pytest.raises(ParameterError, match=message):
        dataclasses.replace(RehearsalSettings(), **change)

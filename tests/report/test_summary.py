"""What a report says in plain words, how sure its numbers are, and where they come from."""

import hashlib

import numpy as np
import pytest

from casysid.identification import Settings, identify
from casysid.identification.result import JOINT_KINDS, is_dry
from casysid.report import drive_table, further_drive_table, link_table, render_report
from casysid.report.summary import Origin, base_parameter_table, base_parameters, summary_sentences
from casysid.report.tables import as_sure, with_error
from casysid.simulation import PlantSettings
from tests.simulated import bundled_robot, simulated_run


@pytest.fixture(scope="module")
def result():
    runs = [simulated_run("two_link.urdf", seed, PlantSettings()).recording for seed in (0, 1)]
    settings = Settings(cutoff=20.0, coulomb_width=0.02, delay=0.0, choose_friction=False)
    return identify(bundled_robot("two_link.urdf"), runs[0], settings, held_out=runs[1:])


def test_four_sentences_tell_what_how_well_what_to_trust_and_what_next(result):
    what, well, trust, after = summary_sentences(result)
    assert "'two_link', 2 links and 2 degrees of freedom" in what
    assert f"{result.held_out.samples} that were held out" in what
    assert "held-out torque" in well
    assert f"of the {result.structural.rank} combinations" in trust
    assert "no single mass is the data's" in trust
    assert after.startswith("Next: ")


def test_base_parameters_and_errors_are_those_of_the_combinations(result):
    value, std = base_parameters(result)
    np.testing.assert_allclose(value, result.structural.transform @ result.parameters)
    covariance = result.uncertainty.covariance
    wanted = np.sqrt(np.einsum("rp,pk,rk->r", result.structural.transform, covariance, result.structural.transform))
    np.testing.assert_allclose(std, wanted, rtol=1e-9)
    table = base_parameter_table(result)
    assert [row[0] for row in table.rows] == list(result.structural.words())
    assert {row[3] for row in table.rows} <= {"kg", "kg m", "kg m^2", "N m", "N m s/rad"}


def test_numbers_have_no_more_digits_than_they_are_known_by(result):
    assert as_sure(1.23456, np.inf, 4) == "~1.2"
    assert as_sure(1.23456, 0.1, 4) == "1.235"
    assert with_error(0.5432, 0.0123) == "0.543 ± 0.012"
    assert with_error(0.5432, np.inf) == "~0.54"
    assert with_error(None, None) == "–"
    assert link_table(result).rows[0][1].startswith("~")  # no torque depends on the first link's mass
    drives = drive_table(result)
    assert drives.header[1:3] == ("dry [N m]", "viscous [N m s/rad]")
    assert all("±" in row[2] for row in drives.rows)


def test_a_drive_table_is_narrow_and_all_else_has_a_row(result):
    assert {title.split(" [")[0] for title in drive_table(result).header} <= {"joint", "dry", *JOINT_KINDS}
    values = dict(zip(result.regressor.names, zip(result.parameters, result.uncertainty.std, strict=True), strict=True))
    shown = {f"{owner}.{kind}" for owner, kind, *_ in further_drive_table(result).rows}
    assert all(abs(values[name][0]) > values[name][1] for name in shown)
    others = [p.name for p in result.regressor.parameters[10 * len(result.robot.links) :]]
    told = {name for name in others if abs(values[name][0]) > values[name][1]}
    plain = {name for name in others if is_dry(name.split(".", 1)[1]) or name.split(".", 1)[1] in JOINT_KINDS}
    assert shown == told - plain


def test_the_report_names_inputs_settings_and_command(result, tmp_path):
    log = tmp_path / "log.csv"
    log.write_bytes(b"time,q1\n")
    origin = Origin.of([log, tmp_path / "gone.csv"], ["casysid", "identify", "my arm.urdf"])
    text = render_report(result, origin)
    for word in (
        hashlib.sha256(b"time,q1\n").hexdigest(), "gone.csv", "casysid identify &#39;my arm.urdf&#39;", "cutoff = 20.0",
        "What the torque depends on", "Next: ",
    ):  # fmt: skip
        assert word in text, word
    assert "Where it comes from" in render_report(result)

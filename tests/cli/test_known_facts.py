"""Weighed and kept links on the command line."""

import json

import pytest
from typer.testing import CliRunner

from casysid.bundled import find_model
from casysid.cli.app import app
from casysid.simulation import PlantSettings
from tests.simulated import bundled_robot, simulated_run

URDF = str(find_model("two_link.urdf"))


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "run.csv"
    simulated_run("two_link.urdf", 0, PlantSettings()).recording.write(path)
    return path


def run(log, out, *options):
    usual = ("--friction", "plain", "--method", "wls", "--cutoff", "12", "--delay", "0", "--out", str(out))
    return CliRunner().invoke(app, ["identify", URDF, str(log), *usual, *options])


def masses(out):
    links = json.loads((out / "result.json").read_text())["links"]
    return [links[name]["mass"] for name in ("upper_link", "fore_link")]


def test_the_answer_obeys_what_was_weighed_and_keeps_what_was_to_stay(log, tmp_path):
    assert run(log, tmp_path / "a", "--mass-total", "4.1").exit_code == 0
    assert sum(masses(tmp_path / "a")) == pytest.approx(4.1, rel=1e-6)
    assert run(log, tmp_path / "b", "--mass", "fore_link=1.234").exit_code == 0
    assert masses(tmp_path / "b")[1] == pytest.approx(1.234, rel=1e-6)
    assert run(log, tmp_path / "c", "--keep", "fore_link").exit_code == 0
    assert masses(tmp_path / "c")[1] == pytest.approx(bundled_robot("two_link.urdf").inertial_parameters[10], rel=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--mass", "fore_link"), "--mass wants LINK=KG"),
        (("--mass", "nose=1"), "no moving link called 'nose'"),
        (("--keep", "nose"), "its links are upper_link, fore_link"),
        (("--mass-total", "-3"), "--mass-total wants"),
        (("--mass", "fore_link=nan"), "--mass wants"),
    ],
)
def test_what_cannot_be_is_said(options, message, log, tmp_path):
    answer = run(log, tmp_path / "out", *options)
    assert answer.exit_code == 2
    assert message in " ".join(answer.stderr.split())

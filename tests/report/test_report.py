"""Tables and the HTML report of one identification: complete, in the right units, and one file alone."""

import dataclasses
import html.parser
import math

import numpy as np
import pytest

from casysid.identification import Settings, identify
from casysid.report import drive_table, error_table, link_table, noise_table, render_report, write_report
from casysid.report.overview import robot_tables
from casysid.report.tables import number, percent, torque_unit, torque_units
from casysid.robot import JointKind
from casysid.signals import NoiseLevels, find_input_noise
from casysid.simulation import PlantSettings
from tests.simulated import bundled_robot, simulated_run
from tests.strategies import random_robot

UNIT = {JointKind.REVOLUTE: "N m", JointKind.PRISMATIC: "N"}


@pytest.fixture(scope="module")
def result():
    runs = [simulated_run("two_link", seed, PlantSettings()).recording for seed in (0, 1)]
    settings = Settings(cutoff=20.0, coulomb_width=0.02, delay=0.0, choose_friction=False)
    return identify(bundled_robot("two_link"), runs[0], settings, held_out=runs[1:])


@pytest.mark.parametrize("kinds", [(JointKind.REVOLUTE,), (JointKind.PRISMATIC,), tuple(UNIT)])
def test_torques_have_the_units_of_their_joints(kinds):
    robot = random_robot(np.random.default_rng(0), kinds)
    wanted = [UNIT[joint.kind] for joint in robot.joints]
    assert [torque_unit(robot, dof) for dof in range(robot.nv)] == wanted
    assert set(torque_units(robot).split(", ")) == set(wanted)


def test_numbers_are_written_as_people_do():
    assert [number(x) for x in (1234.5678, None, math.nan, math.inf, 0.0)] == ["1235", "–", "–", "∞", "0"]
    assert [percent(x) for x in (0.12345, None, 12.0)] == ["12.35 %", "–", "12 ×"]


def test_every_row_has_a_cell_for_every_title(result):
    recording = simulated_run("two_link", 0, PlantSettings()).recording
    noisy = dataclasses.replace(result, input_noise=find_input_noise(recording, NoiseLevels(), as_logged=False))
    tables = [*(make(result) for make in (error_table, drive_table, link_table)), noise_table(noisy)]
    tables += [table for _, table in robot_tables(result.robot)]
    for table in tables:
        assert table.rows
        assert {len(row) for row in table.rows} == {len(table.header)}


def test_noise_that_no_method_needed_is_not_told(result):
    assert noise_table(result) is None


def test_the_error_table_tells_the_held_out_error_of_every_joint(result):
    table = error_table(result)
    shown = {row[0]: row[2] for row in table.rows}
    assert shown["all joints"] == percent(result.held_out.relative)
    for dof, error in zip(result.robot.dofs, result.held_out.relative_by_joint, strict=True):
        assert shown[dof] == percent(error)


def test_the_report_is_one_file_that_asks_for_no_other(result, tmp_path):
    asked = []

    class Reader(html.parser.HTMLParser):
        def handle_starttag(self, tag, attributes):
            asked.extend(value for name, value in attributes if name in ("src", "href"))

    write_report(result, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    Reader().feed(text)
    assert asked
    assert all(value.startswith("data:image/png;base64,") for value in asked)
    assert all(name in text for name in (*result.robot.dofs, *result.robot.links))
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert render_report(result).count("<table") >= 4

"""What decided each parameter: the data, the model file, or nothing that anyone could see."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.estimation import Ridge, WeightedLeastSquares
from casysid.identifiability import Identifiability, base_parameters_of_gram
from casysid.identification import Excitation, Settings, identify, torque_band
from casysid.identification.result import without_infinities
from casysid.identification.sources import Sources, sources_of
from casysid.moments import Moments
from casysid.report.tables import source_table
from tests.simulated import bundled_robot, simulated_run
from tests.strategies import generators

LAWS = settings(max_examples=20, deadline=None)
NAMES = ("a", "b", "c", "d")


def problem(rng: np.random.Generator, level: float):
    """Rows that show a, b + c and, at a level, d; and what perfect rows would show."""
    x = rng.normal(size=(400, 3)) * [1.0, 1.0, level]
    rows = x @ np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    y = rows @ np.array([1.0, -2.0, 0.5, 3.0]) + 0.1 * rng.normal(size=400)
    structural = base_parameters_of_gram(
        np.diag([1.0, 0, 0, 1.0]) + np.outer([0, 1.0, 1.0, 0], [0, 1.0, 1.0, 0]), NAMES
    )
    return Moments.from_rows(rows, y, columns=NAMES, blocks=10), structural


@LAWS
@given(generators(), st.sampled_from([WeightedLeastSquares(), Ridge(), Ridge(strength=0.1)]))
def test_data_decide_no_more_than_the_mechanism_lets_them(rng, estimator):
    moments, structural = problem(rng, 1.0)
    sources = sources_of(estimator.estimate(moments).spread, structural)
    assert (sources.by_data >= 0.0).all()
    assert (sources.by_data <= sources.decidable).all()
    assert sources.decidable == pytest.approx([1.0, 0.5, 0.5, 1.0], abs=0.1)


@LAWS
@given(generators())
def test_a_stronger_pull_leaves_more_to_the_file(rng):
    moments, structural = problem(rng, 1.0)
    shares = [sources_of(Ridge(strength=s).estimate(moments).spread, structural).by_data for s in (1e-3, 0.1, 10.0)]
    assert (shares[0] > shares[1]).all()
    assert (shares[1] > shares[2]).all()


def test_a_ridge_of_strength_one_shares_a_standardised_column_in_halves():
    x = np.sqrt(3.0) * np.repeat(np.eye(3), 100, axis=0)
    moments = Moments.from_rows(x, x @ np.ones(3), columns=NAMES[:3], blocks=10)
    structural = base_parameters_of_gram(np.eye(3), NAMES[:3])
    sources = sources_of(Ridge(strength=1.0).estimate(moments).spread, structural)
    assert sources.by_data == pytest.approx(0.5, rel=1e-6)
    assert sources.excitation == (Excitation.WEAK,) * 3


@pytest.mark.parametrize(("level", "expected"), [(1.0, Excitation.EXCITED), (0.0, Excitation.NOT)])
def test_what_the_recording_does_not_show_is_not_excited(level, expected):
    moments, structural = problem(np.random.default_rng(0), level)
    sources = sources_of(WeightedLeastSquares().estimate(moments).spread, structural)
    assert sources.excitation == (*(Excitation.EXCITED,) * 3, expected)
    assert ("d" in sources.of_the_file) == (expected is Excitation.NOT)


def test_what_no_torque_depends_on_is_told_apart_from_what_is_not_excited():
    words = Identifiability.NOT_AT_ALL, Identifiability.ALONE
    sources = Sources(("x", "y"), words, np.array([0.4, 0.0]), np.array([0.5, 1.0]))
    assert sources.excitation == (Excitation.IMPOSSIBLE, Excitation.NOT)


@pytest.fixture(scope="module")
def result():
    train, test = (simulated_run("two_link.urdf", seed).recording for seed in (0, 1))
    return identify(bundled_robot("two_link.urdf"), train, Settings(cutoff=12.0), held_out=[test])


def test_every_link_says_where_its_parameters_come_from(result):
    content = json.loads(json.dumps(without_infinities(result.to_json())))
    base, fore = content["links"]["upper_link"], content["links"]["fore_link"]
    assert base["identifiable"]["mass"] == "not at all"
    assert base["excited"]["mass"] == "no torque depends on it"
    assert fore["excited"]["center_of_mass"][0] == "excited"
    assert fore["decided_by_data"]["center_of_mass"][0] > 0.9
    assert "upper_link.Ixx" in content["decided_by_the_file"]
    assert "fore_link.mcx" not in content["decided_by_the_file"]
    assert content["friction_decided_by_data"]["shoulder"]["viscous"] > 0.9


def test_the_report_names_every_parameter_of_every_link_once(result):
    rows = source_table(result).rows
    for link in result.robot.links:
        kinds = [kind for row in rows if row[0] == link for kind in row[1].split(", ")]
        assert len(kinds) == len(set(kinds)) == 10


def test_the_band_holds_the_torque_that_was_measured(result):
    (motion,) = result.held_out_motions
    band = torque_band(result, motion)
    assert band.shape == motion.tau.shape
    held_out = result.held_out
    error = np.abs(held_out.measured[0] - held_out.predictions[0])
    there = np.column_stack([np.interp(held_out.times[0], motion.time, own) for own in band.T])
    assert (np.mean(error <= there, axis=0) > 0.85).all()
    assert (torque_band(result, motion, 0.5) < band).all()
    assert (band > result.train.rmse).all()

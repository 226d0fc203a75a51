"""Comparing methods gives each the answer that it gives alone."""

import dataclasses

import numpy as np
import pytest

from casysid.estimation import ESTIMATORS, ErrorsInVariables
from casysid.identification import Settings, compare, identify, prepare
from casysid.simulation import PlantSettings
from tests.simulated import bundled_robot, simulated_run

SETTINGS = Settings(cutoff=10.0, delay=0.0)
METHODS = [kind() for kind in ESTIMATORS]
pytestmark = pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")  # of methods


@pytest.fixture(scope="module")
def recordings():
    return [simulated_run("two_link.urdf", seed, PlantSettings(), 4.0).recording for seed in (0, 1)]


@pytest.fixture(scope="module")
def comparison(recordings):
    robot, fitted, unseen = bundled_robot("two_link.urdf"), recordings[0], recordings[1:]
    preparation = prepare(robot, fitted, SETTINGS, held_out=unseen, noise_too=True)
    return compare(preparation, METHODS, SETTINGS)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_method_alone_gives_what_it_gives_among_others(method, recordings, comparison):
    among = comparison.results[method.name]
    robot, settings = bundled_robot("two_link.urdf"), dataclasses.replace(SETTINGS, method=method)
    alone = identify(robot, recordings[0], settings, held_out=recordings[1:])
    assert alone.regressor.names == among.regressor.names
    np.testing.assert_allclose(alone.estimate.parameters, among.estimate.parameters, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(alone.parameters, among.parameters, rtol=1e-9, atol=1e-12)
    assert alone.held_out.relative == pytest.approx(among.held_out.relative, rel=1e-9)


def test_every_method_has_its_answer_and_they_are_ranked_by_the_held_out_error(comparison):
    assert not comparison.failures
    errors = [comparison.results[name].held_out.relative for name in comparison.ranked()]
    assert errors == sorted(errors)
    assert set(comparison.results) == {method.name for method in METHODS}


def test_noise_that_is_known_changes_errors_in_variables_alone(comparison, recordings):
    """Other methods give the same whether noise is taken or not."""
    robot = bundled_robot("two_link.urdf")
    without = compare(prepare(robot, recordings[0], SETTINGS), METHODS, SETTINGS)
    changed = {
        name
        for name, result in comparison.results.items()
        if not np.allclose(result.estimate.parameters, without.results[name].estimate.parameters, rtol=1e-9)
    }
    assert ErrorsInVariables.name in changed
    users = {method.name for method in METHODS if method.needs_input_noise}
    assert changed <= users

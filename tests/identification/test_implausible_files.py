"""A file whose inertias no body has ends where a good one ends, and says so."""

import warnings

import numpy as np
import pytest

from casysid.errors import CasysidWarning
from casysid.identification import Settings, identify
from casysid.inertia import inertial_parameters, mass_properties
from casysid.projection import KeptLink
from casysid.simulation import PlantSettings
from tests.simulated import bundled_robot, simulated_run


def spoilt(robot, kind):
    """The robot's file wrong in one way."""
    body = mass_properties(robot.inertial_parameters.reshape(-1, 10))
    mass, center, inertia = body.mass, body.center_of_mass, body.inertia
    match kind:
        case "identity":
            inertia = np.tile(np.eye(3), (len(mass), 1, 1))
        case "grams":
            mass = 1e3 * mass
        case "one link in g mm²":
            inertia = np.array([1e9 * inertia[0], *inertia[1:]])
    return robot.with_parameters(inertial_parameters=inertial_parameters(mass, center, inertia).ravel())


@pytest.fixture(scope="module", params=[0, 1])
def run(request):
    robot, recording = (
        bundled_robot("two_link.urdf"),
        simulated_run("two_link.urdf", request.param, PlantSettings()).recording,
    )
    return robot, recording, identify(robot, recording)


@pytest.mark.parametrize("kind", ["identity", "grams", "one link in g mm²"])
def test_the_answer_is_that_of_a_good_file(run, kind):
    robot, recording, good = run
    with pytest.warns(CasysidWarning, match="not leaned on"):
        result = identify(spoilt(robot, kind), recording)
    assert result.choices.clock.scale == 1.0
    assert not result.choices.clock.quasi_static
    assert not result.choices.gains.found
    assert result.train.relative < 1.5 * good.train.relative
    assert result.file.relative > 10.0 * good.file.relative  # told of the file as it is


def test_a_link_that_is_to_be_kept_is_not_replaced(run):
    robot, recording, _ = run
    robot = spoilt(robot, "one link in g mm²")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = identify(robot, recording, Settings(knowledge=(KeptLink(robot.links[0]),)))
    assert not [one for one in caught if "not leaned on" in str(one.message)]
    np.testing.assert_allclose(result.parameters[:10], robot.inertial_parameters[:10], rtol=1e-6)

"""A hidden truth is a machine that could be, near its file, the same for the same seed."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import CasysidWarning, ParameterError
from casysid.inertia import smallest_eigenvalue
from casysid.robot import JointKind, Robot
from casysid.simulation import Mechanics, Plant
from casysid.validation import hidden_truth
from tests.strategies import robots

DATA = Path(__file__).parents[3] / "shared" / "data"
FILES = sorted(DATA.glob("*/*.urdf"))
FIXED = [kind for kind in JointKind if kind is not JointKind.FREE_FLYER]


@settings(max_examples=25, deadline=None)
@given(robots(max_joints=3), st.integers(0, 99), st.floats(0.0, 1.0))
def test_every_hidden_truth_is_physically_consistent(robot, seed, spread):
    theta = hidden_truth(robot, Mechanics(), seed, inertia_spread=spread)
    links = theta[: robot.inertial_parameters.size].reshape(-1, 10)
    assert (smallest_eigenvalue(links) > 0.0).all()
    Plant(robot, given=theta)  # friction and armature are not negative


@settings(max_examples=15, deadline=None)
@given(robots(max_joints=3, kinds=FIXED), st.integers(0, 99))
def test_no_spread_leaves_the_file_nearly_as_it_is(robot, seed):
    theta = hidden_truth(robot, Mechanics(), seed, inertia_spread=0.0, friction_spread=0.0)
    np.testing.assert_allclose(theta, Plant(robot).parameters, rtol=0, atol=0.01 * np.abs(theta).max())


def test_seeds_make_different_machines_and_the_same_one_again():
    robot = Robot.from_file(find_model("two_link"))
    first, again, other = (hidden_truth(robot, Mechanics(), seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    masses = slice(0, 20, 10)
    assert (first[masses] != other[masses]).all()
    with pytest.raises(ParameterError, match="spreads must be numbers from 0 up"):
        hidden_truth(robot, Mechanics(), 0, inertia_spread=-1.0)


@pytest.mark.skipif(not FILES, reason="the real robots' files are not beside this checkout")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_real_robots_file_becomes_a_machine_that_can_be_built(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CasysidWarning)  # some files' inertias are no bodies'
        robot = Robot.from_file(path)
    Plant(robot, given=hidden_truth(robot, Mechanics(), 3)).build(0.001)

"""Sinusoids: within the limits, from rest to rest, and their derivatives are their derivatives."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import CasysidWarning, ParameterError
from casysid.robot import Robot
from casysid.simulation import design_sinusoids
from tests.strategies import robots


@pytest.fixture(scope="module", params=["two_link", "scara", "head", "arm"])
def robot(request):
    return Robot.from_file(find_model(request.param))


def test_limits_hold_at_every_instant(robot):
    for seed in range(3):
        motion = design_sinusoids(robot, duration=8.0, seed=seed).sample(np.linspace(0.0, 8.0, 4001))
        assert (motion.q >= robot.position_lower).all()
        assert (motion.q <= robot.position_upper).all()
        assert (np.abs(motion.v) <= robot.velocity_limit).all()
        data = robot.model.createData()
        tau = [pin.rnea(robot.model, data, *x) for x in zip(motion.q, motion.v, motion.a, strict=True)]
        assert (np.abs(tau) <= robot.effort_limit).all()


def test_all_joints_move(robot):
    motion = design_sinusoids(robot, duration=8.0).sample(np.linspace(0.0, 8.0, 801))
    assert (np.ptp(motion.q, axis=0) > 0.2 * (robot.position_upper - robot.position_lower)).all()


def test_the_seed_decides():
    robot = Robot.from_file(find_model("two_link"))
    first, same, other = (design_sinusoids(robot, duration=4.0, seed=s).sample(np.array([2.0])).q for s in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert (first != other).all()


@settings(max_examples=25, deadline=None)
@given(robots(max_joints=3), st.integers(0, 100))
def test_velocity_and_acceleration_are_derivatives_for_any_joint(robot, seed):
    time, h = np.linspace(0.1, 3.9, 12), 1e-5
    motion = design_sinusoids(robot, duration=4.0, seed=seed)
    before, now, after = (motion.sample(time + shift) for shift in (-h, 0.0, h))
    v = [pin.difference(robot.model, p, q) / (2 * h) for p, q in zip(before.q, after.q, strict=True)]
    np.testing.assert_allclose(now.v, v, atol=1e-6)
    np.testing.assert_allclose(now.a, (after.v - before.v) / (2 * h), atol=1e-6)


@settings(max_examples=10, deadline=None)
@given(robots(max_joints=3))
def test_motion_begins_and_ends_at_rest(robot):
    motion = design_sinusoids(robot, duration=4.0, ramp=0.5).sample(np.array([0.0, 4.0]))
    np.testing.assert_allclose(motion.v, 0.0, atol=1e-12)
    np.testing.assert_allclose(motion.a, 0.0, atol=1e-9)
    np.testing.assert_allclose(motion.channels[0], motion.channels[1], atol=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [{"components": 0}, {"band": (1.0, 0.5)}, {"band": (0.0, 1.0)}, {"range_share": 1.5}, {"ramp": 0.0}, {"ramp": 3.0}],
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ParameterError, match="sinusoids"):
        design_sinusoids(Robot.from_file(find_model("two_link")), duration=4.0, **wrong)


def test_a_robot_too_weak_for_its_weight_is_told(tmp_path):
    path = tmp_path / "weak.urdf"
    path.write_text(find_model("two_link").read_text().replace('effort="60.0"', 'effort="1.0"'))
    with pytest.warns(CasysidWarning, match="weight alone takes 'shoulder'"):
        design_sinusoids(Robot.from_file(path), duration=4.0)

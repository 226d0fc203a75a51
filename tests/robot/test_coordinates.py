import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from casysid.errors import ParameterError
from casysid.robot import Robot
from casysid.robot.coordinates import channels_from_configuration, configuration_from_channels, state_from_channels

JOINTS = {
    "base": pin.JointModelFreeFlyer,
    "wheel": pin.JointModelRUBY,
    "ball": pin.JointModelSpherical,
    "cart": pin.JointModelPlanar,
    "slide": pin.JointModelPX,
    "hinge": pin.JointModelRZ,
}


def chain(*names):
    model, last = pin.Model(), 0
    for name in names:
        last = model.addJoint(last, JOINTS[name](), pin.SE3.Identity(), name)
    return Robot.from_pin(model)


ALL = chain(*JOINTS)
QUATERNIONS = [slice(3, 7), slice(8, 12)]


@st.composite
def motions(draw):
    """Position channels with two derivatives, one sample; quaternions of any length but zero."""
    p, p1, p2 = draw(hnp.arrays(np.float64, (3, 1, len(ALL.channels)), elements=st.floats(-2.0, 2.0, width=32)))
    for where in QUATERNIONS:
        p[0, where.stop - 1] = 0.5 + abs(p[0, where.stop - 1])
    return p, p1, p2


@settings(max_examples=40, deadline=None)
@given(motion=motions())
def test_velocity_and_acceleration_are_derivatives_of_the_configuration(motion):
    p, p1, p2 = motion
    h = 1e-4

    def state(t):
        return state_from_channels(ALL, p + p1 * t + p2 * t**2 / 2, p1 + p2 * t, p2)

    _, v, a = state(0.0)
    (q_before, v_before, _), (q_after, v_after, _) = state(-h), state(h)
    scale = 1.0 + max(abs(p1).max(), abs(p2).max()) ** 3 / 0.125
    np.testing.assert_allclose(pin.difference(ALL.model, q_before[0], q_after[0]) / (2 * h), v[0], atol=1e-6 * scale)
    np.testing.assert_allclose((v_after - v_before) / (2 * h), a, atol=1e-5 * scale)


@settings(max_examples=40, deadline=None)
@given(motion=motions())
def test_channels_and_configuration_are_inverses(motion):
    q = configuration_from_channels(ALL, motion[0])
    assert pin.isNormalized(ALL.model, q[0], 1e-12)
    again = configuration_from_channels(ALL, channels_from_configuration(ALL, q))
    np.testing.assert_allclose(again, q, atol=1e-14)


@settings(max_examples=20, deadline=None)
@given(motion=motions(), factor=st.floats(0.1, 10.0))
def test_the_length_of_a_quaternion_does_not_matter(motion, factor):
    scaled = [values.copy() for values in motion]
    for values in scaled:
        for where in QUATERNIONS:
            values[:, where] *= factor
    for ours, theirs in zip(state_from_channels(ALL, *motion), state_from_channels(ALL, *scaled), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)


def test_plain_joints_pass_without_a_copy():
    robot, (p, p1, p2) = chain("hinge", "slide"), np.ones((3, 4, 2))
    q, v, a = state_from_channels(robot, p, p1, p2)
    assert q is not None
    assert np.shares_memory(q, p)
    assert np.shares_memory(v, p1)
    assert np.shares_memory(a, p2)
    assert np.shares_memory(channels_from_configuration(robot, q), p)


def test_a_continuous_joint_has_one_channel():
    robot = chain("wheel")
    assert robot.channels == ("wheel",)
    np.testing.assert_allclose(configuration_from_channels(robot, [[np.pi / 2]]), [[0.0, 1.0]], atol=1e-15)


def test_wrong_shapes_and_zero_quaternions_are_refused():
    zeros = np.zeros((2, len(ALL.channels)))
    with pytest.raises(ParameterError, match=r"wanted shape \(N, 1\) for the channels wheel; got \(3,\)"):
        configuration_from_channels(chain("wheel"), np.zeros(3))
    with pytest.raises(ParameterError, match="samples must agree; got 2, 1, 2"):
        state_from_channels(ALL, zeros, zeros[:1], zeros)
    with pytest.raises(ParameterError, match="joint 'base': the quaternion of sample 0 is zero"):
        configuration_from_channels(ALL, zeros)
    with pytest.raises(ParameterError, match=r"q: wanted shape \(N, 19\)"):
        channels_from_configuration(ALL, zeros)

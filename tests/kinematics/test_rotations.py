"""Ways to write a rotation, there and back, and against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.kinematics import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_rpy,
    rotation_from_vector,
    rpy_from_rotation,
    vector_from_rotation,
)
from tests.strategies import generators

EDGES = [0.0, 1e-12, 1e-7, 1e-5, 1e-3, 1.0, np.pi / 2, 3.0, np.pi - 1e-5, np.pi - 1e-9, np.pi]


@st.composite
def vectors(draw):
    axis = draw(generators()).normal(size=3)
    axis = draw(st.sampled_from([axis, np.eye(3)[0], np.eye(3)[1], -np.eye(3)[2]]))
    return draw(st.sampled_from(EDGES) | st.floats(0.0, np.pi)) * axis / np.linalg.norm(axis)


@given(vectors())
def test_every_way_to_write_a_rotation_gives_it_back(vector):
    R = rotation_from_vector(vector)
    np.testing.assert_allclose(R, pin.exp3(vector), atol=1e-14)
    np.testing.assert_allclose(rotation_from_vector(vector_from_rotation(R)), R, atol=1e-14)
    np.testing.assert_allclose(rotation_from_quaternion(quaternion_from_rotation(R)), R, atol=1e-14)
    np.testing.assert_allclose(rotation_from_rpy(rpy_from_rotation(R)), R, atol=1e-13)
    assert np.linalg.norm(vector_from_rotation(R)) <= np.pi + 1e-15
    if np.linalg.norm(vector) < 3.0:
        np.testing.assert_allclose(vector_from_rotation(R), vector, atol=1e-14)


@given(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))
def test_roll_pitch_yaw_are_those_of_urdf(roll, pitch, yaw):
    R = rotation_from_rpy([roll, pitch, yaw])
    np.testing.assert_allclose(R, pin.rpy.rpyToMatrix(roll, pitch, yaw), atol=1e-15)
    np.testing.assert_allclose(rpy_from_rotation(R), [roll, pitch, yaw], atol=1e-12)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_in_gimbal_lock_roll_is_zero(pitch):
    R = rotation_from_rpy([0.3, pitch, 0.8])
    rpy = rpy_from_rotation(R)
    assert rpy[0] == 0.0
    np.testing.assert_allclose(rotation_from_rpy(rpy), R, atol=1e-14)


def test_many_at_once_are_as_one_by_one():
    R = rotation_from_vector(np.random.default_rng(0).normal(size=(5, 2, 3)))
    for write in (quaternion_from_rotation, rpy_from_rotation, vector_from_rotation):
        assert write(R).shape[:2] == (5, 2)
        np.testing.assert_array_equal(write(R)[3, 1], write(R[3, 1]))


@pytest.mark.parametrize("quaternion", [[0, 0, 0, 0], [0, 0, np.nan, 1], [1, 0, 0]])
def test_what_is_no_quaternion_is_refused(quaternion):
    with pytest.raises(ParameterError, match="wanted four finite numbers"):
        rotation_from_quaternion(quaternion)

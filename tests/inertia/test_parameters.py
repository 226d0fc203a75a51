"""What a body's ten parameters mean, against Pinocchio and the slow formulas."""

import hypothesis.strategies as st
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays

from casysid.errors import ParameterError
from casysid.inertia import (
    KINDS,
    Consistency,
    consistency_matrix,
    inertial_parameters,
    is_consistent,
    mass_properties,
    parameters_from_pseudo_inertia,
    pseudo_inertia,
    smallest_eigenvalue,
)

QUICK = settings(max_examples=30, deadline=None)
NUMBER = st.floats(-2.0, 2.0)


@st.composite
def bodies(draw, count=3):
    """Consistent bodies as clouds of five point masses, so that the parameters are known by summation."""
    mass = draw(arrays(float, (count, 5), elements=st.floats(0.01, 3.0)))
    place = draw(arrays(float, (count, 5, 3), elements=NUMBER))
    return mass, place


def summed(mass, place):
    """Parameters of point masses, term by term."""
    result = []
    for masses, points in zip(mass, place, strict=True):
        inertia = sum(m * (c @ c * np.eye(3) - np.outer(c, c)) for m, c in zip(masses, points, strict=True))
        rows = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
        result.append([masses.sum(), *(masses @ points), *(inertia[i, j] for i, j in rows)])
    return np.array(result)


@QUICK
@given(arrays(float, (4, 10), elements=NUMBER))
def test_the_pseudo_inertia_is_pinocchios_and_linear_both_ways(theta):
    P = pseudo_inertia(theta)
    expected = [pin.PseudoInertia.FromDynamicParameters(row).toMatrix() for row in theta]
    np.testing.assert_allclose(P, expected, atol=1e-14)
    np.testing.assert_allclose(parameters_from_pseudo_inertia(P), theta, atol=1e-13)


@QUICK
@given(bodies())
def test_the_pseudo_inertia_is_the_sum_of_homogeneous_points(body):
    mass, place = body
    points = np.concatenate([place, np.ones_like(place[..., :1])], axis=-1)
    np.testing.assert_allclose(
        pseudo_inertia(summed(mass, place)), np.einsum("bi,bij,bik->bjk", mass, points, points), atol=1e-12
    )


@QUICK
@given(bodies())
def test_mass_properties_agree_with_pinocchio_and_go_back(body):
    theta = summed(*body)
    properties = mass_properties(theta)
    for index, row in enumerate(theta):
        reference = pin.Inertia.FromDynamicParameters(row)
        assert properties.mass[index] == pytest.approx(reference.mass)
        np.testing.assert_allclose(properties.center_of_mass[index], reference.lever, atol=1e-12)
        np.testing.assert_allclose(properties.inertia[index], reference.inertia, atol=1e-10)
    back = inertial_parameters(properties.mass, properties.center_of_mass, properties.inertia)
    np.testing.assert_allclose(back, theta, atol=1e-10)


@QUICK
@given(bodies())
def test_clouds_of_mass_are_consistent_in_every_sense(body):
    theta = summed(*body)
    for consistency in Consistency:
        assert is_consistent(theta, consistency, tolerance=1e-12).all()


def test_the_triangle_inequality_is_what_full_consistency_adds():
    needle = inertial_parameters(1.0, np.zeros(3), np.diag([1.0, 1.0, 2.5]))
    assert is_consistent(needle, Consistency.INERTIA)
    assert not is_consistent(needle, Consistency.FULL)
    assert smallest_eigenvalue(needle) == pytest.approx(-0.25)


def test_negative_inertia_about_the_centre_of_mass_is_inconsistent_though_it_is_positive_at_the_joint():
    body = inertial_parameters(1.0, np.array([0.5, 0.5, 0.5]), -0.1 * np.eye(3))
    assert (body[[4, 6, 9]] > 0).all()
    assert not is_consistent(body, Consistency.INERTIA)


def test_a_body_without_mass_is_consistent_and_sits_at_its_frame():
    assert is_consistent(np.zeros(10))
    assert is_consistent(np.zeros(10), Consistency.INERTIA)
    np.testing.assert_array_equal(mass_properties(np.zeros((2, 10))).center_of_mass, 0.0)


def test_the_matrices_have_the_size_of_their_kind():
    assert consistency_matrix(np.zeros((3, 2, 10)), Consistency.FULL).shape == (3, 2, 4, 4)
    assert consistency_matrix(np.zeros((3, 2, 10)), Consistency.INERTIA).shape == (3, 2, 6, 6)
    assert len(KINDS) == 10


def test_a_flat_vector_of_several_bodies_is_refused_with_the_remedy():
    with pytest.raises(
        ParameterError, match=r"got shape \(20,\). Reshape a flat vector of several bodies to \(-1, 10\)"
    ):
        pseudo_inertia(np.zeros(20))
    with pytest.raises(ParameterError, match=r"must be \(4, 4\)"):
        parameters_from_pseudo_inertia(np.zeros((3, 3)))

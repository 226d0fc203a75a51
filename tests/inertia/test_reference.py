"""Reference bodies: links of unit size, errors alike in every frame and unit."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from casysid.inertia import (
    congruence,
    is_consistent,
    nearest_consistent,
    pseudo_inertia,
    reference_factor,
    reference_sizes,
    relative_covariance,
)
from tests.strategies import consistent_inertias, generators, random_inertia, random_placement

LAWS = settings(max_examples=25, deadline=None)


@LAWS
@given(consistent_inertias())
def test_in_its_own_frame_a_body_has_no_more_than_unit_size(body):
    (mass,), (radius,) = reference_sizes(body[None])
    A = reference_factor(body, mass, radius, 0.1)
    own = pseudo_inertia(np.linalg.solve(congruence(A), body))
    np.testing.assert_allclose(A @ own @ A.T, pseudo_inertia(body), atol=1e-9 * np.abs(body).max())
    assert np.linalg.eigvalsh(own).max() <= 1.0 + 1e-9


@LAWS
@given(consistent_inertias(), generators())
def test_how_wrong_a_body_may_be_does_not_depend_on_its_frame(body, rng):
    move = congruence(np.asarray(random_placement(rng).homogeneous))
    here, there = relative_covariance(body[None])[0], relative_covariance((move @ body)[None])[0]
    np.testing.assert_allclose(there, move @ here @ move.T, atol=1e-8 * np.abs(there).max())


@LAWS
@given(consistent_inertias(), st.floats(-3.0, 3.0))
def test_a_heavier_body_may_be_wrong_by_as_much_of_itself(body, exponent):
    factor = 10.0**exponent
    here, there = relative_covariance(body[None])[0], relative_covariance(factor * body[None])[0]
    np.testing.assert_allclose(there, factor**2 * here, rtol=1e-9)


@LAWS
@given(arrays(np.float64, (3, 10), elements=st.floats(-10.0, 10.0)), generators())
def test_any_numbers_have_a_regular_covariance_and_a_consistent_neighbour(bodies, rng):
    bodies[0] = random_inertia(rng).toDynamicParameters()
    mended = nearest_consistent(bodies)
    assert is_consistent(mended, tolerance=1e-9).all()
    np.testing.assert_array_equal(mended[0], bodies[0])
    size = np.sqrt(np.einsum("nii->ni", relative_covariance(bodies)))
    scaled = relative_covariance(bodies) / (size[:, :, None] * size[:, None, :])
    assert (np.linalg.eigvalsh(scaled)[:, 0] > 0.0).all()

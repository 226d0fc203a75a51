"""Any real vector is a consistent body, and every consistent body has such a vector."""

import casadi as ca
import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays

from casysid.inertia import (
    SIGNLESS,
    Consistency,
    is_consistent,
    mass_properties,
    parameters_from_virtual,
    pseudo_inertia,
    symbolic_parameters_from_virtual,
    virtual_from_parameters,
)

QUICK = settings(max_examples=30, deadline=None)
KINDS = pytest.mark.parametrize("consistency", Consistency)
VIRTUAL = arrays(float, (3, 10), elements=st.floats(-2.0, 2.0))


def paper_equation_5(u):
    """The paper's Eq. (5) in its own words and order: m, mc, then xx xy xz yy yz zz, then viscous friction."""
    t = dict(enumerate(u, start=1))
    m = t[1] ** 2
    return [
        m,
        t[2] * m,
        t[3] * m,
        t[4] * m,
        t[5] ** 2 + (t[4] ** 2 + t[3] ** 2) * m,
        t[5] * t[6] - t[2] * t[3] * m,
        t[5] * t[7] - t[2] * t[4] * m,
        t[6] ** 2 + t[8] ** 2 + (t[2] ** 2 + t[4] ** 2) * m,
        t[6] * t[7] + t[8] * t[9] - t[3] * t[4] * m,
        t[7] ** 2 + t[9] ** 2 + t[10] ** 2 + (t[2] ** 2 + t[3] ** 2) * m,
        t[11] ** 2,
    ]


@QUICK
@given(arrays(float, 11, elements=st.floats(-3.0, 3.0)))
def test_eleven_virtual_parameters_are_the_papers(u):
    to_pinocchio = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9, 10]
    expected = np.array(paper_equation_5(u))[to_pinocchio]
    np.testing.assert_allclose(parameters_from_virtual(u, Consistency.INERTIA), expected, atol=1e-12)


@KINDS
@QUICK
@given(u=VIRTUAL)
def test_any_vector_is_a_consistent_body(consistency, u):
    theta = parameters_from_virtual(u, consistency)
    assert (theta[:, 0] >= 0).all()
    assert is_consistent(theta, consistency, tolerance=1e-12).all()
    inertia = mass_properties(theta[theta[:, 0] > 1e-3]).inertia
    assert (np.linalg.eigvalsh(inertia) > -1e-9).all()


@KINDS
@QUICK
@given(u=VIRTUAL)
def test_every_consistent_body_comes_back(consistency, u):
    theta = parameters_from_virtual(u, consistency)
    virtual = virtual_from_parameters(theta, consistency)
    assert (virtual[:, SIGNLESS[consistency]] >= 0).all()
    np.testing.assert_allclose(parameters_from_virtual(virtual, consistency), theta, atol=1e-9)


@KINDS
@QUICK
@given(u=arrays(float, (3, 11), elements=st.floats(0.2, 2.0)))
def test_vectors_with_positive_diagonals_come_back_themselves(consistency, u):
    again = virtual_from_parameters(parameters_from_virtual(u, consistency), consistency)
    np.testing.assert_allclose(again, u, atol=1e-7)


@KINDS
@QUICK
@given(u=arrays(float, (4, 11), elements=st.floats(-2.0, 2.0)))
def test_casadi_and_numpy_give_the_same(consistency, u):
    x = ca.SX.sym("x", 11, 4)
    f = ca.Function("f", [x], [symbolic_parameters_from_virtual(x, consistency)])
    np.testing.assert_allclose(f(u.T).full().T, parameters_from_virtual(u, consistency), atol=1e-12)


@KINDS
@QUICK
@given(u=arrays(float, 10, elements=st.floats(-2.0, 2.0)))
def test_derivatives_agree_with_finite_differences(consistency, u):
    x = ca.SX.sym("x", 10)
    jacobian = ca.Function("J", [x], [ca.jacobian(symbolic_parameters_from_virtual(x, consistency), x)])(u).full()
    step = 1e-6 * np.eye(10)
    ahead, behind = parameters_from_virtual(u + step, consistency), parameters_from_virtual(u - step, consistency)
    np.testing.assert_allclose(jacobian, (ahead - behind).T / 2e-6, atol=1e-6)


@KINDS
def test_bodies_without_mass_and_flat_bodies_have_coordinates(consistency):
    flat = np.zeros((3, 10))
    flat[1, :4] = [2.0, 1.0, 0.0, 0.0]  # a point mass beside the axis
    flat[1, [6, 9]] = 0.5
    flat[2, 0] = 1.0
    theta = parameters_from_virtual(virtual_from_parameters(flat, consistency), consistency)
    np.testing.assert_allclose(theta, flat, atol=1e-12)


@QUICK
@given(arrays(float, (3, 10), elements=st.floats(-2.0, 2.0)))
def test_of_an_inconsistent_body_the_negative_eigenvalues_are_dropped(theta):
    values, vectors = np.linalg.eigh(pseudo_inertia(theta))
    nearest = np.einsum("bij,bj,bkj->bik", vectors, np.maximum(values, 0.0), vectors)
    clipped = parameters_from_virtual(virtual_from_parameters(theta))
    np.testing.assert_allclose(pseudo_inertia(clipped), nearest, atol=1e-12)


def test_negative_friction_becomes_zero():
    assert virtual_from_parameters(np.full(11, -1.0))[10] == 0.0

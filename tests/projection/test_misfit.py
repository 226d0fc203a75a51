"""What the data see, whatever the units, and what they do not."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays

from casysid.errors import ParameterError
from casysid.moments import Moments
from casysid.projection.misfit import misfit_of_equations, misfit_of_estimate

QUICK = settings(max_examples=30, deadline=None)
POINT = arrays(float, 6, elements=st.floats(-3, 3))


def low_rank(scale=1.0, rank=4, seed=0):
    """A metric of rank 4 over six parameters, columns scaled."""
    rows = np.random.default_rng(seed).normal(size=(50, rank)) @ np.random.default_rng(1).normal(size=(rank, 6))
    return rows.T @ rows * np.outer(np.ones(6) * scale, np.ones(6) * scale)


@QUICK
@given(POINT, POINT)
def test_the_misfit_is_the_papers_quadratic_form(theta, estimate):
    G = low_rank()
    misfit = misfit_of_estimate(G, estimate, 2.0)
    away = theta - estimate
    assert misfit(theta) * misfit.residual_energy == pytest.approx(away @ G @ away, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("scale", [1.0, np.array([1e-6, 1.0, 1e3, 1e-3, 1e6, 10.0])])
def test_the_rank_does_not_depend_on_units(scale):
    misfit = misfit_of_estimate(low_rank(scale), np.ones(6), 1.0)
    assert misfit.seen.shape == (4, 6)
    assert misfit.unseen.shape == (6, 2)
    unit = misfit.unseen / scale[:, None] if isinstance(scale, np.ndarray) else misfit.unseen
    assert np.abs(misfit.seen @ misfit.unseen).max() < 1e-6 * np.abs(misfit.seen).max() * np.abs(unit).max() * 1e6


def test_rounding_in_the_geometry_is_not_rank():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(100, 3))
    rows = np.column_stack([rows, rows @ [1.0, 2.0, 3.0] + 1e-6 * rng.normal(size=100)])
    assert misfit_of_estimate(rows.T @ rows, np.zeros(4), 1.0).seen.shape == (3, 4)


def test_columns_without_energy_are_unseen():
    G = np.diag([1.0, 0.0, 2.0])
    misfit = misfit_of_estimate(G, np.ones(3), 1.0)
    np.testing.assert_allclose(np.abs(misfit.unseen.ravel()), [0.0, 1.0, 0.0])
    np.testing.assert_allclose(misfit.minimum, [1.0, 0.0, 1.0])


def test_without_data_everything_is_unseen():
    misfit = misfit_of_estimate(np.zeros((3, 3)), np.ones(3), None)
    assert misfit.seen.shape == (0, 3)
    assert misfit.unseen.shape == (3, 3)
    assert misfit(np.ones(3)) == 0.0


@QUICK
@given(POINT)
def test_from_moments_it_is_the_residual_energy_above_the_smallest(theta):
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(40, 6)), rng.normal(size=40)
    equations = Moments.from_rows(x, y).pooled()
    misfit = misfit_of_equations(equations)
    smallest = float(np.sum((y - x @ np.linalg.lstsq(x, y, rcond=None)[0]) ** 2))
    assert misfit.residual_energy == pytest.approx(smallest)
    assert misfit(theta) == pytest.approx(equations.residual_energy(theta) / smallest - 1.0, rel=1e-8, abs=1e-9)
    assert misfit(misfit.minimum) == pytest.approx(0.0, abs=1e-12)


def test_a_perfect_fit_has_a_finite_unit():
    assert misfit_of_estimate(np.eye(3), np.ones(3), 0.0).residual_energy == pytest.approx(3e-8)


def test_an_indefinite_metric_is_refused_with_the_remedy():
    with pytest.raises(ParameterError, match="Correct the moments less"):
        misfit_of_estimate(np.array([[1.0, 2.0], [2.0, 1.0]]), np.zeros(2), 1.0)

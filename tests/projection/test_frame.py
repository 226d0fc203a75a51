"""The prior becomes a robot of unit links, whatever its units; an inconsistent one is mended."""

import warnings
from dataclasses import dataclass

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays

from casysid.errors import CasysidWarning, ParameterError
from casysid.inertia import KINDS, Consistency, is_consistent, parameters_from_virtual, smallest_eigenvalue
from casysid.projection import KeptLink, LinearKnowledge, center_of_mass_within, total_mass
from casysid.projection.frame import UNIT_BODY, clipped, feasible, frame_of
from casysid.projection.knowledge import constraints_of
from casysid.projection.layout import layout_of
from casysid.projection.misfit import misfit_of_estimate

QUICK = settings(max_examples=30, deadline=None)
BODIES = arrays(float, (2, 10), elements=st.floats(-1.0, 1.0))
FLOOR = 1e-3


@dataclass(frozen=True)
class Column:
    name: str
    owner: str
    kind: str
    non_negative: bool = False


COLUMNS = (
    *(Column(f"{link}.{kind}", link, kind) for link in "ab" for kind in KINDS),
    Column("j.viscous", "j", "viscous", non_negative=True),
    Column("j.offset", "j", "offset"),
)
LAYOUT = layout_of(COLUMNS)
NOTHING = constraints_of(LAYOUT, ())


def framed(prior, consistency=Consistency.FULL, constraints=NOTHING):
    misfit = misfit_of_estimate(np.eye(22), np.ones(22), 1.0)
    return frame_of(LAYOUT, constraints, misfit, prior, consistency, FLOOR)


@pytest.mark.parametrize("consistency", Consistency)
@QUICK
@given(u=BODIES)
def test_a_consistent_prior_stays_and_is_of_order_one(consistency, u):
    prior = np.concatenate([parameters_from_virtual(np.sign(u + 1e-9) * (0.3 + np.abs(u))).ravel(), [0.2, -0.1]])
    frame = framed(prior, consistency)
    np.testing.assert_allclose(frame.prior, prior, rtol=5e-2, atol=1e-3)
    np.testing.assert_allclose(frame.transform @ frame.scaled_prior, frame.prior, atol=1e-9)
    assert np.abs(frame.scaled_prior).max() < 20.0


@QUICK
@given(u=BODIES, unit=st.sampled_from([1e-3, 1e3]))
def test_scaled_links_do_not_depend_on_the_unit_of_mass(u, unit):
    prior = np.concatenate([parameters_from_virtual(0.1 + u**2).ravel(), [0.2, 0.0]])
    scale = np.append(np.full(20, unit), [1.0, 1.0])
    np.testing.assert_allclose(framed(scale * prior).scaled_prior, framed(prior).scaled_prior, atol=1e-9)


@pytest.mark.parametrize("consistency", Consistency)
@QUICK
@given(bodies=BODIES)
def test_any_prior_is_made_consistent(consistency, bodies):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CasysidWarning)
        frame = framed(np.concatenate([bodies.ravel(), [-1.0, 1.0]]), consistency)
    assert is_consistent(frame.prior[:20].reshape(2, 10), consistency, tolerance=1e-12).all()
    assert frame.prior[20] == 0.0
    above = frame.scaled_prior[:20].reshape(2, 10) - FLOOR * UNIT_BODY
    assert smallest_eigenvalue(above, consistency).min() > -1e-9


def test_an_empty_prior_says_nothing_and_warns_of_nothing():
    frame = framed(np.zeros(22))
    assert (np.abs(frame.prior[:20]) < 1e-2).all()


def test_the_warning_names_links_that_are_kept_all_the_same():
    prior = np.concatenate([-np.ones(10), UNIT_BODY, [0.0, 0.0]])
    with pytest.warns(CasysidWarning, match=r"not physically consistent at a; .*to be kept stay"):
        frame = framed(prior, constraints=constraints_of(LAYOUT, (KeptLink("a"),)))
    np.testing.assert_allclose(frame.prior[:10], -1.0)


@pytest.mark.parametrize("consistency", Consistency)
@QUICK
@given(bodies=BODIES)
def test_feasible_and_clipped_parameters_are(consistency, bodies):
    scaled = np.concatenate([bodies.ravel(), [-1.0, -1.0]])
    for inside in (feasible(LAYOUT, scaled, consistency, FLOOR), clipped(LAYOUT, scaled, FLOOR)):
        above = inside[:20].reshape(2, 10) - FLOOR * UNIT_BODY
        assert smallest_eigenvalue(above, consistency).min() > -1e-9
        assert inside[20] >= 0.0
        assert inside[21] == -1.0


def test_layouts_in_another_order_are_refused():
    with pytest.raises(ParameterError, match="wanted links first, each m, mcx"):
        layout_of(COLUMNS[::-1])
    with pytest.raises(ParameterError, match="wanted links first"):
        layout_of(COLUMNS[1:])


def test_knowledge_of_nothing_that_exists_is_refused():
    with pytest.raises(ParameterError, match=r"no parameter is called 'c.m'; names are like 'a.m'"):
        constraints_of(LAYOUT, (total_mass("abc", 1.0),))
    with pytest.raises(ParameterError, match="no link is called 'c'; there are a, b"):
        constraints_of(LAYOUT, (KeptLink("c"),))
    with pytest.raises(ParameterError, match=r"cannot lie in \[1.0, 0.0\]"):
        LinearKnowledge(coefficients={"a.m": 1.0}, lower=1.0, upper=0.0)


def test_a_box_for_the_centre_of_mass_is_six_rows_that_hold_inside_and_not_outside():
    constraints = constraints_of(LAYOUT, center_of_mass_within("b", [-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]))
    assert constraints.matrix.shape == (6, 22)
    inside = np.zeros(22)
    inside[10:14] = 2.0 * np.array([1.0, 0.05, -0.09, 0.0])
    assert constraints.violation(inside) == 0.0
    inside[11] = 0.3
    assert constraints.violation(inside) > 0.1

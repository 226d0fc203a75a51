import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.excitation.design.criteria import AOptimal, Balanced, ConditionNumber, DOptimal

CRITERIA = [
    DOptimal(),
    ConditionNumber(),
    ConditionNumber(power=2.0),
    AOptimal(np.diag([1.0, 0.0, 2.0, 0.5])),
    Balanced(),
]


def information(rng):
    rows = rng.normal(size=(9, 4))
    return rows.T @ rows


@pytest.mark.parametrize("criterion", CRITERIA, ids=repr)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_derivatives_are_those_of_finite_differences(criterion, seed):
    rng = np.random.default_rng(seed)
    F, D = information(rng), information(rng)
    h = 1e-6 * np.linalg.eigvalsh(F)[0] / np.linalg.norm(D)
    slope = (criterion.evaluate(F + h * D)[0] - criterion.evaluate(F - h * D)[0]) / (2 * h)
    wanted = float((criterion.evaluate(F)[1] * D).sum())
    scale = np.abs(criterion.evaluate(F)[1] * D).sum()
    assert abs(slope - wanted) <= 1e-4 * scale


@pytest.mark.parametrize("criterion", [CRITERIA[0], CRITERIA[3]], ids=repr)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_more_information_is_never_worse(criterion, seed):
    rng = np.random.default_rng(seed)
    F = information(rng)
    assert criterion.evaluate(F + information(rng))[0] <= criterion.evaluate(F)[0]


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_smooth_condition_number_bounds_the_true_one_and_approaches_it(seed):
    F = information(np.random.default_rng(seed))
    true = np.log(np.linalg.cond(F))
    values = [ConditionNumber(power=p, weight=1.0).evaluate(F)[0] for p in (2.0, 8.0, 64.0)]
    assert values[0] >= values[1] >= values[2] >= true - 1e-9
    assert values[2] <= true + 2 * np.log(4.0) / 64.0


@pytest.mark.parametrize("weight", [0.0, 1.0, 10.0])
def test_the_balanced_criterion_is_the_volume_and_a_share_of_the_condition_number(weight):
    F = information(np.random.default_rng(0))
    wanted = -np.linalg.slogdet(F)[1] + weight * np.log(np.linalg.cond(F))
    assert Balanced(weight, power=400.0).evaluate(F)[0] == pytest.approx(wanted, abs=0.02 * weight + 1e-9)
    with pytest.raises(ParameterError, match="weight must be a number from 0 up"):
        Balanced(-1.0)


@pytest.mark.parametrize("criterion", CRITERIA, ids=repr)
def test_singular_information_is_infinitely_bad(criterion):
    assert criterion.evaluate(-np.eye(4))[0] == np.inf

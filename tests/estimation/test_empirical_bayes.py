"""Empirical Bayes: what is there is found, what is not there costs nothing, and the possible ones are asked."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from casysid.errors import ParameterError
from casysid.estimation import EmpiricalBayes, WeightedLeastSquares
from casysid.estimation.base import Status
from casysid.estimation.evidence import LINKS, SIZES, UNOWNED, groups_of
from casysid.inertia import KINDS
from casysid.moments import Moments
from tests.estimation.draws import transformed

BODY, FRICTION = 8, 8
NAMES = (*(f"x{k}" for k in range(BODY)), *(f"joint_{k}.coulomb" for k in range(FRICTION)))
TRUTH = np.append(np.linspace(-2.0, 3.0, BODY), np.zeros(FRICTION))
SHARP = EmpiricalBayes(tolerance=1e-9, iterations=500)
seeds = st.integers(0, 2**32 - 1)


def rows_of(seed, truth=TRUTH, noise=1.0, count=400):
    """Columns that go together, and a noisy target."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(count, BODY + FRICTION)) @ (np.eye(BODY + FRICTION) + 0.3)
    return x, x @ truth + noise * rng.normal(size=count)


def drawn(seed, **options):
    return Moments.from_rows(*rows_of(seed, **options), columns=NAMES, blocks=10)


@settings(max_examples=10, deadline=None)
@given(seeds)
def test_the_truth_is_found_within_its_standard_errors(seed):
    truth = np.append(TRUTH[:BODY], np.linspace(1.0, 2.0, FRICTION))
    estimate = SHARP.estimate(drawn(seed, truth=truth))
    assert estimate.status is Status.CONVERGED
    assert (np.abs(estimate.parameters - truth) < 6.0 * estimate.std).all()
    assert estimate.noise_std == pytest.approx(1.0, rel=0.2)
    assert estimate.rank == BODY + FRICTION


def test_friction_that_is_not_there_costs_next_to_nothing():
    """The error of the torque is that of least squares that is told, and that of least squares that is not is larger"""
    errors, sizes = [], []
    for seed in range(40):
        x, y = rows_of(seed)
        moments = Moments.from_rows(x, y, columns=NAMES, blocks=10)
        told = np.zeros(len(TRUTH))
        told[:BODY] = WeightedLeastSquares().estimate(moments.select_columns(range(BODY))).parameters
        ours = SHARP.estimate(moments)
        candidates = told, ours.parameters, WeightedLeastSquares().estimate(moments).parameters
        errors.append([np.sum((x @ (found - TRUTH)) ** 2) for found in candidates])
        sizes.append(ours.diagnostics["size_coulomb"])
    told, ours, untold = np.sqrt(np.mean(errors, axis=0))
    assert ours <= 1.05 * told
    assert untold > 1.3 * told
    assert np.median(sizes) < 10.0 * SIZES[0]
    assert max(sizes) < 1e-2


@settings(max_examples=10, deadline=None)
@given(seeds)
def test_with_a_group_that_is_nothing_the_others_are_as_if_it_were_not_asked_for(seed):
    moments, pinned = drawn(seed), BODY + np.arange(FRICTION)

    def possible(parameters, metric, energy):
        changed = parameters.copy()
        changed[pinned] = 0.0
        return changed

    among = SHARP.estimate_among(moments, None, possible)
    alone = SHARP.estimate(moments.select_columns(range(BODY)))
    assert among.diagnostics["size_coulomb"] == pytest.approx(SIZES[0])
    assert among.parameters[:BODY] == pytest.approx(alone.parameters, abs=1e-3)
    assert among.parameters[pinned] == pytest.approx(0.0, abs=1e-3)


@settings(max_examples=10, deadline=None)
@given(seeds)
def test_where_all_is_possible_nothing_changes(seed):
    moments = drawn(seed)
    free, among = SHARP.estimate(moments), SHARP.estimate_among(moments, None, lambda mean, metric, energy: mean)
    np.testing.assert_array_equal(among.parameters, free.parameters)
    np.testing.assert_array_equal(among.noise_std, free.noise_std)


def test_impossible_signs_do_not_count_for_a_groups_size():
    """Coefficients that least squares makes negative say that a group is there; the possible ones say that it is not"""
    truth = np.append(TRUTH[:BODY], np.full(FRICTION, -0.5))

    def possible(parameters, metric, energy):
        root = np.linalg.cholesky(metric).T
        signs = np.append(np.sign(TRUTH[:BODY]), np.ones(FRICTION))
        return signs * nnls(root * signs, root @ parameters)[0]

    for seed in range(5):
        moments = drawn(seed, truth=truth)
        free, among = SHARP.estimate(moments), SHARP.estimate_among(moments, None, possible)
        assert among.diagnostics["size_coulomb"] < 1e-2 * free.diagnostics["size_coulomb"]
        assert (among.noise_std > 1.1 * free.noise_std).all()


@settings(max_examples=15, deadline=None)
@given(seeds)
def test_units_of_columns_joints_and_torque_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    units = 10.0 ** rng.uniform(-4, 4, len(TRUTH) + 1)
    moments = drawn(seed)
    ours, theirs = SHARP.estimate(moments), SHARP.estimate(transformed(moments, np.diag(units), NAMES))
    assert theirs.parameters * units[:-1] / units[-1] == pytest.approx(ours.parameters, abs=1e-6)
    for name in ("size_coulomb", f"size_{UNOWNED}", "score_inflation"):
        assert theirs.diagnostics[name] == pytest.approx(ours.diagnostics[name], rel=1e-3)


def test_links_are_one_group_and_every_kind_of_friction_its_own():
    names = [f"{link}.{kind}" for link in ("upper", "lower") for kind in KINDS]
    names += ["a.viscous", "b.viscous", "a.coulomb", "b.maxwell_slip_1", "a.ripple #1", "b.ripple #2", "x"]
    groups = {group.name: group.columns.tolist() for group in groups_of(names)}
    assert groups == {
        LINKS: list(range(20)),
        "viscous": [20, 21],
        "coulomb": [22],
        "maxwell_slip_1": [23],
        "ripple": [24, 25],
        UNOWNED: [26],
    }


def test_more_blocks_of_the_same_error_inflate():
    """Residuals that stay the same for a while say less than as many independent ones."""
    x, y = rows_of(0, count=2000)
    slow = y + 3.0 * np.repeat(np.random.default_rng(1).normal(size=40), 50) * x[:, 0] / np.abs(x[:, 0]).mean()
    white, coloured = (
        SHARP.estimate(Moments.from_rows(x, target, columns=NAMES, blocks=20)).diagnostics["score_inflation"]
        for target in (y, slow)
    )
    assert 1.0 <= white < 1.5 < coloured


@pytest.mark.parametrize(
    ("wrong", "message"), [({"iterations": 0}, "iterations must be at least 1"), ({"tolerance": 0.0}, "be positive")]
)
def test_settings_without_sense_are_refused(wrong, message):
    with pytest.raises(ParameterError, match=message):
        EmpiricalBayes(**wrong)

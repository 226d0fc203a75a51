"""Sizes and variances against the evidence itself, computed row by row."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.estimation.evidence import OVERLAP_INFLATION, SIZES, build_evidence_problem, inverse
from casysid.moments import Moments

NAMES = ("a.viscous", "b.viscous", "a.coulomb", "b.coulomb", "x1", "x2")
ROWS, JOINTS = 40, 2
SMALL = 1e-4
seeds = st.integers(0, 2**32 - 1)


def drawn(seed):
    """Rows of two joints of unlike noise, and their moments in too few blocks to tell an inflation."""
    rng = np.random.default_rng(seed)
    truth = rng.normal(size=len(NAMES)) * [3.0, 3.0, 0.2, 0.2, 1.0, 1.0]
    x = rng.normal(size=(JOINTS, ROWS, len(NAMES)))
    y = x @ truth + np.array([[0.5], [2.0]]) * rng.normal(size=(JOINTS, ROWS))
    r = np.concatenate([x, y[..., None]], axis=-1).reshape(JOINTS, 2, ROWS // 2, -1)
    gram = np.einsum("jbnm,jbnk->bjmk", r, r)
    return x, y, Moments.from_dense(gram, np.full((2, JOINTS), ROWS / 2), NAMES, ("a", "b"))


def log_evidence(x, y, K, variance, kappa):
    """``log ∫ Π p(y | θ)^(1/κ) p(θ) dθ`` up to a constant, by the covariance of the rows."""
    noise = np.repeat(kappa * variance, ROWS)
    X, t = x.reshape(-1, x.shape[-1]), y.ravel()
    S = np.diag(noise) + X @ K @ X.T
    tempered = np.sum((1.0 - 1.0 / kappa) * np.log(np.repeat(variance, ROWS)))
    return -0.5 * (np.linalg.slogdet(S)[1] + t @ np.linalg.solve(S, t) - tempered)


@settings(max_examples=12, deadline=None)
@given(seeds)
def test_no_size_and_no_variance_nearby_has_more_evidence(seed):
    x, y, moments = drawn(seed)
    problem = build_evidence_problem(moments, np.zeros(len(NAMES)))
    fit = problem.maximise(2000, 1e-12)
    assert fit.kappa == OVERLAP_INFLATION
    start = np.log(np.array([*fit.sizes.values(), *fit.variance]))

    def value(logarithms):
        sizes, variance = np.split(np.exp(logarithms), [len(problem.groups)])
        by_column = np.ones(len(NAMES))
        for group, size in zip(problem.groups, sizes, strict=True):
            by_column[group.columns] = size
        return log_evidence(x, y, problem.covariance * np.sqrt(np.outer(by_column, by_column)), variance, fit.kappa)

    for place, moved in enumerate(np.eye(len(start))):
        slope = (value(start + SMALL * moved) - value(start - SMALL * moved)) / (2.0 * SMALL)
        at_floor = place < len(problem.groups) and np.exp(start[place]) <= SIZES[0]
        assert slope == pytest.approx(0.0, abs=2e-2) or (at_floor and slope < 0.0)


@settings(max_examples=12, deadline=None)
@given(seeds)
def test_the_posterior_is_that_of_the_rows(seed):
    x, y, moments = drawn(seed)
    problem = build_evidence_problem(moments, np.zeros(len(NAMES)))
    fit = problem.maximise(500, 1e-10)
    w = 1.0 / (fit.kappa * fit.variance)
    prior = problem.covariance * np.sqrt(np.outer(fit.size_by_column, fit.size_by_column))
    P = np.linalg.inv(prior) + sum(w[j] * x[j].T @ x[j] for j in range(JOINTS))
    mean = np.linalg.solve(P, sum(w[j] * x[j].T @ y[j] for j in range(JOINTS)))
    assert fit.mean == pytest.approx(mean, rel=1e-3, abs=1e-4)
    assert np.diag(fit.covariance) == pytest.approx(np.diag(np.linalg.inv(P)), rel=1e-2)
    assert sum(fit.decided.values()) == pytest.approx(
        len(NAMES) - np.trace(np.linalg.solve(prior, np.linalg.inv(P))), abs=1e-2
    )


def test_an_inverse_does_not_mind_units():
    rng = np.random.default_rng(0)
    root, units = rng.normal(size=(6, 6)), 10.0 ** rng.uniform(-8, 8, 6)
    matrix = root @ root.T
    found = inverse(matrix * np.outer(units, units)) * np.outer(units, units)
    assert found == pytest.approx(np.linalg.inv(matrix), rel=1e-9)


def test_a_joint_is_explained_no_better_near_rest_than_while_it_moves():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(JOINTS, ROWS, 3))
    y = x @ np.ones(3) + np.array([[1.0], [0.01]]) * rng.normal(size=(JOINTS, ROWS))
    r = np.concatenate([x, y[..., None]], axis=-1)
    gram = np.einsum("jnm,jnk->jmk", r, r)[None]
    for names, alike in ((("a", "a near rest"), True), (("a", "b"), False)):
        moments = Moments.from_dense(gram, np.full((1, JOINTS), ROWS), ("u", "v", "w"), names)
        variance = build_evidence_problem(moments, np.zeros(3)).maximise(100, 1e-6).variance
        assert (variance[0] == variance[1]) == alike

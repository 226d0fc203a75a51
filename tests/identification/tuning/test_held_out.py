"""Errors on stretches left out against refits one by one, and evidence for columns to join."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear
from scipy.signal import lfilter

from casysid.identification.tuning.held_out import LEAST_PULL, HeldOut
from casysid.moments import Moments
from casysid.projection import HalfSpaces

ROWS, BLOCKS, KNOWN, TRIED = 2000, 20, 6, 12


def slow_noise(rng, *shape):
    """Noise that remembers some twenty samples, of unit variance."""
    return np.sqrt(1.0 - 0.95**2) * lfilter([1.0], [1.0, -0.95], rng.normal(size=shape), axis=0)


def regression(seed, true=(), noise=0.3):
    """Columns that are always there, columns that may join, and a target of the former and of ``true``."""
    rng = np.random.default_rng(seed)
    x = slow_noise(rng, ROWS, KNOWN + TRIED)
    theta = np.zeros(KNOWN + TRIED)
    theta[:KNOWN] = rng.normal(size=KNOWN)
    for column, value in true:
        theta[KNOWN + column] = value
    return x, x @ theta + noise * slow_noise(rng, ROWS)


def one_joint(x, y, pull=0.0):
    """Errors on fifths left out, rows weighted by their noise."""
    folds = np.array_split(np.arange(BLOCKS), 5)
    return HeldOut(Moments.from_rows(x, y, blocks=BLOCKS), np.arange(KNOWN), np.ones(1), pull * np.eye(KNOWN), folds)


def test_evidence_among_noise_is_that_of_chance():
    """Twenty rows that remember each other are one: with their inflation, few of 300 gain more than their share."""
    gains = []
    for seed in range(25):
        held_out = one_joint(*regression(seed))
        gains += [held_out.gain([KNOWN + k], 40.0 * 0.09) for k in range(TRIED)]
    assert np.sum(np.array(gains) > np.log(TRIED)) <= 3


@given(st.integers(0, 10_000), st.integers(0, TRIED - 1))
@settings(max_examples=10)
def test_what_is_true_has_most_evidence_and_lowers_the_error(seed, true):
    held_out = one_joint(*regression(seed, [(true, 1.0)]))
    gains = [held_out.gain([KNOWN + k], 0.09) for k in range(TRIED)]
    assert int(np.argmax(gains)) == true
    before, after = held_out.score(), held_out.score([KNOWN + true])
    assert after.energy.sum() < 0.5 * before.energy.sum()
    assert held_out.fit([KNOWN + true])[KNOWN + true] == pytest.approx(1.0, abs=0.2)


@given(st.integers(0, 10_000), st.integers(1, 3))
@settings(max_examples=10)
def test_the_gain_is_what_free_sizes_add_to_the_evidence(seed, width):
    """Of orthogonal columns of equal energy: ``½ (q - d - d ln(q / d))`` is the largest over their common size."""
    rng = np.random.default_rng(seed)
    x = np.linalg.qr(rng.normal(size=(200, KNOWN + width)))[0]
    y = x @ rng.normal(size=KNOWN + width) * 5.0 + rng.normal(size=200)
    folds = np.array_split(np.arange(4), 2)
    held_out = HeldOut(Moments.from_rows(x, y, blocks=4), np.arange(KNOWN), np.ones(1), np.zeros((KNOWN, KNOWN)), folds)
    C = x[:, KNOWN:]
    sizes = np.append(0.0, np.geomspace(1e-4, 1e4, 4000))
    q = np.sum((C.T @ y) ** 2)
    evidence = -0.5 * width * np.log1p(sizes) + 0.5 * q * sizes / (1.0 + sizes)
    assert held_out.gain(range(KNOWN, KNOWN + width), 1.0) == pytest.approx(evidence.max(), rel=1e-3, abs=1e-3)


def test_a_column_that_the_model_has_already_lowers_no_error():
    x, y = regression(0, [(1, 1.0)])
    x[:, KNOWN] = x[:, :KNOWN] @ np.arange(1.0, KNOWN + 1.0)
    held_out = one_joint(x, y)
    assert held_out.gain([KNOWN], 0.09) < np.log(TRIED)
    np.testing.assert_allclose(held_out.score([KNOWN]).energy, held_out.score().energy, rtol=1e-3)


@pytest.mark.parametrize("columns", [(), (KNOWN + 1,), (KNOWN + 1, KNOWN + 4)])
def test_held_out_energies_are_those_of_fits_one_by_one(columns):
    rng = np.random.default_rng(7)
    rows = [regression(seed, [(1, 1.0)]) for seed in (8, 9)]
    rows[1][0][:, KNOWN + 4] = 0.0  # acts on the first joint alone
    parts = [Moments.from_rows(x, y, blocks=BLOCKS) for x, y in rows]
    gram, count = (np.concatenate([getattr(part, name) for part in parts], axis=1) for name in ("gram", "count"))
    moments = Moments.from_dense(gram, count, parts[0].columns, ("one", "two"))
    weights = rng.uniform(0.5, 2.0, 2)
    folds = np.array_split(np.arange(BLOCKS), 5)
    root = rng.normal(size=(KNOWN, KNOWN))
    held_out = HeldOut(moments, np.arange(KNOWN), weights, root @ root.T, folds)
    model, energy = [*range(KNOWN), *columns], np.diag(moments.pooled(weights).xx)
    ridge = LEAST_PULL * np.diag(energy[model])
    ridge[:KNOWN, :KNOWN] += root @ root.T

    def refit(training, part):
        normal, theta = training.pooled(weights), np.zeros(KNOWN + TRIED)
        theta[model] = np.linalg.solve(part * normal.xx[np.ix_(model, model)] + ridge, part * normal.xy[model])
        return theta

    score = held_out.score(columns)
    for k, fold in enumerate(folds):
        training = moments.select_blocks(np.setdiff1d(np.arange(BLOCKS), fold))
        theta, test = refit(training, 5.0 / 4.0), moments.select_blocks(fold)
        np.testing.assert_allclose(score.energy[k], test.residual_energy(theta).sum(axis=0), rtol=1e-9)
        np.testing.assert_allclose(score.target[k], test.target_energy().sum(axis=0), rtol=1e-12)
        np.testing.assert_allclose(score.count[k], test.count.sum(axis=0), rtol=1e-12)
        variance = training.residual_energy(theta).sum(axis=0) / training.count.sum(axis=0)
        np.testing.assert_allclose(score.variance[k], variance, rtol=1e-9)
    np.testing.assert_allclose(held_out.fit(columns), refit(moments, 1.0), rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(held_out.lawful_score(columns).energy, score.energy, rtol=1e-9)


@given(st.integers(0, 10_000), st.integers(0, 2))
@settings(max_examples=20)
def test_lawful_fits_are_those_of_a_quadratic_program(seed, more):
    """Against SciPy's bounded least squares, for laws that are signs."""
    rng = np.random.default_rng(seed)
    x, y = regression(seed)
    moments, columns = Moments.from_rows(x, y, blocks=BLOCKS), tuple(KNOWN + k for k in range(more))
    own, pull = [*range(KNOWN), *columns], 0.1
    bounded = rng.random(len(own)) < 0.7
    rows = np.eye(KNOWN + TRIED)[np.array(own)[bounded]]
    folds = np.array_split(np.arange(BLOCKS), 5)
    laws = HalfSpaces(rows, np.zeros(len(rows)))
    held_out = HeldOut(moments, np.arange(KNOWN), np.ones(1), pull * np.eye(KNOWN), folds, laws)
    score = held_out.lawful_score(columns)
    for k, fold in enumerate(folds):
        square = moments.select_blocks(np.setdiff1d(np.arange(BLOCKS), fold)).pooled(np.ones(1))
        H = 1.25 * square.xx[np.ix_(own, own)]
        ridge = np.diag([pull] * KNOWN + [0.0] * more)
        root = np.linalg.cholesky(H + ridge).T
        target = np.linalg.solve(root.T, 1.25 * square.xy[own])
        lower = np.where(bounded, 0.0, -np.inf)
        theta = np.zeros(KNOWN + TRIED)
        theta[own] = lsq_linear(root, target, bounds=(lower, np.inf), tol=1e-14, max_iter=500).x
        wanted = moments.select_blocks(fold).residual_energy(theta).sum(axis=0)
        np.testing.assert_allclose(score.energy[k], wanted, rtol=1e-5)


def test_what_laws_hold_a_candidate_cannot_move():
    """A column that would join beside a coefficient that its sign holds at zero is judged with that one at zero."""
    rng = np.random.default_rng(1)
    x = rng.normal(size=(ROWS, 3))
    y = -x[:, 0] + 0.5 * x[:, 1] + 0.1 * rng.normal(size=ROWS)
    moments, laws = Moments.from_rows(x, y, blocks=BLOCKS), HalfSpaces(np.eye(3)[:1], np.zeros(1))
    folds = np.array_split(np.arange(BLOCKS), 5)
    held_out = HeldOut(moments, np.arange(2), np.ones(1), np.zeros((2, 2)), folds, laws)
    assert held_out.fit()[0] == pytest.approx(0.0, abs=1e-9)
    assert held_out.fit([2])[0] == pytest.approx(0.0, abs=1e-9)
    assert held_out.fit()[1] == pytest.approx(0.5, abs=0.1)

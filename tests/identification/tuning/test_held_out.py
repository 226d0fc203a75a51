"""The choice among candidate columns on moments: what is there is found, what is not stays out."""

import numpy as np
import pytest
from casysid.identification.friction_evidence import Candidate, build_evidence, choose_candidates
from casysid.identification.friction_trial import LEAST_STRENGTH, HeldOutErrors
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from casysid.moments import Moments

ROWS, BLOCKS, KNOWN, TRIED = 2000, 20, 6, 12
NO_LAWS = np.zeros((0, KNOWN + TRIED))


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


def candidates(family=""):
    return [Candidate(f"c{k}", (KNOWN + k,), (0,), family) for k in range(TRIED)]


def choose(x, y, laws=NO_LAWS, among=None):
    evidence = build_evidence(Moments.from_rows(x, y, blocks=BLOCKS), np.zeros(x.shape[1]), laws)
    return choose_candidates(evidence, range(KNOWN), among or candidates())


def test_nothing_is_chosen_among_noise():
    chosen = [choose(*regression(seed)) for seed in range(25)]
    assert sum(map(len, chosen)) <= 1  # of 300 candidates


@given(st.integers(0, 10_000), st.integers(0, TRIED - 1))
@settings(max_examples=10)
def test_what_is_exactly_true_is_found_and_nothing_else(seed, true):
    found = choose(*regression(seed, [(true, 1.0)]))
    assert found[0].candidate.columns == (KNOWN + true,)
    assert 0.5 < found[0].gain <= 1.0
    assert found[0].error_after < found[0].error_before
    assert len(found) <= 2


def test_a_perfect_fit_asks_for_nothing_more():
    x, y = regression(0, noise=0.0)
    assert choose(x, y) == ()


def test_several_are_found_one_after_the_other_the_largest_first():
    found = choose(*regression(1, [(3, 0.8), (7, 1.6)]))
    assert [finding.candidate.name for finding in found] == ["c7", "c3"]


def test_of_one_name_only_the_best_joins():
    rivals = [Candidate("same", (KNOWN + k,), (0,)) for k in range(TRIED)]
    found = choose(*regression(2, [(3, 0.8), (7, 1.6)]), among=rivals)
    assert [finding.candidate.columns for finding in found] == [(KNOWN + 7,)]


def test_a_sign_that_physics_forbids_keeps_a_candidate_out():
    law = np.eye(KNOWN + TRIED)[[KNOWN + 3]]
    assert choose(*regression(3, [(3, -1.0)]), laws=law) == ()
    assert len(choose(*regression(3, [(3, 1.0)]), laws=law)) == 1


def test_a_column_that_helps_in_one_stretch_alone_is_left_out():
    x, y = regression(4)
    y[500:600] += 4.0 * x[500:600, KNOWN + 2]
    assert choose(x, y) == ()


def test_too_few_blocks_choose_nothing():
    x, y = regression(5, [(3, 2.0)])
    evidence = build_evidence(Moments.from_rows(x, y, blocks=3), np.zeros(x.shape[1]), NO_LAWS)
    assert choose_candidates(evidence, range(KNOWN), candidates()) == ()


def test_whole_recordings_are_left_out_when_there_are_enough():
    x, y = regression(6)
    moments = Moments.from_rows(x, y, blocks=BLOCKS)
    by_recording = build_evidence(moments, np.zeros(x.shape[1]), NO_LAWS, recordings=10)
    assert [fold.tolist() for fold in by_recording.partitions[1]] == [[2 * k, 2 * k + 1] for k in range(10)]


def test_what_helps_within_recordings_but_not_from_one_to_the_other_stays_out():
    x, y = regression(11)
    half = ROWS // 2
    x[:half, KNOWN + 2] *= 0.5
    y = y + np.where(np.arange(ROWS) < half, 1.8, 0.7) * x[:, KNOWN + 2]  # each fits itself, and the other overmuch
    moments = Moments.from_rows(x, y, blocks=BLOCKS)
    one, two = (build_evidence(moments, np.zeros(x.shape[1]), NO_LAWS, recordings=count) for count in (1, 2))
    assert [finding.candidate.name for finding in choose_candidates(one, range(KNOWN), candidates())] == ["c2"]
    assert choose_candidates(two, range(KNOWN), candidates()) == ()


def test_what_is_true_of_every_recording_is_found_in_two():
    x, y = regression(1, [(3, 0.8)])
    evidence = build_evidence(Moments.from_rows(x, y, blocks=BLOCKS), np.zeros(x.shape[1]), NO_LAWS, recordings=2)
    assert [finding.candidate.name for finding in choose_candidates(evidence, range(KNOWN), candidates())] == ["c3"]


@pytest.mark.parametrize("columns", [(), (KNOWN + 1,), (KNOWN + 1, KNOWN + 4)])
def test_held_out_energies_are_those_of_fits_one_by_one(columns):
    rng = np.random.default_rng(7)
    rows = [regression(seed, [(1, 1.0)]) for seed in (8, 9)]
    rows[1][0][:, KNOWN + 4] = 0.0  # acts on the first joint alone
    parts = [Moments.from_rows(x, y, blocks=BLOCKS) for x, y in rows]
    gram, count = (np.concatenate([getattr(part, name) for part in parts], axis=1) for name in ("gram", "count"))
    moments = Moments.from_dense(gram, count, parts[0].columns, ("one", "two"))
    weights, strength = rng.uniform(0.5, 2.0, 2), 1e-3
    stretches = np.array_split(np.arange(BLOCKS), 5)
    root = rng.normal(size=(KNOWN, KNOWN))
    errors = HeldOutErrors(moments, np.arange(KNOWN), weights, root @ root.T, strength, stretches)
    model, energy = [*range(KNOWN), *columns], np.diag(moments.pooled(weights).xx)
    ridge = np.diag(np.append(LEAST_STRENGTH * energy[:KNOWN], strength * energy[list(columns)]))
    ridge[:KNOWN, :KNOWN] += root @ root.T
    wanted = []
    for stretch in stretches:
        rest = moments.select_blocks(np.setdiff1d(np.arange(BLOCKS), stretch)).pooled(weights)
        part = 5.0 / 4.0
        theta = np.zeros(KNOWN + TRIED)
        theta[model] = np.linalg.solve(part * rest.xx[np.ix_(model, model)] + ridge, part * rest.xy[model])
        wanted.append(moments.select_blocks(stretch).residual_energy(theta).sum(axis=0))
    wanted = np.array(wanted)
    np.testing.assert_allclose(errors.all_energies(columns), wanted, rtol=1e-9)
    for joints in [(0, 1), (0,)][KNOWN + 4 in columns :]:
        _, after = errors.energies(columns, joints)
        np.testing.assert_allclose(after, wanted[:, joints] @ weights[list(joints)], rtol=1e-9)
    if not columns:
        before, _ = errors.energies((KNOWN + 1,), (1,))
        np.testing.assert_allclose(before, wanted[:, 1] * weights[1], rtol=1e-9)

"""Denoised moments: attenuation goes, safety stays."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh
from scipy.stats import t as student

from casysid.errors import ParameterError
from casysid.estimation import ErrorsInVariables, Ridge, WeightedLeastSquares
from casysid.estimation.errors_in_variables import limit_noise
from casysid.moments import Moments

TRUTH = np.array([1.0, -2.0, 0.5])


def noisy_problem(seed, noise, rows=4000, blocks=8):
    """Inputs measured with white noise of known variance; each row's second moment has grown by it."""
    rng = np.random.default_rng(seed)
    clean = rng.normal(size=(rows, 3)) @ np.array([[1.0, 0.6, 0.1], [0.0, 1.0, 0.4], [0.0, 0.0, 0.5]])
    x = clean + noise * rng.normal(size=clean.shape)
    moments = Moments.from_rows(x, clean @ TRUTH + 0.1 * rng.normal(size=rows), blocks=blocks)
    grown = np.zeros_like(moments.gram)
    grown[:, 0, :3, :3] = noise**2 * np.eye(3) * moments.count[:, 0, None, None]
    return dataclasses.replace(moments, noise=(grown[:, 0],))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise", [0.1, 0.2])
def test_the_attenuation_is_removed(seed, noise):
    moments = noisy_problem(seed, noise)
    plain = WeightedLeastSquares().estimate(moments).parameters
    corrected = ErrorsInVariables(WeightedLeastSquares()).estimate(moments).parameters
    assert np.linalg.norm(corrected - TRUTH) < 0.4 * np.linalg.norm(plain - TRUTH)


def test_without_noise_it_is_the_estimator_itself():
    moments = noisy_problem(0, 0.1)
    for inner in (WeightedLeastSquares(), Ridge()):
        quiet = dataclasses.replace(moments, noise=(np.zeros_like(moments.gram[:, 0]),))
        silent = dataclasses.replace(moments, noise=None)
        expected = inner.estimate(silent).parameters
        assert ErrorsInVariables(inner).estimate(quiet).parameters == pytest.approx(expected, abs=1e-12)
        assert ErrorsInVariables(inner).estimate(silent).parameters == pytest.approx(expected, abs=1e-12)


def shares(moments):
    """Generalised eigenvalues of pooled noise and sums."""
    noise, gram = moments.pooled_noise()[:-1, :-1], moments.pooled().xx
    return eigh(noise, gram, eigvals_only=True)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.5, 30.0))
def test_heavy_noise_is_removed_only_as_far_as_is_safe(seed, overstated):
    moments = noisy_problem(seed % 1000, 0.5)
    loud = dataclasses.replace(moments, noise=tuple(overstated * sums for sums in moments.noise))
    estimate = ErrorsInVariables().estimate(loud)
    assert np.isfinite(estimate.parameters).all()
    limited = limit_noise(loud, 0.95)
    assert shares(limited.moments) == pytest.approx(np.minimum(shares(loud), 0.95), abs=1e-9)
    assert np.linalg.eigvalsh(limited.moments.denoised().pooled().xx).min() > 0.0
    assert limited.directions == np.sum(shares(loud) > 0.95) == estimate.diagnostics["directions_too_noisy"]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e3))
def test_what_is_left_is_positive_under_any_weights_of_the_joints(seed, loudness):
    """Joints with rows of other columns, some without any, and noise of any shape, often more than there is in all."""
    rng = np.random.default_rng(seed)
    blocks, joints, p = 5, 3, 6
    gram, noise = np.zeros((2, blocks, joints, p + 1, p + 1))
    for joint in range(joints):
        places = np.append(np.flatnonzero(rng.random(p) < 0.6), p)
        for sums, size, rank in ((gram, 1.0, 4), (noise, loudness, rng.integers(1, 4))):
            rows = np.sqrt(size) * rng.normal(size=(blocks, rank, len(places))) * 10.0 ** rng.uniform(-1, 1)
            sums[:, joint, places[:, None], places] = np.swapaxes(rows, 1, 2) @ rows
    moments = Moments.from_dense(gram, np.full((blocks, joints), 9.0), tuple("abcdef"), tuple("ijk"), noise=noise)
    limited = limit_noise(moments, 0.95)
    for weights in (np.ones(joints), *(10.0 ** rng.uniform(-6, 6, (3, joints)))):
        left = limited.moments.denoised().pooled(weights).xx
        size = np.sqrt(np.maximum(np.diag(moments.pooled(weights).xx), np.finfo(float).tiny))
        assert np.linalg.eigvalsh(left / np.outer(size, size)).min() > -1e-9
    for joint in range(joints):
        shown = Moments((moments.squares[joint],), *_row(moments, joint), noise=(limited.moments.noise[joint],))
        G, N = shown.pooled().xx, shown.pooled_noise()[:-1, :-1]
        assert np.linalg.eigvalsh(0.95 * G - N).min() > -1e-9 * max(np.trace(G), 1.0)


def _row(moments, joint):
    return (moments.row_columns[joint],), moments.count[:, [joint]], moments.columns, (moments.joints[joint],)


def test_one_hopeless_direction_does_not_spoil_the_others():
    """The third column is pure noise: the other two come out as if it were not there."""
    rng = np.random.default_rng(0)
    clean = rng.normal(size=(6000, 3)) * [1.0, 1.0, 0.0]
    noise = np.array([0.3, 0.3, 1.0])
    x = clean + noise * rng.normal(size=clean.shape)
    moments = Moments.from_rows(x, clean @ TRUTH + 0.1 * rng.normal(size=6000), blocks=8)
    grown = np.zeros_like(moments.gram)
    grown[:, 0, :3, :3] = np.diag(noise**2) * moments.count[:, 0, None, None] * 1.02
    estimate = ErrorsInVariables(WeightedLeastSquares()).estimate(dataclasses.replace(moments, noise=(grown[:, 0],)))
    assert estimate.diagnostics["directions_too_noisy"] == 1
    assert estimate.parameters[:2] == pytest.approx(TRUTH[:2], abs=0.03)


def test_standard_errors_hold_what_the_noise_level_leaves_open():
    """A known noise level off by its own standard error moves the parameters by what is added to theirs."""
    moments = noisy_problem(1, 0.3)
    method, error = ErrorsInVariables(WeightedLeastSquares()), 1e-3
    sure, unsure = (method.estimate(dataclasses.replace(moments, noise_error=e)) for e in (0.0, error))
    added = unsure.covariance - sure.covariance
    more = dataclasses.replace(moments, noise=tuple((1.0 + error) * sums for sums in moments.noise))
    moved = method.estimate(more).parameters - sure.parameters
    assert np.sqrt(np.diag(added)) == pytest.approx(np.abs(moved), rel=0.02)


def test_intervals_cover_the_truth():
    covered = []
    for seed in range(120):
        estimate = ErrorsInVariables(WeightedLeastSquares()).estimate(noisy_problem(seed, 0.3, rows=1500, blocks=15))
        half = student.ppf(0.975, estimate.spread.freedom) * estimate.std
        covered.append(np.abs(estimate.parameters - TRUTH) <= half)
    assert 0.91 <= np.mean(covered) <= 0.985


def test_noise_follows_its_moments_through_shift_sum_and_choice():
    moments, prior = noisy_problem(0, 0.2), np.array([0.3, 0.1, -0.2])
    direct = moments.denoised().shifted(prior)
    assert np.allclose(moments.shifted(prior).denoised().gram, direct.gram)
    both = moments + moments
    assert np.allclose(both.denoised().gram.sum(axis=0), 2 * moments.denoised().gram.sum(axis=0))
    assert np.allclose(moments.select_blocks([1, 3]).denoised().gram, moments.denoised().gram[[1, 3]])


def test_a_margin_outside_its_range_is_named():
    with pytest.raises(ParameterError, match="margin must lie between 0 and 1"):
        ErrorsInVariables(margin=1.0)

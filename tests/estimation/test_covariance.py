"""Covariance from blocks against its slow form, which holds every block and joint in all directions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.estimation.covariance import HEAVIEST_BLOCK, _covariance_of_scores, _positive, _prior_freedom
from casysid.moments import Moments


def draw_tree(rng: np.random.Generator, blocks: int) -> tuple[Moments, np.ndarray]:
    """Three joints with columns of their own, and the parameters of their least squares."""
    own = [np.arange(6), np.array([1, 3, 5]), np.array([2, 3, 4])]
    truth, squares = rng.normal(size=6), []
    for joint, columns in enumerate(own):
        x = rng.normal(size=(blocks, 40, len(columns)))
        y = x @ truth[columns] + (1.0 + joint) * np.repeat(rng.normal(size=(blocks, 8)), 5, axis=1)
        rows = np.concatenate([x, y[..., None]], axis=2)
        squares.append(np.swapaxes(rows, 1, 2) @ rows)
    count = np.full((blocks, 3), 40.0)
    return Moments(tuple(squares), tuple(own), count, tuple("abcdef"), ("one", "two", "three")), truth


def slowly(moments: Moments, parameters: np.ndarray, weights: np.ndarray, W: np.ndarray) -> tuple[np.ndarray, float]:
    gram = weights[:, None, None] * moments.gram[:, :, :-1]
    L = W.T @ gram[..., :-1] @ W  # (blocks, joints, r, r)
    g = (gram @ np.append(-parameters, 1.0)) @ W
    g = g - L @ g.sum(axis=(0, 1))
    rows, r = moments.count.sum(axis=0), W.shape[1]
    freedom = np.maximum(rows * (1.0 - r / max(rows.sum(), r + 1.0)), 1.0)
    white = weights * moments.residual_energy(parameters).sum(axis=0) / freedom
    square, total = (L @ L).sum(axis=0), L.sum(axis=0)
    system = np.einsum("jrs,isr->ji", square, total)
    system[np.diag_indices(3)] += np.einsum("jrr->j", total) - 2.0 * np.einsum("jrr->j", square)
    inflation = np.linalg.lstsq(system, np.einsum("bjr,bjr->j", g, g), rcond=None)[0]
    pooled = np.einsum("j,jrs->rs", np.maximum(inflation, white), total)
    L, g = L.sum(axis=1), g.sum(axis=1)
    share, vectors = np.linalg.eigh(L)
    share = np.clip(share, 0.0, 1.0)
    left = np.maximum(1.0 - share, 1.0 - HEAVIEST_BLOCK)
    kept = np.einsum("brs,bs,bts->rt", vectors, share * (1.0 - share) / left, vectors)
    restored = np.einsum("brs,bs,bts,bt->br", vectors, left**-0.5, vectors, g)
    size, axes = np.linalg.eigh(pooled)
    root = axes * np.sqrt(size)
    direct = restored.T @ restored + root @ _positive(np.eye(r) - kept) @ root.T
    expected = -np.einsum("brs,bst,tr->", L[:-1], L[1:], direct)
    remembered = max(1.0 + 2.0 * (np.sum(g[:-1] * g[1:]) - expected) / np.trace(direct), 1.0)
    squared = np.einsum("brr->br", L) ** 2
    own = np.maximum(1.0 / np.maximum(squared.sum(axis=0), 1.0 / moments.blocks) - 1.0, 1.0)
    prior, typical = _prior_freedom(np.diag(direct) / np.diag(pooled), own), float(np.mean(own))
    return remembered * (prior * pooled + typical * direct) / (prior + typical), typical


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 9))
def test_joints_seen_in_their_own_columns_give_the_same_covariance(seed, blocks):
    rng = np.random.default_rng(seed)
    moments, truth = draw_tree(rng, blocks)
    weights = rng.uniform(0.2, 2.0, 3)
    W = np.linalg.inv(np.linalg.cholesky(moments.pooled(weights).xx)).T
    parameters = truth + 0.1 * rng.normal(size=6)
    got, freedom = _covariance_of_scores(moments, parameters, weights, W)
    wanted, expected = slowly(moments, parameters, weights, W)
    assert freedom == pytest.approx(expected)
    np.testing.assert_allclose(got, wanted, rtol=1e-6, atol=1e-9 * np.abs(wanted).max())

"""Standard errors that survive coloured residuals.

Residuals of a robot's torque are never white: friction, elasticity and the low-pass colour them, and the textbook
``σ² (XᵀX)⁻¹`` is far too small. Scores summed over blocks of time carry that colour. One inflation factor by joint, the
ratio of the scores' variance between blocks to what white residuals would give, pooled over all seen directions, is
stable even when there are fewer blocks than parameters, where the plain sandwich would be singular.
"""

from __future__ import annotations

import numpy as np

from casysid.arrays import Array
from casysid.estimation.standardise import LEVERAGE_TOLERANCE, SPECTRUM_TOLERANCE
from casysid.moments import Moments


def block_covariance(moments: Moments, parameters: Array, weights: Array) -> Array:
    """Covariance of weighted least squares, shape (p, p); infinite variance for what the data do not see.

    Args:
        moments: The fitted moments.
        parameters: The least-squares ``θ``, shape (p,).
        weights: Row weights by joint, shape (joints,).

    Source: the cluster-robust sandwich (Liang and Zeger 1986), its meat modelled as ``Σ_j κ_j w_j² σ_j² S_j``.
    """
    gram = moments.gram.sum(axis=0)[:, :-1, :-1]  # (joints, p, p)
    energy = np.einsum("j,jmm->m", weights, gram)
    live = energy > 0.0
    scale = np.where(live, 1.0 / np.sqrt(np.where(live, energy, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(np.einsum("j,jmn->mn", weights, gram) * np.outer(scale, scale))
    seen = values > SPECTRUM_TOLERANCE * max(values.max(initial=0.0), np.finfo(np.float64).tiny)
    basis = scale[:, None] * vectors[:, seen]  # (p, r), standardised directions
    freedom = np.maximum(
        moments.count.sum(axis=0) * (1.0 - seen.sum() / max(moments.count.sum(), seen.sum() + 1.0)), 1.0
    )
    variance = moments.residual_energy(parameters).sum(axis=0) / freedom  # (joints,)
    white = np.einsum("jmn,mr,ns->jrs", gram, basis, basis, optimize=True)  # (joints, r, r)
    inflation = _inflation(moments, parameters, basis, values[seen], white, variance)
    meat = np.einsum("j,jrs->rs", weights**2 * variance * inflation, white)
    spread = basis / values[seen]
    covariance = spread @ meat @ spread.T
    unseen = ~live | (1.0 - np.einsum("mr,mr->m", vectors[:, seen], vectors[:, seen]) > LEVERAGE_TOLERANCE)
    covariance[unseen, :] = covariance[:, unseen] = 0.0
    covariance[unseen, unseen] = np.inf
    return np.asarray(covariance)


def _inflation(
    moments: Moments, parameters: Array, basis: Array, values: Array, white: Array, variance: Array
) -> Array:
    """Variance of the blocks' scores over white residuals', by joint, never below one; ones for a single block."""
    if moments.blocks < 2:
        return np.ones(len(variance))
    residual = np.append(-parameters, 1.0)
    scores = np.einsum("bjmn,n,mr->bjr", moments.gram[:, :, :-1, :], residual, basis, optimize=True)
    scores = scores - scores.mean(axis=0)
    energy = np.einsum("bjr,r->j", scores**2, 1.0 / values) * moments.blocks / (moments.blocks - 1)
    expected = variance * np.einsum("jrr,r->j", white, 1.0 / values)
    return np.asarray(np.maximum(energy / np.where(expected > 0.0, expected, np.inf), 1.0))

"""Standard errors that survive coloured residuals.

Residuals of a robot's torque are never white: friction, elasticity and the low-pass colour them, and the textbook
``σ² (XᵀX)⁻¹`` is far too small. Scores ``Σ x w (y - xᵀθ)`` summed over blocks of time carry that colour, and two
estimates of their covariance are drawn from them: block by block without any model, unbiased but of few degrees of
freedom; and as ``κ_j`` times that of white residuals, one inflation for each joint, which is stable but holds that all
directions are inflated alike. The answer weighs the two by how much the directions really differ.

Everything is computed in directions of unit information, ``Wᵀ H W = 1``, where the scores of least squares on white
residuals have unit covariance.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.special import digamma, polygamma

from casysid.arrays import Array
from casysid.estimation.base import Spread
from casysid.moments import Moments

RANK_TOLERANCE = 1e-9
"""Eigenvalues of the information, scaled to unit diagonal, below this fraction of the largest are no knowledge."""
ENERGY_TOLERANCE = 1e-24
"""A column with less than this fraction of the strongest column's energy is zero."""
CLEARLY_OFF = 3.0
"""Least squares shows a direction of the prior to be off when it is at least so many of its standard errors away."""
HEAVIEST_BLOCK = 0.9
"""A direction of which one block holds more than this share says nothing of its own spread from block to block."""
ROUNDING = 1e-14
"""Variances of the prior below this fraction of the largest are rounding."""
PRIOR_STEPS = 50
"""Of the expectation-maximisation that finds how far off the prior is."""
MOST_POOLED = 2.0
"""The pooled estimate never counts for more than so many times the degrees of freedom of the direct one."""


def block_covariance(moments: Moments, parameters: Array, weights: Array) -> Array:
    """Covariance of weighted least squares, shape (p, p); infinite variance for what the data do not see.

    Arguments as for :func:`covariance_from_blocks`.
    """
    return covariance_from_blocks(moments, parameters, weights).marked


def covariance_from_blocks(moments: Moments, parameters: Array, weights: Array, prior: Array | None = None) -> Spread:
    """Covariance of least squares, or of a ridge with the error that its pull to the prior brings.

    Ridge's pull stands for a Gaussian prior of the parameters, of known shape and unknown size, which is estimated
    together with the rest: to the noise ``M`` of least squares comes the error of what is pulled. In directions of unit
    information that the prior holds with variances ``q``, ``C = (1 + 1/q)⁻¹ (M + τ²/q) (1 + 1/q)⁻¹``. With ``τ²`` the
    variance of the noise this would be the posterior covariance; it is more where the prior is farther off than its
    strength says, in all directions together or, as far as least squares shows it beyond its noise, in one.

    Args:
        moments: The fitted moments, relative to the prior if there is one.
        parameters: ``θ``, shape (p,).
        weights: Row weights by joint, shape (joints,).
        prior: The ridge's, ``K``: the inverse of what it adds to the weighted ``S_xx``, (p, p); None for none.

    Source: the cluster-robust sandwich (Liang and Zeger 1986) with the bias correction of Bell and McCaffrey (2002),
    moderated as in Smyth (2004).
    """
    normal = moments.pooled(weights)
    energy = np.diag(normal.xx)
    live = energy > ENERGY_TOLERANCE * energy.max(initial=0.0)
    inverse = np.where(live, 1.0 / np.sqrt(np.where(live, energy, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(normal.xx * np.outer(inverse, inverse))
    known = values > RANK_TOLERANCE * max(values.max(initial=0.0), np.finfo(np.float64).tiny)
    W = inverse[:, None] * vectors[:, known] / np.sqrt(values[known])  # (p, r)
    M, freedom = _covariance_of_scores(moments, parameters, weights, W)
    scale = np.where(live, inverse, inverse.max(initial=0.0) or 1.0)
    if prior is None or not known.any():
        return Spread.without_prior(W @ M @ W.T, vectors[:, ~known], scale, freedom)
    sight = np.where(live, np.sqrt(energy), 0.0)[:, None] * vectors[:, known] * np.sqrt(values[known])  # H W
    covariance, settled = _pulled(M, W.T @ normal.xy, sight, prior)
    return Spread(covariance, vectors[:, ~known], scale, freedom, prior, settled)


def _pulled(meat: Array, solution: Array, sight: Array, prior: Array) -> tuple[Array, Array]:
    """The mean square error of a ridge, and what of the prior's covariance it has settled, shape (p, p) each.

    What the data do not see moves along as the prior lets it.

    Args:
        meat: ``M``, in directions of unit information, shape (r, r).
        solution: Least squares in them, relative to the prior, shape (r,).
        sight: Their gradients ``H W``, shape (p, r).
        prior: ``K``, shape (p, p).
    """
    size, vectors = np.linalg.eigh(sight.T @ prior @ sight)
    q = np.maximum(size, max(ROUNDING * size.max(initial=0.0), np.finfo(np.float64).tiny))
    noise, off = vectors.T @ meat @ vectors, vectors.T @ solution
    variance = _prior_variance(1.0 / q, off, float(np.trace(meat)) / len(meat))
    error = np.where(_shown_off(off, np.diag(noise), variance * q), np.maximum(off**2 / q, variance), variance)
    shrunk = prior @ sight @ vectors / (1.0 + q)
    held = shrunk / np.sqrt(q)
    covariance = shrunk @ noise @ shrunk.T + (held * error) @ held.T
    return covariance, (shrunk * (1.0 + q)) @ shrunk.T


def _shown_off(off: Array, noise: Array, expected: Array) -> npt.NDArray[np.bool_]:
    """Where a prior that is off by as much as least squares says is likelier than a prior that is right, and noise.

    The prior's tails are taken for those of Cauchy's distribution: the farther off, the clearer it has to be shown.

    Args:
        off: Least squares, relative to the prior, shape (r,).
        noise: Its variance, shape (r,).
        expected: Variance of the prior, shape (r,).
    """
    clear = off**2 / np.maximum(noise, np.finfo(np.float64).tiny)
    doubt = 2.0 * np.log(np.maximum(clear * np.sqrt(noise / expected), 1.0))
    return np.asarray(clear > np.maximum(CLEARLY_OFF**2, doubt))


def _prior_variance(strength: Array, solution: Array, noise: float) -> float:
    """``τ²`` of ``δ_k ~ N(0, τ² / p_k)`` from ``δ_k`` seen with a noise, at least the noise's (EM, Tipping 2001)."""
    pulled = strength > 0.0
    p, d = strength[pulled], solution[pulled]
    spread = noise
    for _ in range(PRIOR_STEPS if len(p) else 0):
        variance = 1.0 / (p / spread + 1.0 / noise)
        spread = float(np.mean(p * ((variance * d / noise) ** 2 + variance)))
    return max(spread, noise)


def _covariance_of_scores(moments: Moments, parameters: Array, weights: Array, W: Array) -> tuple[Array, float]:
    """Covariance of the summed scores in directions ``W`` of unit information, (r, r), and its degrees of freedom.

    These are the blocks' own, as if nothing were pooled: what the pooled estimate gains in steadiness it may lose to
    directions that differ.
    """
    rows, r = moments.count.sum(axis=0), W.shape[1]
    freedom = np.maximum(rows * (1.0 - r / max(rows.sum(), r + 1.0)), 1.0)
    white = weights * moments.residual_energy(parameters).sum(axis=0) / freedom  # (joints,)
    if moments.blocks < 2 or r == 0:
        return W.T @ moments.pooled(weights * white).xx @ W, np.inf
    fitted = parameters + W @ (W.T @ moments.scores(parameters, weights).sum(axis=0))  # least squares: scores add to 0
    inflation = np.maximum(_inflation(moments, fitted, weights, W @ W.T), white)
    pooled = W.T @ moments.pooled(weights * inflation).xx @ W
    direct, remembered, squared = _direct(moments, weights, W, moments.scores(fitted, weights) @ W, pooled)
    own = np.maximum(1.0 / np.maximum(squared, 1.0 / moments.blocks) - 1.0, 1.0)
    prior = _prior_freedom(np.diag(direct) / np.diag(pooled), own)
    typical = float(np.mean(own))
    meat = (prior * pooled + typical * direct) / (prior + typical)
    return meat * remembered, typical


def _inflation(moments: Moments, fitted: Array, weights: Array, K: Array) -> Array:
    """``κ_j``: variance of each joint's residuals over that of white ones of variance ``1/w_j``, shape (joints,).

    With the shares ``L_bj`` of the information, scores ``g_bj`` in directions of unit information have
    ``E |g_bj|² = κ_j (tr L_bj - 2 tr L_bj²) + Σ_i κ_i tr(L_bj L_i L_bj)``, a linear system. Joints are seen in their
    own columns, where ``K = W Wᵀ``, (p, p), stands for the directions.
    """
    joints = range(len(weights))
    rows = moments.row_columns
    gram = [w * sums[:, :-1, :-1].sum(axis=0) for w, sums in zip(weights, moments.squares, strict=True)]
    system, energy = np.empty((len(joints), len(joints))), np.empty(len(joints))
    for j in joints:
        own, blocks = K[np.ix_(rows[j], rows[j])], weights[j] * moments.squares[j][:, :-1]
        square = sum(block @ own @ block for block in blocks[..., :-1])  # (w, w)
        scores = blocks @ np.append(-fitted[rows[j]], 1.0)
        energy[j] = np.einsum("bm,mn,bn->", scores, own, scores, optimize=True)
        for i in joints:
            across = K[np.ix_(rows[j], rows[i])]
            system[j, i] = np.sum(square * (across @ gram[i] @ across.T))
        system[j, j] += np.sum(gram[j] * own) - 2.0 * np.sum(square * own)
    return np.asarray(np.linalg.lstsq(system, energy, rcond=None)[0])


def _shares(moments: Moments, weights: Array, W: Array) -> Iterator[Array]:
    """``L_b``, what each block has of the information in directions of unit information, shape (r, r)."""
    for block in moments.by_block(weights):
        yield W.T @ block[:-1, :-1] @ W


def _direct(moments: Moments, weights: Array, W: Array, values: Array, pooled: Array) -> tuple[Array, float, Array]:
    """Covariance from the blocks alone, and what else the blocks tell.

    Least squares takes from a block's scores what it can explain; ``(1 - L_b)^-½`` gives it back. What a block decides
    nearly alone cannot be given back, and is taken from the pooled estimate.

    Args:
        moments: The fitted moments.
        weights: Row weights by joint, shape (joints,).
        W: Directions of unit information, shape (p, r).
        values: Scores of least squares in them by block, shape (blocks, r).
        pooled: Covariance of the summed scores from the pooled estimate, shape (r, r).

    Returns:
        The covariance (r, r); the factor for what neighbouring blocks have in common; for each direction the sum of
        the squared shares of the blocks, shape (r,).
    """
    kept, squared, restored = np.zeros_like(pooled), np.zeros(len(pooled)), np.empty_like(values)
    for b, information in enumerate(_shares(moments, weights, W)):
        share, vectors = np.linalg.eigh(information)
        share = np.clip(share, 0.0, 1.0)
        left = np.maximum(1.0 - share, 1.0 - HEAVIEST_BLOCK)
        restored[b] = vectors @ (left**-0.5 * (vectors.T @ values[b]))
        kept += (vectors * (share * (1.0 - share) / left)) @ vectors.T
        squared += np.diag(information) ** 2
    size, axes = np.linalg.eigh(0.5 * (pooled + pooled.T))
    root = axes * np.sqrt(np.maximum(size, 0.0))  # denoised moments need not be positive definite
    direct = restored.T @ restored + root @ _positive(np.eye(len(kept)) - kept) @ root.T
    common = float(np.sum(values[:-1] * values[1:]))
    neighbours = pairwise(_shares(moments, weights, W))
    expected = -sum(float(np.sum(one * (direct @ other))) for one, other in neighbours)
    return direct, max(1.0 + 2.0 * (common - expected) / max(float(np.trace(direct)), 1e-300), 1.0), squared


def _positive(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _prior_freedom(ratio: Array, freedom: Array) -> float:
    """How many degrees of freedom the pooled estimate is worth, from how far directions differ (Smyth 2004, §6.2)."""
    most = MOST_POOLED * float(np.mean(freedom))
    if len(ratio) < 2:
        return most
    logs = np.log(np.maximum(ratio, 1e-12)) - digamma(freedom / 2.0) + np.log(freedom / 2.0)
    differing = float(np.var(logs, ddof=1) - np.mean(polygamma(1, freedom / 2.0)))
    return most if differing <= 0.0 else min(2.0 * _inverse_trigamma(differing), most)


def _inverse_trigamma(value: float) -> float:
    """``x`` of ``trigamma(x) = value`` by Newton's method (Smyth 2004, appendix)."""
    x = 0.5 + 1.0 / value
    for _ in range(20):
        trigamma = float(polygamma(1, x))
        step = trigamma * (1.0 - trigamma / value) / float(polygamma(2, x))
        x += step
        if -step < 1e-8 * x:
            break
    return x

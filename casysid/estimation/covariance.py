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

from dataclasses import dataclass

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
    scores = _scores_of(moments, parameters, weights, W)
    M, freedom = _covariance_of_scores(moments, scores, parameters, weights)
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


@dataclass(frozen=True, eq=False)
class _Scores:
    """Scores of least squares and their share of the information, in directions of unit information.

    Attributes:
        information: ``L_bj``, shape (blocks, joints, r, r); they add to the unit matrix.
        values: ``g_bj``, shape (blocks, joints, r); they add to zero.
    """

    information: Array
    values: Array


def _scores_of(moments: Moments, parameters: Array, weights: Array, W: Array) -> _Scores:
    shape = (moments.blocks, len(moments.joints), W.shape[1])
    information, values = np.empty((*shape, W.shape[1])), np.empty(shape)
    for joint, weight in enumerate(weights):
        columns, squares = moments.of_joint(joint)
        gram, own = weight * squares[:, :-1], W[columns]
        information[:, joint] = own.T @ (gram[..., :-1] @ own)
        values[:, joint] = (gram @ np.append(-parameters[columns], 1.0)) @ own
    return _Scores(information, values - information @ values.sum(axis=(0, 1)))  # moved to the least squares


def _covariance_of_scores(moments: Moments, scores: _Scores, parameters: Array, weights: Array) -> tuple[Array, float]:
    """Covariance of the summed scores, shape (r, r), and its degrees of freedom.

    These are the blocks' own, as if nothing were pooled: what the pooled estimate gains in steadiness it may lose to
    directions that differ.
    """
    rows, r = moments.count.sum(axis=0), scores.values.shape[2]
    freedom = np.maximum(rows * (1.0 - r / max(rows.sum(), r + 1.0)), 1.0)
    white = weights * moments.residual_energy(parameters).sum(axis=0) / freedom  # (joints,)
    by_joint = scores.information.sum(axis=0)  # (joints, r, r)
    if moments.blocks < 2 or r == 0:
        return np.einsum("j,jrs->rs", white, by_joint), np.inf
    inflation = np.maximum(_inflation(scores), white)
    pooled = np.einsum("j,jrs->rs", inflation, by_joint)
    information, values = scores.information.sum(axis=1), scores.values.sum(axis=1)
    direct, remembered = _direct(information, values, pooled)
    share = np.einsum("brr->br", information)
    own = np.maximum(1.0 / np.maximum((share**2).sum(axis=0), 1.0 / moments.blocks) - 1.0, 1.0)
    prior = _prior_freedom(np.diag(direct) / np.diag(pooled), own)
    typical = float(np.mean(own))
    meat = (prior * pooled + typical * direct) / (prior + typical)
    return meat * remembered, typical


def _inflation(scores: _Scores) -> Array:
    """``κ_j``: variance of each joint's residuals over that of white ones of variance ``1/w_j``, shape (joints,).

    ``E |g_bj|² = κ_j (tr L_bj - 2 tr L_bj²) + Σ_i κ_i tr(L_bj L_i L_bj)``, a linear system.
    """
    L, total = scores.information, scores.information.sum(axis=0)
    square = np.matmul(L, L).sum(axis=0)
    system = np.einsum("jrs,isr->ji", square, total)
    system[np.diag_indices_from(system)] += np.einsum("jrr->j", total) - 2.0 * np.einsum("jrr->j", square)
    energy = np.einsum("bjr,bjr->j", scores.values, scores.values)
    return np.asarray(np.linalg.lstsq(system, energy, rcond=None)[0])


def _direct(information: Array, values: Array, pooled: Array) -> tuple[Array, float]:
    """Covariance from the blocks alone, shape (r, r), and the factor for what neighbouring blocks have in common.

    Least squares takes from a block's scores what it can explain; ``(1 - L_b)^-½`` gives it back. What a block decides
    nearly alone cannot be given back, and is taken from the pooled estimate.
    """
    share, vectors = np.linalg.eigh(information)  # (blocks, r), (blocks, r, r)
    share = np.clip(share, 0.0, 1.0)
    left = np.maximum(1.0 - share, 1.0 - HEAVIEST_BLOCK)
    across = np.swapaxes(vectors, 1, 2)
    restored = (vectors @ (left[:, :, None] ** -0.5 * (across @ values[:, :, None])))[..., 0]
    kept = (vectors * (share * (1.0 - share) / left)[:, None, :]) @ across
    lost = np.eye(values.shape[1]) - kept.sum(axis=0)
    size, axes = np.linalg.eigh(0.5 * (pooled + pooled.T))
    root = axes * np.sqrt(np.maximum(size, 0.0))  # denoised moments need not be positive definite
    direct = restored.T @ restored + root @ _positive(lost) @ root.T
    common = float(np.sum(values[:-1] * values[1:]))
    expected = -float(np.einsum("brs,bsr->", information[:-1], information[1:] @ direct))
    return direct, max(1.0 + 2.0 * (common - expected) / max(float(np.trace(direct)), 1e-300), 1.0)


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

"""Ridge in the geometry of the model file: shape, strength, and what data alone cannot say."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings

from casysid.estimation import Ridge, WeightedLeastSquares
from casysid.estimation.prior_covariance import links_among, prior_covariance
from casysid.estimation.standardise import standardise
from casysid.inertia import KINDS, congruence, is_consistent
from casysid.moments import Moments
from tests.strategies import generators, random_inertia, random_placement

LAWS = settings(max_examples=20, deadline=None)
LINKS = tuple(f"{link}.{kind}" for link in ("upper", "fore") for kind in KINDS)
COLUMNS = ("bias", *LINKS, "elbow.viscous")
PLACES = (slice(1, 11), slice(11, 21))


def draw(rng: np.random.Generator, *, noise: float, rows: int = 400, directions: int = 9, blocks: int = 10):
    """Moments of rows that show few directions, a model file, and the truth near it."""
    bodies = np.concatenate([random_inertia(rng).toDynamicParameters() for _ in PLACES])
    prior = np.concatenate([[0.1], bodies, [0.5]])
    wrong = [congruence(np.eye(4) + 0.1 * rng.normal(size=(4, 4))) for _ in PLACES]
    truth = prior.copy()
    for place, change in zip(PLACES, wrong, strict=True):
        truth[place] = change @ prior[place]
    x = rng.normal(size=(rows, directions)) @ rng.normal(size=(directions, len(COLUMNS)))
    y = x @ truth + noise * rng.normal(size=rows)
    return Moments.from_rows(x, y, columns=COLUMNS, blocks=blocks), prior, truth, x


def test_links_are_found_by_their_names():
    assert links_among(COLUMNS) == PLACES
    assert links_among(("a.m", *COLUMNS)) == (slice(2, 12), slice(12, 22))
    assert links_among(LINKS[1:]) == (slice(9, 19),)
    assert links_among(("x1", "x2")) == ()


@LAWS
@given(generators())
def test_the_priors_columns_have_unit_energy_on_average(rng):
    moments, prior, _, _ = draw(rng, noise=0.1)
    problem = standardise(moments, prior)
    K = prior_covariance(problem, moments.columns)
    normal = problem.metric / (moments.count.sum() * problem.target_rms**2)
    assert np.sum(K * normal) == pytest.approx(len(COLUMNS))


@LAWS
@given(generators())
def test_links_given_in_other_frames_give_the_same_torque(rng):
    moments, prior, _, _ = draw(rng, noise=0.3)
    move = np.eye(len(COLUMNS))
    for place in PLACES:
        move[place, place] = congruence(np.asarray(random_placement(rng).homogeneous))
    turned = np.eye(len(COLUMNS) + 1)
    turned[:-1, :-1] = np.linalg.inv(move)
    gram = turned.T @ moments.gram @ turned
    other = Moments.from_dense(gram, moments.count, moments.columns, moments.joints)
    ridge = Ridge(strength=1e-2, standard_errors=False)
    here, there = ridge.estimate(moments, prior).parameters, ridge.estimate(other, move @ prior).parameters
    np.testing.assert_allclose(move @ here, there, atol=1e-5 * np.abs(there).max())


def test_a_ridge_without_strength_is_least_squares_on_what_is_seen():
    moments, prior, _, x = draw(np.random.default_rng(0), noise=0.1)
    free, weak = WeightedLeastSquares().estimate(moments, prior), Ridge(strength=0.0).estimate(moments, prior)
    np.testing.assert_allclose(x @ weak.parameters, x @ free.parameters, atol=1e-6)
    seen = x[:3] / np.linalg.norm(x[:3], axis=1, keepdims=True)
    variance = [np.einsum("kp,pq,kq->k", seen, one.spread.covariance, seen) for one in (free, weak)]
    np.testing.assert_allclose(variance[1], variance[0], rtol=1e-5)


def test_the_models_geometry_finds_bodies_where_few_directions_are_shown():
    better, possible = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        moments, prior, truth, _ = draw(rng, noise=0.1)
        plain = dataclasses.replace(moments, columns=tuple(f"x{k}" for k in range(len(COLUMNS))))
        unseen = rng.normal(size=(200, len(COLUMNS))) @ np.diag(np.abs(prior) + 0.1)
        with_bodies, without = (Ridge().estimate(one, prior).parameters for one in (moments, plain))
        better.append(np.linalg.norm(unseen @ (with_bodies - truth)) < np.linalg.norm(unseen @ (without - truth)))
        possible.append(is_consistent(with_bodies[1:21].reshape(2, 10)).mean())
    assert np.mean(better) >= 0.75
    assert np.mean(possible) > 0.6


def test_strength_falls_as_the_model_file_is_farther_off():
    moments, prior, truth, _ = draw(np.random.default_rng(3), noise=0.5)
    strengths = [
        Ridge(standard_errors=False).estimate(moments, truth + off * (prior - truth)).diagnostics["strength"]
        / np.linalg.norm(truth - prior) ** 2
        for off in (0.1, 1.0, 10.0)
    ]
    effective = [
        Ridge(standard_errors=False)
        .estimate(moments, truth + off * (prior - truth))
        .diagnostics["effective_parameters"]
        for off in (0.1, 1.0, 10.0)
    ]
    assert strengths[0] >= strengths[1] >= strengths[2]
    assert effective[0] < effective[2]


def test_a_block_unlike_the_others_does_not_force_the_prior_upon_the_rest():
    """Cross-validation alone would trust the file: one block moves as none of the others and spoils every fold."""
    rng = np.random.default_rng(4)
    x = rng.normal(size=(400, 5))
    x[:, 4] *= 1e-3
    x[:40, 4] *= 3e4
    truth = np.array([3.0, -3.0, 3.0, -3.0, 3.0])
    moments = Moments.from_rows(x, x @ truth + 0.3 * rng.normal(size=400), blocks=10)
    estimate = Ridge().estimate(moments)
    assert np.abs(estimate.parameters[:4] - truth[:4]).max() < 0.3

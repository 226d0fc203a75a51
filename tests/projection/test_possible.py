"""Projections that go on from the last answer, against the convex solver each time anew."""

import numpy as np
import pytest

from casysid.inertia import Consistency, is_consistent
from casysid.projection import PossibleParameters, build_projection, possible


def changing(data, steps):
    """Estimates and regular metrics as of a search whose weights change from round to round."""
    draw = np.random.default_rng(0)
    energy = np.diag(data.equations.xx)
    for _ in range(steps):
        weight = np.exp(0.5 * draw.normal(size=len(energy)))
        metric = data.equations.xx * np.outer(weight, weight) + 1e-4 * np.diag(energy + energy.mean())
        yield data.estimate + np.linalg.cholesky(np.linalg.inv(metric)) @ draw.normal(size=len(energy)), metric


@pytest.mark.parametrize("consistency", Consistency)
def test_every_answer_is_where_the_convex_solver_puts_it(experiment, consistency, monkeypatch):
    data = experiment(seed=1, noise=0.3)
    problem = build_projection(data.columns, consistency=consistency)
    search, calls = PossibleParameters(problem, data.prior), []
    certify = possible.certify
    monkeypatch.setattr(possible, "certify", lambda *arguments: calls.append(1) or certify(*arguments))
    for estimate, metric in changing(data, 6):
        found, before = search(estimate, metric, data.residual_energy), len(calls)
        exact = PossibleParameters(problem, data.prior)(estimate, metric, data.residual_energy)
        del calls[before:]
        root = np.linalg.cholesky(metric).T
        assert np.linalg.norm(root @ (found - exact)) < 0.02 * np.linalg.norm(root @ (exact - estimate))
        assert is_consistent(found[:30].reshape(-1, 10), consistency, tolerance=1e-9).all()
    assert len(calls) < 6, "no answer came from the one before"


def test_a_singular_metric_goes_to_the_convex_solver(experiment):
    data = experiment(seed=1, noise=0.3)
    problem = build_projection(data.columns)
    search = PossibleParameters(problem, data.prior)
    first, again = (search(data.estimate, data.equations.xx, data.residual_energy) for _ in range(2))
    moved, away = first - again, first - data.estimate
    assert moved @ data.equations.xx @ moved < 4e-4 * (away @ data.equations.xx @ away)

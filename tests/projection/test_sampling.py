"""Projections of many estimates by cutting planes, against the convex solver one by one."""

import dataclasses

import numpy as np
import pytest

from casysid.inertia import Consistency, is_consistent
from casysid.projection import KeptLink, build_projection, cuts, project, project_samples, sampling, total_mass
from casysid.projection.certificate import certify
from casysid.projection.misfit import misfit_of_estimate
from casysid.projection.task import task_of

KNOWLEDGE = {
    "nothing": (),
    "a link": (KeptLink("link_1"),),
    "the total mass": (total_mass(("link_0", "link_1", "link_2"), 5.0),),
    "the range of the total mass": (total_mass(("link_0", "link_1", "link_2"), 4.0, 5.0),),
}


def regular_metric(data):
    """The data's metric with a faint pull in all directions, as a ridge's has."""
    energy = np.diag(data.equations.xx)
    return data.equations.xx + 1e-4 * np.diag(energy + energy.mean())


@pytest.mark.parametrize("consistency", Consistency)
@pytest.mark.parametrize("known", KNOWLEDGE)
def test_samples_are_where_the_convex_solver_puts_them(experiment, consistency, known, monkeypatch):
    data = experiment(seed=1, noise=0.3)
    metric, energy = regular_metric(data), data.residual_energy
    problem = build_projection(data.columns, consistency=consistency, knowledge=KNOWLEDGE[known])
    answer = project(problem, data.estimate, metric, data.prior, residual_energy=energy)
    root = np.linalg.cholesky(np.linalg.inv(metric))
    drawn = data.estimate + np.random.default_rng(0).normal(size=(6, len(metric))) @ root.T
    misfit = misfit_of_estimate(metric, drawn.mean(axis=0), energy)
    task = task_of(problem, misfit, data.prior)
    exact = []
    for point in drawn:
        one = dataclasses.replace(task, misfit=dataclasses.replace(misfit, target=misfit.seen @ point))
        exact.append(task.frame.transform @ certify(one, answer.prior_weight).scaled)
    monkeypatch.setattr(cuts, "ROUNDS", 40)
    monkeypatch.setattr(sampling, "certify", None)  # cuts alone
    found = project_samples(problem, drawn, metric, data.prior, answer, residual_energy=energy)
    assert is_consistent(found[:, :30].reshape(-1, 10), consistency, tolerance=1e-9).all()
    whitened = np.linalg.cholesky(metric).T
    error = np.linalg.norm((found - exact) @ whitened.T, axis=1)
    assert (error < 0.02 * np.linalg.norm((exact - drawn) @ whitened.T, axis=1)).all()


def test_a_sample_that_is_consistent_stays_where_it_is(experiment):
    data = experiment(seed=2, noise=0.01)
    metric = regular_metric(data)
    problem = build_projection(data.columns)
    answer = project(problem, data.truth, metric, data.prior, residual_energy=data.residual_energy)
    (same,) = project_samples(problem, data.truth[None], metric, data.prior, answer, residual_energy=1.0)
    np.testing.assert_allclose(same, data.truth, rtol=1e-6, atol=1e-9)


def test_what_cuts_do_not_settle_goes_to_the_convex_solver(experiment, monkeypatch):
    data = experiment(seed=1, noise=0.3)
    problem = build_projection(data.columns)
    answer = project(problem, data.estimate, data.equations.xx, data.prior, residual_energy=data.residual_energy)
    points = data.estimate + 0.1 * np.abs(data.estimate) * np.random.default_rng(1).normal(size=(4, len(data.truth)))
    arguments = (problem, points, data.equations.xx, data.prior, answer)
    cut = project_samples(*arguments, residual_energy=data.residual_energy)
    monkeypatch.setattr(cuts, "ROUNDS", 0)
    solved = project_samples(*arguments, residual_energy=data.residual_energy)
    root = np.linalg.cholesky(regular_metric(data)).T
    away = np.linalg.norm((solved - points) @ root.T, axis=1)
    assert (np.linalg.norm((cut - solved) @ root.T, axis=1) < 0.05 * away).all()

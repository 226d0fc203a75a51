"""IPOPT's program: its variables mean what they should, its derivatives are exact."""

import casadi as ca
import numpy as np
import pytest

from casysid.inertia import Consistency, is_consistent
from casysid.projection import KeptLink, build_projection, link_mass, parameter_within
from casysid.projection.misfit import misfit_of_equations
from casysid.projection.objective import SCALE, objective_of
from casysid.projection.task import task_of

KINDS = pytest.mark.parametrize("consistency", Consistency)
KNOWLEDGE = (KeptLink("link_1"), link_mass("link_2", 0.7), parameter_within("joint_2.viscous", upper=0.1))


@pytest.fixture(scope="module", params=Consistency, ids=lambda consistency: consistency.value)
def case(request, experiment):
    """A task with knowledge, its objective, a random point and the values of the program's parameters."""
    data = experiment(seed=1, noise=0.3)
    problem = build_projection(data.columns, consistency=request.param, knowledge=KNOWLEDGE)
    task = task_of(problem, misfit_of_equations(data.equations), data.prior)
    objective = objective_of(task.misfit, task.frame, 1e-3)
    rows, _, _ = problem.constraints.in_coordinates(task.frame.transform)
    u = np.random.default_rng(0).normal(size=problem.program.nlp.variables)
    return task, objective, u, problem.program.values(objective, task.frame, rows)


def differences(function, x, step=1e-5):
    return np.stack([(function(x + step * e) - function(x - step * e)) / (2 * step) for e in np.eye(len(x))])


def test_any_variables_are_consistent_parameters_with_kept_links_at_the_prior(case):
    task, _, u, _ = case
    problem = task.problem
    scaled = problem.program.scaled(u, task.frame.scaled_prior)
    parameters = task.frame.transform @ scaled
    free = parameters[:30].reshape(-1, 10)[problem.program.free]
    assert is_consistent(free, problem.consistency).all()
    assert (parameters[list(problem.layout.non_negative)] >= 0).all()
    np.testing.assert_allclose(parameters[10:20], task.frame.prior[10:20], atol=1e-12)


def test_variables_of_parameters_come_back(case):
    task, _, u, _ = case
    program = task.problem.program
    scaled = program.scaled(u, task.frame.scaled_prior)
    again = program.scaled(program.variables(scaled), task.frame.scaled_prior)
    np.testing.assert_allclose(again, scaled, atol=1e-9)


def test_the_objective_is_the_tasks(case):
    task, objective, u, given = case
    functions = task.problem.program.nlp._functions
    value = ca.Function("f", [functions["x"], functions["p"]], [functions["f"], functions["g"]])
    f, g = value(u, given)
    scaled = task.problem.program.scaled(u, task.frame.scaled_prior)
    assert float(f) == pytest.approx(SCALE * objective(scaled))
    rows, _, _ = task.problem.constraints.in_coordinates(task.frame.transform)
    np.testing.assert_allclose(g.full().ravel(), rows @ scaled, atol=1e-12)
    prior = scaled - task.frame.scaled_prior
    data = task.data_misfit(scaled)
    assert objective(scaled) >= data * (1 - 1e-9)
    assert objective(scaled) - data <= 1e-3 * np.sum((task.frame.strain @ prior) ** 2) + 1e-9 * data


def test_the_derivatives_agree_with_finite_differences(case):
    task, _, u, given = case
    nlp = task.problem.program.nlp
    functions, derivatives = nlp._functions, nlp._derivatives
    x, p = functions["x"], functions["p"]
    multipliers = np.array([3e4, -2e4])
    lagrangian = 0.7 * functions["f"] + ca.dot(multipliers, functions["g"])
    slope = ca.Function("slope", [x, p], [ca.gradient(lagrangian, x)])
    value = ca.Function("value", [x, p], [functions["f"]])
    f, gradient = derivatives["grad_f"](u, given)
    assert float(f) == pytest.approx(float(value(u, given)))
    expected = differences(lambda y: float(value(y, given)), u)
    np.testing.assert_allclose(gradient.full().ravel(), expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())
    hessian = ca.triu2symm(derivatives["hess_lag"](u, given, 0.7, multipliers)).full()
    expected = differences(lambda y: slope(y, given).full().ravel(), u)
    np.testing.assert_allclose(hessian, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())

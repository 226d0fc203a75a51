"""The projection: consistent whatever comes in, optimal, decided by the data or, where there are none, by the prior."""

import dataclasses
import warnings

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays

from casysid.errors import CasysidWarning, ParameterError, SolverError
from casysid.inertia import Consistency, is_consistent, parameters_from_virtual, pseudo_inertia
from casysid.projection import (
    KeptLink,
    LinearKnowledge,
    ProjectionStatus,
    Solver,
    build_projection,
    center_of_mass_within,
    constrained_least_squares,
    link_mass,
    parameter_within,
    project,
    project_samples,
    total_mass,
)

KINDS = pytest.mark.parametrize("consistency", Consistency)
LINKS = ("link_0", "link_1", "link_2")


@pytest.fixture(scope="module")
def problems(experiment):
    """Problems are built once; knowledge makes a new one."""
    made = {}

    def build(consistency=Consistency.FULL, knowledge=()):
        key = consistency, str(knowledge)
        if key not in made:
            made[key] = build_projection(experiment().columns, consistency=consistency, knowledge=knowledge)
        return made[key]

    return build


def run(problem, data, **changes):
    arguments = {"estimate": data.estimate, "metric": data.equations.xx, "prior": data.prior, **changes}
    return project(problem, residual_energy=data.residual_energy, **arguments)


def bodies(parameters):
    return parameters[:30].reshape(-1, 10)


def assert_consistent(parameters, consistency):
    assert is_consistent(bodies(parameters), consistency).all()
    assert (parameters[30:33] >= 0).all()


@KINDS
@pytest.mark.parametrize("seed", range(6))
def test_an_infeasible_estimate_becomes_consistent_at_the_convex_optimum(problems, experiment, consistency, seed):
    data = experiment(seed=seed, noise=0.3)
    result = run(problems(consistency), data)
    assert_consistent(result.parameters, consistency)
    assert result.status in (ProjectionStatus.CERTIFIED, ProjectionStatus.UNCHANGED)
    if result.status is ProjectionStatus.CERTIFIED:
        assert result.solver is Solver.IPOPT
        assert abs(result.gap) < 1e-3
        assert result.prior_cost < 1e-3
    assert result.smallest_eigenvalue == pytest.approx(
        np.linalg.eigvalsh(pseudo_inertia(bodies(result.parameters))).min(), abs=1e-15
    )


@pytest.mark.parametrize("seed", range(3))
def test_no_consistent_parameters_explain_the_data_much_better(problems, experiment, seed):
    data = experiment(seed=seed, noise=0.3)
    result = run(problems(), data)
    slope = data.equations.xx @ (result.parameters - data.estimate) / data.residual_energy

    @settings(max_examples=40, deadline=None)
    @given(
        arrays(float, (3, 10), elements=st.floats(-1.5, 1.5)),
        arrays(float, 3, elements=st.floats(0, 0.5)),
        arrays(float, 3, elements=st.floats(-0.5, 0.5)),
    )
    def check(u, viscous, offset):
        other = np.concatenate([parameters_from_virtual(0.3 * u).ravel(), viscous, offset])
        away = other - result.parameters
        energy = away @ data.equations.xx @ away / data.residual_energy
        assert slope @ away > -1e-3 - 0.05 * np.sqrt(energy)  # misfit is convex: it cannot fall by more along the way

    check()


def test_a_consistent_estimate_stays_as_it_is(problems, experiment):
    data = experiment(seed=1)
    result = run(problems(), data, estimate=data.truth, metric=np.diag(1.0 / np.maximum(np.abs(data.truth), 1e-3) ** 2))
    assert result.status is ProjectionStatus.UNCHANGED
    assert result.solver is Solver.NONE
    np.testing.assert_allclose(result.parameters, data.truth, atol=1e-9)


def test_without_data_the_prior_stays(problems, experiment):
    data = experiment()
    size = len(data.prior)
    result = project(problems(), np.ones(size), np.zeros((size, size)), data.prior)
    np.testing.assert_allclose(result.parameters, data.prior, atol=1e-9)


@KINDS
def test_what_the_data_do_not_see_in_the_estimate_does_not_matter(problems, experiment, consistency):
    data = experiment(seed=2, noise=0.3)
    shift = data.unseen @ np.random.default_rng(0).normal(size=data.unseen.shape[1])
    first = run(problems(consistency), data)
    second = run(problems(consistency), data, estimate=data.estimate + 0.1 * shift / np.abs(shift).max())
    np.testing.assert_allclose(second.parameters, first.parameters, atol=1e-5)


def test_unseen_directions_go_to_the_prior_when_nothing_forbids_it(problems, experiment):
    data = experiment(seed=3, noise=1e-4)
    result = run(problems(), data, estimate=data.truth, prior=data.truth)
    np.testing.assert_allclose(result.parameters, data.truth, atol=1e-6)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_units_do_not_matter(problems, experiment, unit):
    data = experiment(seed=4, noise=0.3)
    scale = np.full(len(data.prior), unit)
    result = run(problems(), data)
    scaled = run(
        problems(),
        data,
        estimate=scale * data.estimate,
        metric=data.equations.xx / np.outer(scale, scale),
        prior=scale * data.prior,
    )
    np.testing.assert_allclose(scaled.parameters / unit, result.parameters, atol=1e-5)


@pytest.mark.parametrize("seed", range(3))
@KINDS
def test_least_squares_in_one_step_is_the_projection_of_the_least_squares_estimate(
    problems, experiment, consistency, seed
):
    data = experiment(seed=seed, noise=0.3)
    two_steps = run(problems(consistency), data)
    one_step = constrained_least_squares(problems(consistency), data.equations, data.prior)
    # IPOPT is stopped a little above the convex optimum: a gram, a gram metre apart, and no worse, is the same answer
    np.testing.assert_allclose(one_step.parameters, two_steps.parameters, atol=1e-3)
    assert one_step.misfit == pytest.approx(two_steps.misfit, abs=1e-5)
    energy = data.equations.residual_energy(one_step.parameters)
    assert energy == pytest.approx(data.residual_energy * (1.0 + one_step.misfit), rel=1e-6)


def test_an_inconsistent_prior_is_mended_with_a_warning(problems, experiment):
    data = experiment(seed=5, noise=0.3)
    prior = data.prior.copy()
    prior[4] *= -1.0
    prior[30] = -0.1
    with pytest.warns(CasysidWarning, match=r"prior is not physically consistent at link_0, joint_0.viscous"):
        result = run(problems(), data, prior=prior)
    assert_consistent(result.parameters, Consistency.FULL)


@KINDS
@pytest.mark.parametrize("empty", [slice(0, 30), slice(20, 30), slice(0, 36)])
def test_bodies_without_a_prior_work(problems, experiment, consistency, empty):
    data = experiment(seed=0, noise=0.3)
    prior = data.prior.copy()
    prior[empty] = 0.0
    result = run(problems(consistency), data, prior=prior)
    assert_consistent(result.parameters, consistency)
    assert result.status in (ProjectionStatus.CERTIFIED, ProjectionStatus.CONVEX)


def test_a_prior_may_be_missing(problems, experiment):
    data = experiment(seed=0, noise=0.3)
    assert_consistent(run(problems(), data, prior=None).parameters, Consistency.FULL)


KNOWN = {
    "total mass": (total_mass(LINKS, 6.0),),
    "weighed link": (link_mass("link_1", 1.0), link_mass("link_2", 0.5, 0.6)),
    "centre of mass": center_of_mass_within("link_1", [-0.02, -0.02, -0.02], [0.02, 0.02, 0.02]),
    "kept link": (KeptLink("link_1"),),
    "bounds": (parameter_within("joint_1.viscous", 0.4, 0.5), parameter_within("joint_0.offset", upper=-0.5)),
    "equality": (LinearKnowledge(coefficients={"link_0.m": 1.0, "link_1.m": -2.0}, lower=0.0, upper=0.0),),
    "several": (KeptLink("link_0"), link_mass("link_2", 0.7), parameter_within("joint_2.viscous", upper=0.1)),
}


@KINDS
@pytest.mark.parametrize("known", KNOWN)
def test_knowledge_is_obeyed_and_the_optimum_still_certified(problems, experiment, consistency, known):
    data, problem = experiment(seed=3, noise=0.3), problems(consistency, KNOWN[known])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CasysidWarning)  # what is claimed here need not be true
        result = run(problem, data)
    assert problem.constraints.violation(result.parameters) < 1e-6
    assert_consistent(result.parameters, consistency)
    assert result.status is ProjectionStatus.CERTIFIED
    kept = problem.constraints.kept
    np.testing.assert_allclose(result.parameters[kept], data.prior[kept], atol=1e-12)


def test_knowledge_on_its_bound_is_named(problems, experiment):
    result = run(problems(knowledge=KNOWN["bounds"]), experiment(seed=3, noise=0.3))
    assert "joint_1.viscous" in result.active


def test_contradictions_are_an_error(problems, experiment):
    knowledge = (link_mass("link_1", 1.0), parameter_within("link_1.m", lower=2.0))
    with pytest.raises(SolverError, match="no physically consistent parameters satisfy"):
        run(problems(knowledge=knowledge), experiment(seed=3))


def test_when_ipopt_is_stopped_the_convex_answer_is_taken_and_said(problems, experiment):
    data = experiment(seed=0, noise=0.3)
    with pytest.warns(CasysidWarning, match="IPOPT stopped short"):
        result = run(problems(), data, progress=lambda iteration: iteration.step >= 1)
    assert (result.status, result.solver) == (ProjectionStatus.CONVEX, Solver.CLARABEL)
    assert_consistent(result.parameters, Consistency.FULL)
    full = run(problems(), data)
    assert result.misfit == pytest.approx(full.misfit, abs=1e-4)


def test_without_the_convex_solver_ipopts_answer_is_called_uncertified(problems, experiment, monkeypatch):
    monkeypatch.setattr("casysid.projection.certificate.solve_convex", lambda *_: None)
    with pytest.warns(CasysidWarning, match="not solved"):
        result = run(problems(), experiment(seed=0, noise=0.3))
    assert result.status is ProjectionStatus.UNCERTIFIED
    assert np.isnan(result.gap)
    assert_consistent(result.parameters, Consistency.FULL)


def test_without_either_solver_there_is_an_error(problems, experiment, monkeypatch):
    monkeypatch.setattr("casysid.projection.certificate.solve_convex", lambda *_: None)
    with pytest.raises(SolverError, match="neither IPOPT nor the convex solver"):
        run(problems(), experiment(seed=0, noise=0.3), progress=lambda _: True)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"estimate": np.zeros(3)}, r"the estimate must be 36 finite numbers; got shape \(3,\)"),
        ({"estimate": np.full(36, np.nan)}, "the estimate must be 36 finite numbers"),
        ({"prior": np.zeros(35)}, "the prior must be 36 finite numbers"),
        ({"metric": np.eye(3)}, r"the metric must be \(36, 36\) finite numbers"),
        ({"metric": -np.eye(36)}, "the metric must be positive semidefinite"),
        ({"metric": np.eye(36) - 0.1 * np.ones((36, 36))}, "the metric must be positive semidefinite"),
    ],
)
def test_wrong_input_is_named(problems, experiment, changes, message):
    with pytest.raises(ParameterError, match=message):
        run(problems(), experiment(), **changes)


def test_moments_of_other_columns_are_refused(problems, experiment):
    equations = dataclasses.replace(experiment().equations, xx=np.eye(3))
    with pytest.raises(ParameterError, match="the moments have 3 columns, the problem 36"):
        constrained_least_squares(problems(), equations)


@pytest.mark.parametrize("wrong", [{"floor": 0.5}, {"floor": -1.0}, {"prior_budget": 0.0}])
def test_settings_out_of_range_are_refused(experiment, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        build_projection(experiment().columns, **wrong)


def test_the_result_is_frozen(problems, experiment):
    result = run(problems(), experiment(seed=0, noise=0.3))
    with pytest.raises(ValueError, match="read-only"):
        result.parameters[0] = 1.0


def test_parameters_without_links_are_only_clipped():
    columns = [type("Column", (), {"name": n, "owner": n, "kind": "viscous", "non_negative": True}) for n in "ab"]
    result = project(build_projection(columns), [1.0, -1.0], np.diag([1.0, 2.0]))
    np.testing.assert_allclose(result.parameters, [1.0, 0.0], atol=1e-4)


def test_samples_are_consistent_and_spread_around_the_projection(problems, experiment):
    data = experiment(seed=0, noise=0.3)
    result = run(problems(), data)
    rng = np.random.default_rng(0)
    values, vectors = np.linalg.eigh(data.equations.xx)
    seen = values > 1e-9 * values[-1]
    noise = (vectors[:, seen] / np.sqrt(values[seen])) @ rng.normal(size=(seen.sum(), 8))
    energy = {"residual_energy": data.residual_energy}
    samples = project_samples(problems(), data.estimate + noise.T, data.equations.xx, data.prior, result, **energy)
    assert is_consistent(samples[:, :30].reshape(-1, 10)).all()
    away = samples - result.parameters
    assert np.einsum("nm,mk,nk->n", away, data.equations.xx, away).max() < 4 * seen.sum()
    (same,) = project_samples(problems(), data.estimate[None], data.equations.xx, data.prior, result, **energy)
    np.testing.assert_allclose(same, result.parameters, atol=1e-2)


def test_samples_without_an_answer_are_counted(problems, experiment, monkeypatch):
    data = experiment(seed=0, noise=0.3)
    result = run(problems(), data)
    monkeypatch.setattr("casysid.projection.certificate.solve_convex", lambda *_: None)
    monkeypatch.setattr("casysid.projection.cuts.ROUNDS", 0)
    with pytest.warns(CasysidWarning, match="2 of 2 samples have no answer"):
        samples = project_samples(problems(), [data.estimate] * 2, data.equations.xx, data.prior, result)
    assert np.isnan(samples).all()
    with pytest.raises(ParameterError, match=r"samples must have shape \(n, 36\)"):
        project_samples(problems(), data.estimate, data.equations.xx, data.prior, result)

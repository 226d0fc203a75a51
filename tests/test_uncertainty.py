"""Standard errors: honest under coloured residuals, infinite where nothing is seen, carried to what matters."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import t as student

from casysid import uncertainty
from casysid.estimation import OrdinaryLeastSquares, Ridge, WeightedLeastSquares
from casysid.estimation.covariance import block_covariance, covariance_from_blocks
from casysid.identification import Settings, identify
from casysid.inertia import Consistency
from casysid.moments import Moments
from casysid.projection import link_mass
from casysid.simulation import NO_MECHANICS, PlantSettings
from casysid.uncertainty import link_gradient, link_quantities, torque_std
from tests.simulated import bundled_robot, simulated_run
from tests.strategies import consistent_inertias, generators

LAWS = settings(max_examples=25, deadline=None)
TRUTH = np.array([1.0, -2.0, 0.5, 3.0])


def slow_inputs(rng: np.random.Generator, samples: int = 2000) -> np.ndarray:
    """Four inputs that vary about as slowly as a robot's motion, shape (N, 4)."""
    return lfilter([0.05], [1.0, -0.95], rng.standard_normal((samples, 4)), axis=0) + 0.02


def coloured(rng: np.random.Generator, samples: int = 2000, memory: float = 0.9) -> np.ndarray:
    return lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(samples))


@pytest.fixture(scope="module")
def result():
    run = simulated_run("two_link.urdf", 0, PlantSettings())
    return identify(bundled_robot("two_link.urdf"), run.recording, Settings(cutoff=12.0))


def coverage(fit, draws: int = 150) -> float:
    """Share of 95 % intervals that hold the truth, over draws of inputs and coloured noise."""
    hits = []
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        x = slow_inputs(rng)
        estimate = fit(Moments.from_rows(x, x @ TRUTH + coloured(rng), blocks=20))
        half = student.ppf(0.975, estimate.spread.freedom) * estimate.std
        hits.append(np.abs(estimate.parameters - TRUTH) <= half)
    return float(np.mean(hits))


@pytest.mark.parametrize("estimator", [OrdinaryLeastSquares(), WeightedLeastSquares(), Ridge()])
def test_intervals_hold_the_truth_as_often_as_they_say_under_coloured_noise(estimator):
    assert 0.92 <= coverage(estimator.estimate) <= 0.98


def test_white_residuals_give_the_textbook_covariance():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((40_000, 4)) * [1.0, 10.0, 0.1, 3.0]
    moments = Moments.from_rows(x, x @ TRUTH + rng.standard_normal(40_000), blocks=200)
    found = WeightedLeastSquares().estimate(moments).covariance
    textbook = np.linalg.inv(x.T @ x)
    np.testing.assert_allclose(np.diag(found), np.diag(textbook), rtol=0.2)


def test_ridge_is_as_sure_as_its_posterior_where_the_prior_is_right():
    rng = np.random.default_rng(1)
    x = rng.standard_normal((40_000, 2)) @ np.array([[1.0, 1.0], [0.0, 1e-2]])
    moments = Moments.from_rows(x, rng.standard_normal(40_000), blocks=200)
    estimate, free = Ridge(strength=1e-3).estimate(moments), WeightedLeastSquares().estimate(moments)
    posterior = np.sqrt(np.diag(np.linalg.inv(estimate.metric)))
    assert (estimate.std > 0.8 * posterior).all()
    assert (estimate.std < 2.0 * free.std).all()


def test_ridge_admits_a_wrong_prior():
    rng = np.random.default_rng(2)
    x = rng.standard_normal((4_000, 2)) @ np.array([[1.0, 1.0], [0.0, 1e-2]])
    moments = Moments.from_rows(x, x @ [3.0, -3.0] + 0.1 * rng.standard_normal(4_000), blocks=20)
    estimate = Ridge(strength=1e-2).estimate(moments)
    error = np.abs(estimate.parameters - [3.0, -3.0])
    assert (error > 1.0).all()
    assert (error < 2.5 * estimate.std).all()


@LAWS
@given(generators(), st.floats(-3.0, 3.0))
def test_standard_errors_follow_the_units(rng, exponent):
    x = slow_inputs(rng, 300)
    y, unit = x @ TRUTH + coloured(rng, 300), np.array([10.0**exponent, 1.0, 1.0, 1.0])
    plain, scaled = (
        OrdinaryLeastSquares().estimate(Moments.from_rows(x * factor, y, blocks=8)) for factor in (1.0, unit)
    )
    np.testing.assert_allclose(scaled.std * unit, plain.std, rtol=1e-5)


@LAWS
@given(generators())
def test_of_parameters_that_act_together_only_the_combination_is_known(rng):
    x = slow_inputs(rng, 400)
    tied = np.column_stack([x, 2.0 * x[:, 0]])
    y = x @ TRUTH + coloured(rng, 400)
    spread = WeightedLeastSquares().estimate(Moments.from_rows(tied, y, blocks=8)).spread
    alone = WeightedLeastSquares().estimate(Moments.from_rows(x, y, blocks=8))
    combination = np.array([1.0, 0.0, 0.0, 0.0, 2.0])
    assert spread.sees(np.eye(5)).tolist() == [False, True, True, True, False]
    assert spread.sees(combination[None]).all()
    assert np.isinf(np.diag(spread.marked)).tolist() == [True, False, False, False, True]
    assert np.sqrt(combination @ spread.covariance @ combination) == pytest.approx(alone.std[0], rel=0.4)


def test_a_direction_that_one_block_decides_has_a_standard_error():
    rng = np.random.default_rng(3)
    x = slow_inputs(rng, 1000)
    x[100:, 3] = 0.0
    moments = Moments.from_rows(x, x @ TRUTH + coloured(rng, 1000), blocks=10)
    estimate = OrdinaryLeastSquares().estimate(moments)
    white = np.sqrt(np.linalg.inv(x.T @ x)[3, 3])
    assert estimate.std[3] > 2.0 * white


def test_a_single_block_is_taken_for_white():
    rng = np.random.default_rng(4)
    x = rng.standard_normal((500, 4))
    moments = Moments.from_rows(x, x @ TRUTH + rng.standard_normal(500))
    spread = covariance_from_blocks(moments, TRUTH, np.ones(1))
    assert spread.freedom == np.inf
    np.testing.assert_allclose(np.diag(block_covariance(moments, TRUTH, np.ones(1))), 1 / 500, rtol=0.3)


@LAWS
@given(consistent_inertias())
def test_gradients_of_a_links_quantities_are_finite_differences(parameters):
    step = 1e-6 * max(np.abs(parameters).max(), 1e-3)
    steps = step * np.eye(10)
    numeric = (link_quantities(parameters + steps) - link_quantities(parameters - steps)).T / (2.0 * step)
    gradient = link_gradient(parameters)
    np.testing.assert_allclose(numeric, gradient, atol=1e-4 * np.abs(gradient).max())


def test_what_the_arm_cannot_tell_has_no_standard_error(result):
    mass_std = result.uncertainty.link_std[:, 0]
    assert np.isinf(mass_std).all()
    lower, upper = result.uncertainty.link_interval()
    assert (lower[:, 0] == 0.0).all()
    assert np.isinf(upper[:, 0]).all()
    std = dict(zip(result.regressor.names, result.uncertainty.std, strict=True))
    assert 0.0 < std["fore_link.Izz"] < np.inf
    assert 0.0 < result.drive_std()["shoulder"]["viscous"] < np.inf


def test_a_weighed_link_is_as_sure_as_the_scales(result):
    weighed = Settings(cutoff=12.0, knowledge=(link_mass("fore_link", 1.5),))
    run = simulated_run("two_link.urdf", 0, PlantSettings())
    found = identify(bundled_robot("two_link.urdf"), run.recording, weighed)
    assert found.uncertainty.link_std[1, 0] < 1e-6
    assert np.isfinite(found.uncertainty.link_std[1, 1:3]).all()


def test_physics_does_not_make_combinations_less_sure():
    """Without friction before sliding, whose elements stand for each other and for Coulomb's."""
    run = simulated_run("two_link.urdf", 0, PlantSettings())
    result = identify(bundled_robot("two_link.urdf"), run.recording, Settings(cutoff=12.0, choose_friction=False))
    base = result.structural.transform
    free, projected = (
        np.sqrt(np.einsum("rp,pq,rq->r", base, covariance, base))
        for covariance in (result.estimate.spread.covariance, result.uncertainty.covariance)
    )
    assert (projected < 1.5 * free).all()
    assert (projected > 0.0).all()


def test_an_answer_on_its_bound_is_not_taken_for_certain():
    run = simulated_run("two_link.urdf", 0, PlantSettings(mechanics=NO_MECHANICS))
    bare = bundled_robot("two_link.urdf").with_parameters(damping=np.zeros(2), dry_friction=np.zeros(2))
    found = identify(bare, run.recording, Settings(cutoff=12.0, coulomb_width=0.01))
    free = np.sqrt(np.diag(found.estimate.spread.covariance))
    on_bound = [k for k, name in enumerate(found.regressor.names) if name in found.projection.active]
    assert on_bound
    assert (found.uncertainty.std[on_bound] > 0.2 * free[on_bound]).all()


def test_torque_is_as_sure_as_the_parameters(result, monkeypatch):
    motion, covariance = result.train_motions[0], result.uncertainty.covariance
    states = motion.q[::50], motion.v[::50], motion.a[::50]
    whole = torque_std(result.regressor, covariance, *states)
    Y = result.regressor.evaluate(*states)
    np.testing.assert_allclose(whole[3, 1] ** 2, Y[3, 1] @ covariance @ Y[3, 1], rtol=1e-9)
    monkeypatch.setattr(uncertainty, "CHUNK", 7)
    np.testing.assert_allclose(torque_std(result.regressor, covariance, *states), whole)


def test_samples_are_the_same_every_time(result):
    run = simulated_run("two_link.urdf", 0, PlantSettings())
    again = identify(bundled_robot("two_link.urdf"), run.recording, Settings(cutoff=12.0))
    np.testing.assert_allclose(again.uncertainty.std, result.uncertainty.std)


def test_an_unconstrained_answer_has_the_estimates_standard_errors():
    run = simulated_run("two_link.urdf", 0, PlantSettings())
    free = dataclasses.replace(Settings(cutoff=12.0), consistency=None)
    found = identify(bundled_robot("two_link.urdf"), run.recording, free)
    np.testing.assert_allclose(found.uncertainty.std, found.estimate.std)
    assert Consistency.FULL is Settings().consistency

"""The model is one whole: its parts add up, it inverts itself, and single states agree with many."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.dynamics import DEFAULT_FRICTION, RandomFeatures, build_regressor
from casysid.errors import ParameterError
from casysid.model import RobotModel, Scatter
from tests.model.models import model_of, plain_models, rich_friction, rich_models
from tests.simulated import bundled_robot
from tests.strategies import random_motion

models = st.one_of(rich_models(), plain_models())
seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def close(got, wanted, tolerance=1e-10):
    np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance * (1.0 + np.abs(wanted).max(initial=0.0)))


@settings(max_examples=5)
@given(models, seeds)
def test_torque_is_the_sum_of_its_parts_and_forward_dynamics_undoes_it(model, rng):
    q, v, a = random_motion(model.robot, rng, 4)
    memory = rng.uniform(-1.0, 1.0, (4, model.memory_size))
    tau = model.torque(q, v, a, memory=memory)
    inertial = np.einsum("nij,nj->ni", model.mass_matrix(q), a)
    close(inertial + model.bias(q, v) + model.friction(v, q, memory=memory), tau)
    close(model.forward_dynamics(q, v, tau, memory=memory), a, 1e-6)
    still = np.zeros_like(v)
    close(model.bias(q, still), model.gravity(q))
    close(model.torque(q, v, a, memory=memory), model.regressor.evaluate(q, v, a, histories=(memory,) * bool(
        model.memory_size)) @ model.parameters)  # fmt: skip


@settings(max_examples=6)
@given(models, seeds)
def test_one_state_is_answered_as_many_are(model, rng):
    q, v, a = random_motion(model.robot, rng, 3)
    many = {
        "torque": model.torque(q, v, a, std=True),
        "gravity": model.gravity(q, std=True),
        "bias": model.bias(q, v, std=True),
        "friction": model.friction(v, q, std=True),
        "mass_matrix": model.mass_matrix(q, std=True),
        "forward_dynamics": model.forward_dynamics(q, v, a, std=True),
    }
    for k in range(3):
        one = {
            "torque": model.torque(q[k], v[k], a[k], std=True),
            "gravity": model.gravity(q[k], std=True),
            "bias": model.bias(q[k], v[k], std=True),
            "friction": model.friction(v[k], q[k], std=True),
            "mass_matrix": model.mass_matrix(q[k], std=True),
            "forward_dynamics": model.forward_dynamics(q[k], v[k], a[k], std=True),
        }
        for name, (value, std) in one.items():
            close(value, many[name][0][k])
            close(std, many[name][1][k], 1e-8)
    close(model.torque(q[0], v, a), model.torque(np.tile(q[0], (3, 1)), v, a))


@settings(max_examples=1)
@given(rich_models(min_joints=2), seeds)
def test_standard_errors_are_those_of_drawn_parameters(model, rng):
    """Beside the derivative: parameters drawn by the covariance, small, and the model asked with each."""
    small = model.scatter.covariance * 1e-8
    draws = rng.multivariate_normal(model.parameters, small, size=40)
    q, v, a = (one[0] for one in random_motion(model.robot, rng, 1))
    memory = rng.uniform(-1.0, 1.0, model.memory_size)
    sure = of(model, model.parameters, small)
    asked = {
        "torque": lambda m, std: m.torque(q, v, a, memory=memory, std=std),
        "gravity": lambda m, std: m.gravity(q, std=std),
        "friction": lambda m, std: m.friction(v, q, memory=memory, std=std),
        "mass_matrix": lambda m, std: m.mass_matrix(q, std=std),
        "forward_dynamics": lambda m, std: m.forward_dynamics(q, v, a, memory=memory, std=std),
    }
    one = of(model, draws[0], small)
    assert not np.array_equal(one.gravity(q), model.gravity(q))
    for name, ask in asked.items():
        linear = [ask(of(model, draw, small), False) for draw in draws]
        spread, told = np.std(linear, axis=0), ask(sure, True)[1]
        assert (spread < 1.6 * told + 1e-12).all(), name
        assert (spread > 0.6 * told - 1e-12).all(), name


def of(model, parameters, covariance):
    p = len(parameters)
    return RobotModel(
        regressor=model.regressor,
        parameters=parameters,
        scatter=Scatter(covariance, np.zeros((p, 0)), np.ones(p)),
        damping=model.damping,
        dry_friction=model.dry_friction,
    )


def test_what_nothing_tells_has_an_infinite_error():
    robot = bundled_robot("two_link.urdf")
    model = model_of(robot, np.random.default_rng(0))
    p, elbow = len(model.parameters), model.regressor.names.index("elbow.viscous")
    blind = RobotModel(
        regressor=model.regressor,
        parameters=model.parameters,
        scatter=Scatter(np.zeros((p, p)), np.eye(p)[:, [elbow]], np.ones(p)),
        damping=model.damping,
        dry_friction=model.dry_friction,
    )
    _, std = blind.torque([0.1, 0.2], [[1.0, 0.0], [1.0, 1.0]], [0.0, 0.0], std=True)
    np.testing.assert_array_equal(std, [[0.0, 0.0], [0.0, np.inf]])


@settings(max_examples=6)
@given(rich_models(), seeds)
def test_memory_is_carried_as_a_recording_has_it(model, rng):
    steps = np.cumsum(rng.normal(scale=0.2, size=(30, len(model.robot.channels))), axis=0)
    q = model.configuration(steps)
    v, a = rng.normal(size=(2, 30, model.robot.nv))
    memory, told = np.zeros(model.memory_size), []
    for k in range(30):
        memory = model.remember(memory, q[max(k - 1, 0)], q[k])
        told.append(model.torque(q[k], v[k], a[k], memory=memory))
    close(np.array(told), model.torque(q, v, a, time=np.arange(30.0)))
    close(model.torque(q, v, a, time=np.arange(30.0)), model.regressor.predict(model.parameters, q, v, a))


def test_friction_that_has_slid_far_pushes_against_the_motion():
    model = model_of(
        bundled_robot("two_link.urdf"), np.random.default_rng(0), rich_friction(bundled_robot("two_link.urdf"))
    )
    slipping = [k for k, kind in enumerate(model.regressor.column_kinds) if kind == "maxwell_slip"]
    q, v = np.zeros(2), np.array([0.5, -0.5])
    without = model.friction(v, q, memory=np.zeros(model.memory_size))
    each = model.parameters[slipping].reshape(2, 2).sum(axis=1)
    close(model.friction(v, q) - without, np.sign(v) * each)
    with pytest.raises(ParameterError, match="give q as well"):
        model.friction(v)


def test_plain_friction_needs_no_position():
    model = model_of(bundled_robot("two_link.urdf"), np.random.default_rng(0))
    v = np.array([[0.3, -0.2], [0.0, 0.1]])
    viscous, coulomb = model.values_of("viscous"), model.values_of("coulomb")
    close(model.friction(v), viscous * v + coulomb * np.tanh(v / 0.01))
    assert model.memory_size == 0
    assert model.remember([], [0, 0], [0, 0]).size == 0


def test_a_model_without_inertia_says_so():
    robot = bundled_robot("two_link.urdf")
    regressor = build_regressor(robot, quasi_static=True)
    model = RobotModel(
        regressor=regressor, parameters=regressor.prior, damping=robot.damping, dry_friction=robot.dry_friction
    )
    close(model.torque([0.1, 0.2], [0.0, 0.0], [5.0, 5.0]), model.gravity([0.1, 0.2]))
    with pytest.raises(ParameterError, match="nothing inertial"):
        model.mass_matrix([0.1, 0.2])
    with pytest.raises(ParameterError, match="nothing is known"):
        model.torque([0, 0], [0, 0], [0, 0], std=True)
    features = model_of(robot, np.random.default_rng(0), (*DEFAULT_FRICTION, RandomFeatures(4, (1.0, 1.0, 1.0))))
    with pytest.raises(ParameterError, match="not linear in the acceleration"):
        features.forward_dynamics([0, 0], [0, 0], [0, 0])


@pytest.mark.parametrize("q", [[0.0], [[0.0, 0.0, 0.0]], 0.0, [[[0.0, 0.0]]]])
def test_shapes_that_do_not_fit_are_refused(q):
    model = model_of(bundled_robot("two_link.urdf"), np.random.default_rng(0))
    with pytest.raises(ParameterError, match=r"wants? q|wanted q"):
        model.gravity(q)


def test_it_travels():
    robot = bundled_robot("two_link.urdf")
    model = model_of(robot, np.random.default_rng(0), rich_friction(robot))
    expected = model.torque([0.1, 0.2], [0.3, 0.4], [1.0, 2.0], std=True)
    for got, wanted in zip(
        pickle.loads(pickle.dumps(model)).torque([0.1, 0.2], [0.3, 0.4], [1.0, 2.0], std=True), expected, strict=True
    ):
        np.testing.assert_array_equal(got, wanted)
    assert repr(model) == "<RobotModel of 'two_link': 2 joints, 44 parameters, with standard errors>"

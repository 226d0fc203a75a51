import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.excitation import (
    Box,
    Capsule,
    ConditionNumber,
    FourierSeries,
    HalfSpace,
    build_excitation,
    design_excitation,
    keep_in,
    limits_of,
    parameter_accuracy,
    torque_accuracy,
)
from casysid.excitation.search.constraint_sampling import Watched
from casysid.excitation.search.program import Evaluation
from casysid.robot import JointKind, Robot
from tests.strategies import random_robot

SERIES = FourierSeries(6.0, 3)
SINGLE = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


@pytest.fixture(scope="module")
def two_link():
    return Robot.from_file(find_model("two_link"))


def small_problem(rng):
    robot = random_robot(rng, [SINGLE[k] for k in rng.integers(3, size=3)], rng.integers(0, 2, size=3).tolist())
    capsules = [Capsule(f"l{i}", i, rng.normal(size=3), rng.normal(size=3), 0.01) for i in range(3)]
    floor = HalfSpace("floor", np.array([0.0, 0.0, 1.0]), -3.0)
    limits = limits_of(robot, acceleration=50.0, jerk=500.0)
    box = keep_in(robot, robot.links[2], [-3.0, -np.inf, -2.0], [3.0, 4.0, np.inf], [0.1, 0.2, 0.3])
    return build_excitation(
        robot, series=SERIES, limits=limits, capsules=capsules, obstacles=[floor], keep_in=[box], torque_noise=0.3
    )


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_objective_and_constraints_have_the_slopes_of_finite_differences(seed):
    rng = np.random.default_rng(seed)
    problem = small_problem(rng)
    evaluation = Evaluation(problem, [Watched(block, np.array([0.123, 0.7, 4.5])) for block in problem.constraints])
    x, direction = 0.2 * rng.normal(size=(2, evaluation.variables))
    h = 1e-6
    wanted = evaluation.gradient(x)
    slope = (evaluation.objective(x + h * direction) - evaluation.objective(x - h * direction)) / (2 * h)
    assert abs(slope - wanted @ direction) <= 1e-4 * np.linalg.norm(wanted) * np.linalg.norm(direction)
    jacobian = np.zeros((len(evaluation.constraints(x)), len(x)))
    jacobian[evaluation.pattern] = evaluation.jacobian(x)
    ahead, at, behind = (evaluation.constraints(x + step * direction) for step in (h, 0.0, -h))
    smooth = np.abs(ahead + behind - 2 * at) < 1e-7 * (1.0 + np.abs(at))
    error = np.abs((ahead - behind) / (2 * h) - jacobian @ direction)[smooth]
    assert error.max() <= 1e-4 * max(1.0, np.abs(jacobian @ direction).max())
    assert smooth.mean() > 0.9


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_information_is_that_of_the_regressors_rows(seed):
    rng = np.random.default_rng(seed)
    problem = small_problem(rng)
    information = problem.information
    motion = problem.trajectory(0.3 * rng.normal(size=3 * (1 + SERIES.size))).motion(SERIES.grid(20))
    total = np.zeros((information.size, information.size))
    q = np.hstack(
        [
            np.column_stack([np.cos(x), np.sin(x)]) if joint.kind is JointKind.CONTINUOUS else x[:, None]
            for joint, x in zip(problem.robot.joints, motion.position.T, strict=True)
        ]
    )
    for k in range(20):
        Y = ca.densify(information.regressor.function(q[k], motion.velocity[k], motion.acceleration[k])).full()
        rows = Y[:, information.base.independent] * information.scale / information.noise_std[:, None]
        total += rows.T @ rows
    np.testing.assert_allclose(information.of_motion(motion), total, rtol=1e-9, atol=1e-9 * np.abs(total).max())
    np.testing.assert_allclose(information.sampled(motion)[0], total, rtol=1e-9, atol=1e-9 * np.abs(total).max())


def test_accuracy_criteria_look_at_what_they_name(two_link):
    problem = build_excitation(two_link, series=SERIES)
    chosen = parameter_accuracy(problem, ["fore_link.mcx"])
    assert np.diag(chosen.weights).sum() >= 1.0
    assert np.linalg.eigvalsh(torque_accuracy(problem).weights)[0] >= -1e-12
    with pytest.raises(ParameterError, match="no parameter is named 'nothing'"):
        parameter_accuracy(problem, ["nothing"])
    with pytest.raises(ParameterError, match=r"upper_link\.m'.*no motion shows it"):
        parameter_accuracy(problem, ["upper_link.m"])
    assert problem.judged_by(ConditionNumber()).criterion == ConditionNumber()


def changed(robot, **limits):
    usual = limits_of(robot)
    values = {name: np.array(getattr(usual, name)) for name in ("lower", "upper", "velocity", "torque")}
    for name, (joint, value) in limits.items():
        values[name][joint] = value
    return type(usual)(**values, acceleration=usual.acceleration, jerk=usual.jerk)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (lambda r: {"limits": changed(r, lower=(1, 3.0))}, "joint 'elbow': position must have room"),
        (lambda r: {"limits": changed(r, velocity=(0, 0.0))}, "joint 'shoulder': velocity must be positive"),
        (lambda r: {"limits": changed(r, torque=(0, 0.0))}, "joint 'shoulder': torque must be positive"),
        (lambda r: {"series": FourierSeries(0.01, 5)}, "period of 0.01 s is too short|need at least 20 samples"),
        (lambda r: {"series": FourierSeries(0.05, 3)}, "period of 0.05 s is too short.*Take about"),
        (lambda r: {"series": FourierSeries(4.0, 30), "rate": 20.0}, "30 harmonics need at least 120 samples"),
        (lambda r: {"series": FourierSeries(4.0, 5), "samples": 12}, "design grid needs at least 20 samples"),
        (lambda r: {"rate": 0.0}, "rate must be a positive"),
        (lambda r: {"periods": 0}, "periods must be a positive"),
        (lambda r: {"start": [0.0, 9.0]}, "start of joint 'elbow' must be within its limits"),
        (lambda r: {"start": [0.0]}, "start must be 2 finite positions"),
        (lambda r: {"torque_noise": 0.0}, "torque noise must be positive"),
        (lambda r: {"clearance": -1.0}, "clearance must be a distance"),
        (lambda r: {"parameters": [1.0]}, "parameters must be 28 finite numbers"),
    ],
)
def test_bad_requests_are_told_so_while_building(two_link, wanted, message):
    with pytest.raises(ParameterError, match=message):
        build_excitation(two_link, **wanted(two_link))


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (
            lambda r: {"start": [0.0, 0.0], "obstacles": [Box("table", np.full(3, -2.0), np.full(3, 2.0))]},
            "cannot stand still at the start given: distance of link .* and 'table'",
        ),
        (
            lambda r: {"obstacles": [HalfSpace("ceiling", np.array([0.0, 0.0, -1.0]), 2.0)]},
            "found no configuration .* distance of link .* and 'ceiling'",
        ),
        (lambda r: {"keep_in": [keep_in(r, "fore_link", np.full(3, 8.0), np.full(3, 9.0))]}, "keep-in box of frame"),
    ],
)
def test_requests_without_a_feasible_motion_are_told_what_is_in_the_way(two_link, wanted, message):
    with pytest.raises(ParameterError, match=message):
        design_excitation(build_excitation(two_link, series=SERIES, **wanted(two_link)), starts=1)


def test_weight_beyond_the_torque_limits_is_named(two_link):
    limits = changed(two_link, torque=(0, 1e-3), lower=(0, -0.2), upper=(0, 0.2))
    with pytest.raises(ParameterError, match="torque of joint 'shoulder'"):
        design_excitation(build_excitation(two_link, series=SERIES, limits=limits), starts=1)


def test_joints_with_several_degrees_of_freedom_are_refused():
    robot = random_robot(np.random.default_rng(0), [JointKind.SPHERICAL])
    with pytest.raises(ParameterError, match="'joint_1' is spherical"):
        build_excitation(robot)


def test_a_link_that_does_not_exist_cannot_be_kept_in(two_link):
    with pytest.raises(ParameterError, match="no link is named 'hand'"):
        keep_in(two_link, "hand", np.zeros(3), np.ones(3))


@pytest.mark.parametrize("share", [0.0, 1.5])
def test_shares_of_limits_are_shares(two_link, share):
    with pytest.raises(ParameterError, match="torque_share"):
        limits_of(two_link, torque_share=share)


def test_limits_that_a_model_lacks_are_assumed_and_named():
    robot = random_robot(np.random.default_rng(1), [JointKind.CONTINUOUS, JointKind.PRISMATIC])
    limits = limits_of(robot)
    assert np.isfinite([limits.lower, limits.upper, limits.velocity]).all()
    assert any("'joint_1' has no position limits" in note for note in limits.assumed)
    assert any(note.startswith("no velocity limit") and "joint_2" in note for note in limits.assumed)
    assert set(limits.assumed) <= set(build_excitation(robot, series=SERIES, capsules=[]).notes)


@pytest.mark.parametrize("kind", [JointKind.FREE_FLYER, JointKind.SPHERICAL, JointKind.PLANAR])
def test_joints_with_more_degrees_of_freedom_are_refused_by_name(kind):
    robot = random_robot(np.random.default_rng(0), [kind, JointKind.REVOLUTE])
    for attempt in (limits_of, build_excitation):
        with pytest.raises(ParameterError, match=f"joint 'joint_1' is {kind.value}; only joints with one degree"):
            attempt(robot)

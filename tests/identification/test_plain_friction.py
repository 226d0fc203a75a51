"""Viscous and Coulomb friction that stand for kinds a robot file has no place for."""

import numpy as np
import pytest

from casysid.accumulation import accumulate_moments
from casysid.dynamics import DEFAULT_FRICTION, AsymmetricViscous, Coupling, PowerViscous, build_regressor, with_width
from casysid.identification.plain_friction import nearest_plain_friction
from tests.simulated import bundled_robot

ROBOT = bundled_robot("two_link")
MORE = (PowerViscous(exponent={"shoulder": 0.5}), AsymmetricViscous(("shoulder",)))
COUPLING = Coupling(("shoulder", "elbow"), (1.0, 1.0), ("viscous", "coulomb"))


def problem(friction=MORE, couplings=()):
    """A regressor with further friction, its moments over sinusoids, and coefficients of ordinary friction."""
    time = np.arange(2000) * 0.01
    v = np.column_stack([np.cos(1.1 * time), 0.7 * np.cos(1.7 * time + 1.0)])
    q, a = 0.5 * np.sin(v), np.gradient(v, 0.01, axis=0)
    regressor = build_regressor(ROBOT, with_width((*DEFAULT_FRICTION, *friction), 1e-3), couplings)
    theta = np.array(regressor.prior)
    theta[[name.endswith((".viscous", ".coulomb")) for name in regressor.names]] = 0.3
    moments = accumulate_moments(regressor, q, v, a, regressor.predict(theta, q, v, a))
    return regressor, theta, moments, (q, v, a)


def homeless(regressor):
    kept = {f"{dof}.{kind}" for dof in ROBOT.dofs for kind in ("viscous", "coulomb", "offset", "armature")}
    return [name for name in regressor.names[20:] if name not in kept]


def test_ordinary_friction_stays_as_it_is():
    regressor, theta, moments, _ = problem(friction=())
    found = nearest_plain_friction(regressor, theta, moments, [])
    assert {kind: values.tolist() for kind, values in found.items()} == {"viscous": [0.3, 0.3], "coulomb": [0.3, 0.3]}


@pytest.mark.parametrize("share", [0.4, -0.2])
def test_what_stands_for_other_friction_is_nearer_to_the_torque_than_nothing(share):
    regressor, theta, moments, state = problem()
    places = {name: k for k, name in enumerate(regressor.names)}
    theta[places["shoulder.power_viscous"]] = share
    found = nearest_plain_friction(regressor, theta, moments, homeless(regressor))
    plain, left_out = theta.copy(), theta.copy()
    plain[places["shoulder.power_viscous"]] = left_out[places["shoulder.power_viscous"]] = 0.0
    for kind, values in found.items():
        assert values[1] == 0.3  # the elbow's own
        plain[places[f"shoulder.{kind}"]] = values[0]
    wanted = regressor.predict(theta, *state)
    misses = [np.sum((regressor.predict(x, *state) - wanted) ** 2) for x in (plain, left_out)]
    assert misses[0] < 0.05 * misses[1]


def test_friction_by_direction_alone_changes_neither():
    regressor, theta, moments, _ = problem()
    theta[regressor.names.index("shoulder.viscous_asymmetry")] = 0.1
    found = nearest_plain_friction(regressor, theta, moments, homeless(regressor))
    assert found["viscous"] == pytest.approx([0.3, 0.3], abs=5e-3)
    assert found["coulomb"] == pytest.approx([0.3, 0.3], abs=5e-3)


def test_coefficients_are_never_negative():
    regressor, theta, moments, _ = problem()
    theta[regressor.names.index("shoulder.power_viscous")] = -5.0
    found = nearest_plain_friction(regressor, theta, moments, homeless(regressor))
    assert all((values >= 0.0).all() for values in found.values())


def test_a_shared_motor_brakes_both_joints():
    regressor, theta, moments, _ = problem(friction=(), couplings=[COUPLING])
    theta[regressor.names.index("shoulder+elbow.viscous")] = 0.2
    theta[regressor.names.index("shoulder+elbow.coulomb")] = 0.0
    found = nearest_plain_friction(regressor, theta, moments, homeless(regressor))
    assert found["viscous"] == pytest.approx([0.5, 0.5], abs=0.05)

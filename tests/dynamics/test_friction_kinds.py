"""Further kinds of friction: their torques, where they act, and what they refuse."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from casysid.dynamics import (
    DEFAULT_FRICTION,
    Armature,
    AsymmetricViscous,
    Coupling,
    DriveState,
    LoadedCoulomb,
    PowerViscous,
    Spring,
    Stribeck,
    Viscous,
    build_regressor,
    extend_regressor,
    with_width,
)
from casysid.dynamics.friction import joint_directions
from casysid.errors import ParameterError
from casysid.robot import JointKind
from tests.strategies import random_motion, random_robot

ARM = random_robot(np.random.default_rng(3), (JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.REVOLUTE))
MOTION = random_motion(ARM, np.random.default_rng(4), 7)
q, v, a = MOTION
WIDTH = np.array([0.05, 0.1, 0.2])


def loads(parameters):
    model = ARM.with_parameters(inertial_parameters=parameters).model
    data = model.createData()
    return np.abs([pin.computeGeneralizedGravity(model, data, one).copy() for one in q])


OTHER = 1.5 * ARM.inertial_parameters
SLOWLY = {
    "viscous_asymmetry": (AsymmetricViscous(), np.abs(v)),
    "stiffness": (Spring(), q),
    "stribeck": (Stribeck(WIDTH, 0.3), np.tanh(v / WIDTH) * np.exp(-((v / 0.3) ** 2))),
    "power": (PowerViscous(WIDTH, 3.0), v**3),
    "root": (PowerViscous(WIDTH, 0.5), v / (v**2 + WIDTH**2) ** 0.25),
    "loaded_coulomb": (LoadedCoulomb(WIDTH), loads(ARM.inertial_parameters) * np.tanh(v / WIDTH)),
    "another load": (LoadedCoulomb(WIDTH, None, tuple(OTHER)), loads(OTHER) * np.tanh(v / WIDTH)),
}


@pytest.mark.parametrize("name", SLOWLY)
def test_torques_are_those_of_the_formula(name):
    column, wanted = SLOWLY[name]
    got = build_regressor(ARM, [column]).evaluate(*MOTION)[:, :, 30:]
    np.testing.assert_allclose(got, np.einsum("ni,ij->nij", wanted, np.eye(3)), rtol=1e-10, atol=1e-12)


@given(st.floats(0.3, 3.0), st.floats(-2.0, 2.0))
def test_powers_of_speed_are_odd_and_grow(exponent, speed):
    column, direction = PowerViscous(1e-12, exponent), joint_directions(ARM)[0]
    forward, backward = (
        float(column.torque(direction, DriveState(0.0, sign * speed, 0.0, numbers=column.numbers(direction))))
        for sign in (1.0, -1.0)
    )
    assert forward == pytest.approx(-backward, abs=1e-15)
    assert forward * speed >= 0.0
    assert abs(forward) == pytest.approx(abs(speed) ** exponent, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize(
    "column",
    [
        AsymmetricViscous(("joint_2",)),
        Spring(("joint_2",)),
        LoadedCoulomb(joints=("joint_2",)),
        Stribeck(velocity={"joint_2": 0.1}),
        PowerViscous(exponent={"joint_2": 2.0}),
    ],
)
def test_a_column_acts_where_it_is_named_and_nowhere_else(column):
    coupling = Coupling(("joint_1", "joint_3"), (1.0, 1.0))
    regressor = build_regressor(ARM, [Viscous(), column], [coupling])
    assert regressor.names[33:] == (f"joint_2.{column.kind}", "joint_1+joint_3.viscous")
    assert not regressor.evaluate(*MOTION)[:, [0, 2], 33].any()


def test_a_coupling_has_only_the_kinds_it_is_given():
    couplings = [Coupling(("joint_1", "joint_3"), (1.0, sign), ("armature",)) for sign in (1.0, -1.0)]
    names = build_regressor(ARM, couplings=couplings).names
    assert names[42:] == ("joint_1+joint_3.armature", "joint_1-joint_3.armature")


def test_an_extended_regressor_has_the_same_columns_and_more():
    base, directions = build_regressor(ARM), joint_directions(ARM)
    more = [(Stribeck(0.1, slow), directions[2]) for slow in (0.1, 0.4)]
    extended = extend_regressor(base, more)
    Y = extended.evaluate(*MOTION)
    np.testing.assert_allclose(Y[:, :, : len(base.names)], base.evaluate(*MOTION), atol=1e-12)
    for k, (column, _) in enumerate(more):
        alone = build_regressor(ARM, [column]).evaluate(*MOTION)[:, :, 32]
        np.testing.assert_allclose(Y[:, :, len(base.names) + k], alone, atol=1e-12)
    theta = np.arange(len(extended.names), dtype=float)
    np.testing.assert_allclose(extended.predict(theta, *MOTION), Y @ theta, rtol=1e-9, atol=1e-9)
    assert len(set(extended.names)) == len(extended.names)


def test_an_extended_regressor_measures_torque_as_its_base_does():
    sensing = {"quasi_static": True, "torque_gains": (2.0, 1.0, 0.5)}
    direction = joint_directions(ARM)[0]
    extended = extend_regressor(
        build_regressor(ARM, [Viscous()], **sensing), [(Spring(), direction), (Armature(), direction)]
    )
    Y = extended.evaluate(*MOTION)
    np.testing.assert_allclose(Y[:, :, 30], np.outer(2.0 * v[:, 0], [1.0, 0.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(Y[:, :, 33], np.outer(2.0 * q[:, 0], [1.0, 0.0, 0.0]), atol=1e-12)
    assert not Y[:, :, 34].any()
    assert extended.column_kinds == ("",) * 30 + ("viscous",) * 3 + ("stiffness", "armature")


def test_widths_are_set_where_there_is_a_smooth_sign():
    columns = with_width((*DEFAULT_FRICTION, Stribeck(0.5, {"joint_1": 0.1}), Spring()), (0.1, 0.2, 0.3))
    assert [getattr(column, "width", None) for column in columns] == [
        None, (0.1, 0.2, 0.3), None, None, (0.1, 0.2, 0.3), None,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Stribeck(velocity=0.0), "velocity must be positive"),
        (lambda: Stribeck(velocity={"joint_1": np.inf}), "velocity must be positive"),
        (lambda: PowerViscous(exponent=-1.0), "exponent must be positive"),
        (lambda: build_regressor(ARM, [LoadedCoulomb(inertial_parameters=(1.0,))]), "must be 30 numbers; got 1"),
        (
            lambda: extend_regressor(build_regressor(ARM), [(Spring(("joint_1",)), joint_directions(ARM)[1])]),
            "no column for stiffness of joint_2",
        ),
    ],
)
def test_numbers_that_cannot_be_are_refused(make, message):
    with pytest.raises(ParameterError, match=message):
        make()

"""What holds of every kind of friction: it never drives a motion while it keeps its laws, and it survives JSON."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.dynamics import (
    FRICTION_KINDS,
    Armature,
    AsymmetricViscous,
    Coulomb,
    CoulombRipple,
    Counterweight,
    Drift,
    FrictionModel,
    LoadedCoulomb,
    MaxwellSlip,
    Offset,
    PowerViscous,
    RandomFeatures,
    Ripple,
    SharpCoulomb,
    Spring,
    Stribeck,
    Viscous,
    build_regressor,
    with_width,
)
from casysid.robot import JointKind
from tests.strategies import random_motion, random_robot

ARM = random_robot(np.random.default_rng(3), (JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.REVOLUTE))
MOTION = random_motion(ARM, np.random.default_rng(4), 200)
EXAMPLES = (
    Viscous(),
    Coulomb({"joint_1": 0.1, "joint_2": 0.2, "joint_3": 0.3}),
    Offset(),
    Armature(),
    AsymmetricViscous(("joint_1",)),
    Stribeck((0.1, 0.2, 0.3), {"joint_1": 0.4, "joint_3": 0.2}),
    PowerViscous(0.1, 2.0),
    LoadedCoulomb(0.1, ("joint_1", "joint_2"), tuple((1.5 * ARM.inertial_parameters).tolist())),
    Spring(("joint_2",)),
    Counterweight(),
    Ripple({"joint_1": (3.0, 17.25)}),
    CoulombRipple({"joint_1": (3.0,), "joint_3": (2.0, 5.5)}, 0.1),
    MaxwellSlip({"joint_2": (0.01, 0.1)}),
    SharpCoulomb(0.01),
    Drift(0.1, ("joint_3",)),
    RandomFeatures(2, (1.0, None, (1.0, 2.0, 3.0)), 5, ("joint_1",)),
)
WITHOUT_MEMORY = [one for one in EXAMPLES if one.is_friction and not isinstance(one, MaxwellSlip | Drift)]


def test_there_is_an_example_of_every_kind():
    assert {type(one) for one in EXAMPLES} == set(FRICTION_KINDS)


@pytest.mark.parametrize("kind", EXAMPLES, ids=lambda kind: kind.kind)
def test_a_kind_is_the_same_after_its_json(kind):
    content = json.loads(json.dumps(FrictionModel((kind,)).to_json(ARM)))
    (again,) = FrictionModel.from_json(content).columns
    assert type(again) is type(kind)
    other = ARM.with_parameters(inertial_parameters=2.0 * ARM.inertial_parameters)  # as after an identification
    regressors = build_regressor(ARM, [kind]), build_regressor(other, [again])
    assert regressors[0].names == regressors[1].names
    wanted, got = (one.evaluate(*MOTION)[:, :, 30:] for one in regressors)
    np.testing.assert_array_equal(got, wanted)


@given(st.integers(0, 10_000))
@settings(max_examples=30)
def test_friction_that_keeps_its_laws_drives_no_joint(seed):
    rng = np.random.default_rng(seed)
    regressor = build_regressor(ARM, with_width(WITHOUT_MEMORY, (0.1, 0.2, 0.3)))
    theta = np.zeros(len(regressor.names))
    theta[30:] = rng.normal(size=len(theta) - 30) * rng.integers(0, 2, len(theta) - 30)
    places = {name: k for k, name in enumerate(regressor.names)}
    for parameter, k in zip(regressor.parameters[30:], range(30, len(theta)), strict=True):
        theta[k] = max(theta[k], 0.0) if parameter.non_negative else theta[k]
    for law in regressor.friction_laws:  # each holds once the ordinary friction, which comes first, is large enough
        ordinary, *_ = law.coefficients
        theta[places[ordinary]] -= min(sum(one * theta[places[name]] for name, one in law.coefficients.items()), 0.0)
    power = regressor.predict(theta, *MOTION) * MOTION.v
    assert (power >= -1e-9).all()
    assert power.max() > 0.0 or not theta.any()

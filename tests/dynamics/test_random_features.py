"""A smooth rest of the torque, apart from the physics."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.dynamics import DEFAULT_FRICTION, FrictionModel, RandomFeatures, build_regressor
from casysid.errors import ParameterError
from casysid.robot import JointKind
from tests.strategies import random_motion, random_robot

ARM = random_robot(np.random.default_rng(3), (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.SPHERICAL))
MOTION = random_motion(ARM, np.random.default_rng(4), 30)


@given(st.integers(1, 5), st.integers(0, 100), st.tuples(*[st.floats(0.1, 10.0)] * 3))
@settings(max_examples=10)
def test_every_joint_has_all_waves_in_its_own_torque(count, seed, scales):
    kind = RandomFeatures(count, scales, seed)
    Y = build_regressor(ARM, [kind]).evaluate(*MOTION)[:, :, 30:].reshape(30, ARM.nv, ARM.nv, count)
    weights, phases = kind.waves([ARM.nq, ARM.nv, ARM.nv])
    waves = np.sqrt(2.0 / count) * np.cos(np.hstack(MOTION) @ weights.T + phases)
    np.testing.assert_allclose(Y, np.einsum("nd,ij->nijd", waves, np.eye(ARM.nv)), atol=1e-12)


def test_many_waves_have_the_kernel_of_their_length_scales():
    scales = (1.5, 4.0, None)
    Y = build_regressor(ARM, [RandomFeatures(20_000, scales, joints=(ARM.dofs[0],))]).evaluate(*MOTION)[:, 0, 30:]
    scaled = np.hstack([MOTION.q / 1.5, MOTION.v / 4.0])
    distance = ((scaled[:, None] - scaled[None]) ** 2).sum(axis=2)
    np.testing.assert_allclose(Y @ Y.T, np.exp(-0.5 * distance), atol=0.05)


def test_the_rest_is_kept_apart_and_survives_json():
    model = FrictionModel((*DEFAULT_FRICTION, RandomFeatures(3, (1.0, (1.0,) * ARM.nv, None), 7)))
    again = FrictionModel.from_json(json.loads(json.dumps(model.to_json(ARM))))
    assert again == model
    regressor = build_regressor(ARM, again.columns)
    apart = {column for part in regressor.parts if not part.kind.is_physical for column in part.columns}
    assert apart == {k for k, name in enumerate(regressor.names) if ".random_features_" in name}
    assert len(apart) == 3 * ARM.nv
    assert regressor.parts[-1].kind.describe(regressor.parts[-1].direction) == (
        "a rest without physics (3 random features)"
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, (1.0, 1.0, 1.0)), "count must be at least 1"),
        ((1, (1.0, 0.0, 1.0)), "must be three, of q, v and a, positive or None"),
        ((1, (1.0, 1.0)), "must be three, of q, v and a, positive or None"),
        ((1, ((1.0, 2.0), 1.0, 1.0)), "one number each or 7, 5, 5; got 2, 1, 1"),
    ],
)
def test_what_cannot_be_is_refused(arguments, message):
    with pytest.raises(ParameterError, match=message):
        build_regressor(ARM, [RandomFeatures(*arguments)])

"""A kind of friction that somebody else wrote, in one class: all that the product asks of a kind, it gets."""

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np
import pytest

from casysid.accumulation import accumulate_moments
from casysid.dynamics import (
    DEFAULT_FRICTION,
    FRICTION_KINDS,
    Coulomb,
    FrictionKind,
    FrictionModel,
    Law,
    RandomFeatures,
    SharpCoulomb,
    Spring,
    Stribeck,
    Term,
    build_regressor,
    extend_regressor,
)
from casysid.errors import ParameterError
from casysid.identification.friction_candidates import joined, joint_uses, propose
from casysid.identification.friction_laws import broken_laws, friction_laws, physics_rows
from casysid.identification.plain_friction import nearest_plain_friction
from tests.simulated import bundled_robot

ROBOT = bundled_robot("two_link")


@dataclass(frozen=True)
class Worn(FrictionKind):
    """Dry friction that differs within a worn range of the joint, by direction of motion: two terms.

    Attributes:
        centre: Of the range [rad] by joint.
    """

    centre: Mapping[str, float]

    kind: ClassVar[str] = "worn"
    by_design: ClassVar[bool] = True

    def terms(self, direction, state):
        if direction.name not in self.centre:
            return ()
        place = ca.exp(-((state.position - self.centre[direction.name]) ** 2))
        forward = 0.5 * (1.0 + ca.tanh(state.velocity / 0.01))
        return (
            Term("worn_forward", "N m", place * forward, non_negative=True),
            Term("worn_backward", "N m", -place * (1.0 - forward)),
        )

    @classmethod
    def candidates(cls, use):
        yield from (cls({use.direction.name: centre}) for centre in (0.0, use.speed))

    def laws(self, own, beside):
        return (Law({beside["coulomb"]: 1.0, own[1]: 1.0}, "worn backwards brakes"),)

    def describe(self, direction):
        return f"worn at {self.centre[direction.name]:g} rad"


def proposals():
    uses = {
        dof: dataclasses.replace(use, ripple=(7.0,), friction_ripple=(9.0,))
        for dof, use in joint_uses(ROBOT, np.ones(2), np.full(2, 0.01), np.ones(2)).items()
    }
    return propose(ROBOT, DEFAULT_FRICTION, (), uses, (*FRICTION_KINDS, Worn))


def motion():
    time = np.arange(1000) * 0.01
    v = np.column_stack([np.cos(1.1 * time), 0.7 * np.cos(1.7 * time + 1.0)])
    return 0.5 * np.sin(v), v, np.gradient(v, 0.01, axis=0)


def test_its_candidates_are_proposed_and_stand_in_one_pass():
    worn = [one for one in proposals() if one.kind == "worn"]
    assert [(one.joints, one.description) for one in worn] == [
        ((0,), "worn at 0 rad"), ((0,), "worn at 1 rad"), ((1,), "worn at 0 rad"), ((1,), "worn at 1 rad"),
    ]  # fmt: skip
    assert {one.family for one in worn} == {"worn"}
    extended = extend_regressor(build_regressor(ROBOT), [column for one in worn for column in one.columns])
    assert extended.names[28:] == tuple(
        f"{dof}.worn_{way} #{2 * k + j}"
        for k, dof in enumerate(("shoulder", "elbow"))
        for j in range(2)
        for way in ("forward", "backward")
    )
    assert [part.columns for part in extended.parts[-4:]] == [(28, 29), (30, 31), (32, 33), (34, 35)]
    q, v, a = motion()
    Y = extended.evaluate(q, v, a)
    for part in extended.parts[-4:]:
        dof = int(part.direction.weights.argmax())
        place = np.exp(-((q[:, dof] - part.kind.centre[part.direction.name]) ** 2))
        forward = 0.5 * (1.0 + np.tanh(v[:, dof] / 0.01))
        np.testing.assert_allclose(Y[:, dof, part.columns[0]], place * forward, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(Y[:, dof, part.columns[1]], -place * (1.0 - forward), rtol=1e-12, atol=1e-15)


def test_what_was_taken_acts_as_one_kind_of_all_its_joints():
    worn = [one for one in proposals() if one.kind == "worn"]
    model = joined(DEFAULT_FRICTION, (), [worn[1], worn[2]])
    assert model.columns == (*DEFAULT_FRICTION, Worn({"shoulder": 1.0, "elbow": 0.0}))
    with pytest.raises(ParameterError, match="cannot act as one 'worn'"):
        joined(DEFAULT_FRICTION, (), [worn[0], worn[1]])


def test_its_laws_are_asked():
    regressor = build_regressor(ROBOT, (*DEFAULT_FRICTION, Worn({"elbow": 0.0})))
    (law,) = friction_laws(regressor)
    assert dict(law.coefficients) == {"elbow.coulomb": 1.0, "elbow.worn_backward": 1.0}
    rows = physics_rows(regressor)
    assert rows[:, -2].sum() == 1.0  # not negative forwards
    theta = np.ones(len(regressor.names))
    assert broken_laws(regressor, theta) == ()
    theta[-1] = -1.1
    assert broken_laws(regressor, theta) == ("worn backwards brakes",)
    assert (rows @ theta < 0.0).sum() == 1


def test_a_robot_file_gets_the_ordinary_friction_that_is_nearest():
    regressor = build_regressor(ROBOT, (*DEFAULT_FRICTION, Worn({"elbow": 0.0})))
    theta = np.zeros(len(regressor.names))
    theta[-2:] = 0.5
    moments = accumulate_moments(regressor, *motion(), np.zeros((1000, 2)))
    found = nearest_plain_friction(regressor, theta, moments, regressor.names[-2:])
    assert found["coulomb"][1] == pytest.approx(0.45, abs=0.05)
    assert not found["coulomb"][0]


def test_it_survives_json_where_it_is_named():
    model = FrictionModel((*DEFAULT_FRICTION, Worn({"elbow": 0.25})))
    content = json.loads(json.dumps(model.to_json(ROBOT)))
    assert FrictionModel.from_json(content, (*FRICTION_KINDS, Worn)) == model
    with pytest.raises(ParameterError, match="'worn' of class Worn is none of the kinds"):
        FrictionModel.from_json(content)


@pytest.mark.parametrize(
    "kind",
    [kind for kind in FRICTION_KINDS[4:] if kind not in (RandomFeatures, SharpCoulomb)],
    ids=lambda kind: kind.kind,
)
def test_every_kind_is_described_and_merges_its_candidates(kind):
    alone = [one for one in proposals() if one.kind == kind.kind]
    assert len(alone) >= 2
    for first in alone:
        for second in alone:
            if first.joints < second.joints:
                merged = first.columns[0][0].merged_with(second.columns[0][0])
                regressor = build_regressor(ROBOT, [merged])
                assert {part.direction.name for part in regressor.parts} == {"shoulder", "elbow"}
                assert all(part.kind.describe(part.direction) for part in regressor.parts)


def test_kinds_that_differ_do_not_merge():
    for one, other in (
        (Stribeck(velocity={"elbow": 0.1}), Stribeck(velocity={"elbow": 0.2})),
        (Coulomb(0.1), Coulomb(0.2)),
        (Spring(), Coulomb()),
    ):
        with pytest.raises(ParameterError, match="cannot act as one"):
            one.merged_with(other)

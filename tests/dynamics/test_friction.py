"""Friction columns along transmission coordinates, and columns of one's own."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np
import pytest

from casysid.dynamics import Armature, Coulomb, Coupling, FrictionColumn, Offset, Viscous, build_regressor
from casysid.errors import ParameterError
from casysid.robot import JointKind
from tests.strategies import random_motion, random_robot


def arm(*kinds):
    return random_robot(np.random.default_rng(0), kinds)


WRIST = arm(JointKind.REVOLUTE, JointKind.REVOLUTE, JointKind.REVOLUTE)
MOTION = random_motion(WRIST, np.random.default_rng(1), 6)


@dataclass(frozen=True)
class Cubic(FrictionColumn):
    """Torque that grows with the cube of velocity."""

    kind: ClassVar[str] = "cubic"
    non_negative: ClassVar[bool] = True

    def unit(self, direction):
        return "N m s^3/rad^3"

    def torque(self, direction, state):
        return state.velocity**3


@dataclass(frozen=True)
class ForwardOnly(FrictionColumn):
    """Dry friction of forward motion alone: beside Coulomb's, friction that differs by the sign of velocity."""

    width: float = 0.01
    kind: ClassVar[str] = "forward"

    def unit(self, direction):
        return "N m"

    def torque(self, direction, state):
        return ca.if_else(state.velocity > 0, ca.tanh(state.velocity / self.width), 0)


@dataclass(frozen=True)
class Spring(FrictionColumn):
    """A spring at one joint."""

    joint: str
    kind: ClassVar[str] = "stiffness"

    def unit(self, direction):
        return "N m/rad"

    def torque(self, direction, state):
        return state.position if direction.name == self.joint else None


def columns(regressor, motion, first):
    return regressor.evaluate(*motion)[:, :, first:]


def test_joint_columns_act_on_their_own_joint():
    _, v, a = MOTION
    got = columns(build_regressor(WRIST), MOTION, 30)
    for block, values in enumerate((v, np.tanh(v / 0.01), np.ones_like(v), a)):
        wanted = np.einsum("ni,ij->nij", values, np.eye(3))
        np.testing.assert_allclose(got[:, :, 3 * block : 3 * block + 3], wanted, atol=1e-14)


def test_a_coupling_acts_on_all_its_joints_by_weight():
    _, v, a = MOTION
    coupling = Coupling(joints=("joint_2", "joint_3"), weights=(1.0, -2.0))
    friction = (Viscous(), Coulomb(width=(0.1, 0.2, 0.3)), Offset(), Armature())
    regressor = build_regressor(WRIST, friction, [coupling])
    names = ["joint_2-joint_3.viscous", "joint_2-joint_3.coulomb", "joint_2-joint_3.armature"]
    assert list(regressor.names[42:]) == names  # its offset is a sum of its joints' offsets
    c = np.array([0.0, 1.0, -2.0])
    wanted = np.stack([v @ c, np.tanh(v @ c / 0.8), a @ c], axis=-1)
    np.testing.assert_allclose(columns(regressor, MOTION, 42), np.einsum("nk,j->njk", wanted, c), atol=1e-13)
    assert not regressor.prior[42:].any()


def test_coulomb_width_may_be_given_by_name():
    v = MOTION.v
    width = {"joint_1": 0.1, "joint_2": 0.2, "joint_3": 0.4}
    got = columns(build_regressor(WRIST, [Coulomb(width=width)]), MOTION, 30)
    np.testing.assert_allclose(np.einsum("nii->ni", got), np.tanh(v / [0.1, 0.2, 0.4]))


def test_own_columns_take_a_few_lines():
    q, v, _ = MOTION
    regressor = build_regressor(WRIST, [Cubic(), ForwardOnly(width=0.5), Spring("joint_2")])
    got = columns(regressor, MOTION, 30)
    np.testing.assert_allclose(np.einsum("nii->ni", got[:, :, :3]), v**3, rtol=1e-12)
    np.testing.assert_allclose(np.einsum("nii->ni", got[:, :, 3:6]), np.where(v > 0, np.tanh(v / 0.5), 0), rtol=1e-12)
    assert regressor.names[30:][6:] == ("joint_2.stiffness",)
    np.testing.assert_allclose(got[:, 1, 6], q[:, 1])
    assert regressor.parameters[30].non_negative
    assert not regressor.prior[30:].any()


def test_a_column_of_position_at_a_joint_without_one_is_refused():
    with pytest.raises(ParameterError, match="'stiffness' uses the position of 'joint_1_wx', which has none"):
        build_regressor(arm(JointKind.SPHERICAL), [Spring("joint_1_wx")])


def test_the_position_of_a_continuous_joint_is_its_angle():
    robot = arm(JointKind.CONTINUOUS)
    angle = np.array([[-3.0], [0.5], [2.0]])
    zeros = np.zeros((3, 1))
    Y = build_regressor(robot, [Spring("joint_1")]).evaluate(np.hstack([np.cos(angle), np.sin(angle)]), zeros, zeros)
    np.testing.assert_allclose(Y[:, :, 10], angle)


def test_a_coupling_of_linear_and_angular_joints_counts_as_an_angle():
    robot = arm(JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.PRISMATIC)
    couplings = Coupling(("joint_1", "joint_2"), (1.0, 300.0)), Coupling(("joint_2", "joint_3"), (1.0, 1.0))
    regressor = build_regressor(robot, [Viscous()], couplings)
    assert [parameter.unit for parameter in regressor.parameters[-2:]] == ["N m s/rad", "N s/m"]


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan, (0.1, 0.0, 0.1), {"joint_1": -0.1}])
def test_a_width_that_is_not_positive_is_refused(width):
    with pytest.raises(ParameterError, match="width must be positive"):
        Coulomb(width=width)


@pytest.mark.parametrize(
    ("friction", "couplings", "message"),
    [
        ([Coulomb(width=(0.1, 0.2))], [], "one for each of the 3 degrees of freedom; got 2"),
        ([Coulomb(width={"joint_1": 0.1})], [], "'joint_2' is missing"),
        ([Viscous(), Viscous()], [], "every kind and every coupling once"),
        ([Viscous()], [Coupling(("joint_1", "joint_2"), (1.0, 1.0))] * 2, "every kind and every coupling once"),
        (
            [Viscous()],
            [Coupling(("joint_1", "elbow"), (1.0, 1.0))],
            "no degree of freedom named elbow; known are joint_1",
        ),
    ],
)
def test_friction_that_does_not_fit_the_robot_is_refused(friction, couplings, message):
    with pytest.raises(ParameterError, match=message):
        build_regressor(WRIST, friction, couplings)


@pytest.mark.parametrize("joints", [("joint_1",), ("joint_1", "joint_1"), ("joint_1", "joint_2", "joint_3")])
def test_a_coupling_needs_different_joints_with_one_weight_each(joints):
    with pytest.raises(ParameterError, match="two or more different joints and one weight for each"):
        Coupling(joints, (1.0, 1.0))


def test_regressors_that_differ_in_widths_share_their_algebra_and_keep_their_widths():
    sharp, blunt = (build_regressor(WRIST, friction=[Viscous(), Coulomb(width)]) for width in ((0.1, 0.2, 0.3), 2.0))
    assert sharp.template is blunt.template
    _, v, _ = MOTION
    dry = [sharp.names.index(f"{dof}.coulomb") for dof in WRIST.dofs]
    for regressor, width in ((sharp, np.array([0.1, 0.2, 0.3])), (blunt, 2.0)):
        wanted = np.einsum("nj,jk->njk", np.tanh(v / width), np.eye(3))
        np.testing.assert_allclose(regressor.evaluate(*MOTION)[:, :, dry], wanted, atol=1e-15)
        np.testing.assert_allclose(regressor.function(*(x[0] for x in MOTION)).full()[:, dry], wanted[0], atol=1e-15)

"""Columns of the regressor: what they multiply, and that they add up to the torque."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.dynamics import Armature, Coulomb, Offset, Regressor, Viscous, build_regressor
from casysid.errors import ParameterError
from casysid.robot import JointKind, Robot
from tests.strategies import Motion, motions, random_motion, random_placement, random_robot, robots

FRICTION = (Viscous(), Coulomb(width=0.3), Offset(), Armature())
quick = settings(max_examples=20, deadline=None)


@st.composite
def regressors(draw) -> tuple[Robot, Regressor, Motion]:
    robot = draw(robots())
    return robot, build_regressor(robot, FRICTION), draw(motions(robot, samples=4))


def assert_close(got, wanted, relative=1e-10):
    np.testing.assert_allclose(got, wanted, rtol=0, atol=relative * max(np.abs(wanted).max(initial=0.0), 1.0))


@quick
@given(regressors())
def test_regressor_times_the_files_parameters_is_the_files_torque(case):
    robot, regressor, (q, v, a) = case
    data = robot.model.createData()
    rigid = np.array([pin.rnea(robot.model, data, *state) for state in zip(q, v, a, strict=True)])
    wanted = rigid + robot.damping * v + robot.dry_friction * np.tanh(v / 0.3)
    assert_close(regressor.evaluate(q, v, a) @ regressor.prior, wanted)


@quick
@given(regressors())
def test_evaluation_in_bulk_is_the_function_at_each_sample(case):
    _, regressor, motion = case
    one_by_one = [regressor.function(*state).full() for state in zip(*motion, strict=True)]
    assert_close(regressor.evaluate(*motion), one_by_one, relative=1e-14)


@quick
@given(regressors(), st.integers(0, 1000))
def test_prediction_is_regressor_times_parameters(case, seed):
    _, regressor, motion = case
    parameters = np.random.default_rng(seed).normal(size=len(regressor.names))
    assert_close(regressor.predict(parameters, *motion), regressor.evaluate(*motion) @ parameters)


@quick
@given(regressors())
def test_rows_have_entries_only_in_their_own_columns(case):
    robot, regressor, motion = case
    Y = regressor.evaluate(*motion)
    for dof, columns in enumerate(regressor.row_columns):
        assert not np.delete(Y[:, dof], columns, axis=1).any()
    last = robot.joints[-1]
    links = {regressor.parameters[c].owner for c in regressor.row_columns[last.v.start]} & set(robot.links)
    assert links <= {last.link}


@quick
@given(robots(max_joints=3, kinds=(JointKind.REVOLUTE, JointKind.PRISMATIC)), st.integers(0, 1000))
def test_moving_a_links_frame_changes_its_parameters_but_not_the_torque(robot, seed):
    rng = np.random.default_rng(seed)
    moved_model = pin.Model()
    moved_model.gravity = robot.model.gravity
    moves = []
    for i, joint in enumerate(robot.joints):
        turn = random_placement(rng).rotation
        along = joint.axis * rng.normal() if joint.kind is JointKind.REVOLUTE else rng.normal(size=3)
        move = pin.SE3(turn, along)  # of the joint's frame, which keeps the axis where it is
        make = pin.JointModelRevoluteUnaligned if joint.kind is JointKind.REVOLUTE else pin.JointModelPrismaticUnaligned
        before = moves[joint.parent].inverse() if joint.parent >= 0 else pin.SE3.Identity()
        place = before * joint.placement * move
        moved_model.addJoint(joint.parent + 1, make(turn.T @ joint.axis), place, joint.name)
        moved_model.appendBodyToJoint(i + 1, move.actInv(robot.model.inertias[i + 1]), pin.SE3.Identity())
        moves.append(move)
    here, moved = (build_regressor(r, ()) for r in (robot, Robot.from_pin(moved_model)))
    motion = random_motion(robot, rng, 3)
    assert not np.allclose(moved.prior, here.prior)
    assert_close(moved.predict(moved.prior, *motion), here.predict(here.prior, *motion))


def test_columns_are_named_by_owner_and_kind_with_units():
    robot = random_robot(np.random.default_rng(0), [JointKind.REVOLUTE, JointKind.PRISMATIC])
    regressor = build_regressor(robot)
    kinds = "m mcx mcy mcz Ixx Ixy Iyy Ixz Iyz Izz".split()
    assert regressor.names == (
        *(f"{link}.{kind}" for link in robot.links for kind in kinds),
        *(f"{dof}.{kind}" for kind in ("viscous", "coulomb", "offset", "armature") for dof in robot.dofs),
    )
    assert [parameter.unit for parameter in regressor.parameters] == (
        (["kg"] + ["kg m"] * 3 + ["kg m^2"] * 6) * 2 + ["N m s/rad", "N s/m"] + ["N m", "N"] * 2 + ["kg m^2", "kg"]
    )
    assert {p.kind for p in regressor.parameters if p.non_negative} == {
        "m", "Ixx", "Iyy", "Izz", "viscous", "coulomb", "armature",
    }  # fmt: skip
    np.testing.assert_array_equal(
        regressor.prior,
        np.concatenate([robot.inertial_parameters, robot.damping, robot.dry_friction, [0, 0], robot.armature]),
    )


def test_a_floating_base_has_no_friction_columns():
    robot = random_robot(np.random.default_rng(0), [JointKind.FREE_FLYER, JointKind.SPHERICAL])
    owners = [parameter.owner for parameter in build_regressor(robot, [Viscous()]).parameters[20:]]
    assert owners == ["joint_2_wx", "joint_2_wy", "joint_2_wz"]


def test_a_massless_joint_between_two_of_one_body_has_no_columns(tmp_path):
    path = tmp_path / "universal.xml"
    path.write_text(
        '<mujoco><worldbody><body name="b" pos="0 0 1"><joint name="x" axis="1 0 0" armature="0.1"/>'
        '<joint name="y" axis="0 1 0" pos="0.1 0 0" armature="0.2"/>'
        '<inertial pos="0.1 0.2 0.3" mass="2" diaginertia="0.1 0.2 0.25"/></body></worldbody></mujoco>'
    )
    robot = Robot.from_file(path)
    regressor = build_regressor(robot)
    q, v, a = random_motion(robot, np.random.default_rng(0), 5)
    assert regressor.names[10:] == tuple(f"{d}.{k}" for k in ("viscous", "coulomb", "offset", "armature") for d in "xy")
    data = robot.model.createData()
    rigid = [pin.rnea(robot.model, data, *state) for state in zip(q, v, a, strict=True)]
    assert_close(regressor.predict(regressor.prior, q, v, a), rigid)


def test_a_pickled_regressor_gives_the_same():
    robot = random_robot(np.random.default_rng(0), [JointKind.REVOLUTE, JointKind.SPHERICAL])
    regressor = build_regressor(robot)
    motion = random_motion(robot, np.random.default_rng(1), 3)
    before = regressor.evaluate(*motion)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(regressor)).evaluate(*motion), before)


def test_wrong_shapes_are_named():
    regressor = build_regressor(random_robot(np.random.default_rng(0), [JointKind.CONTINUOUS]))
    with pytest.raises(ParameterError, match=r"wants q \(N, 2\), v \(N, 1\).*got \(5, 1\), \(5, 1\)"):
        regressor.evaluate(np.zeros((5, 1)), np.zeros((5, 1)), np.zeros((5, 1)))

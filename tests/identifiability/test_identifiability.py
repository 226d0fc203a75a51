"""Base parameters: as many as the torque depends on, the same torque, and words that say so."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.dynamics import Armature, Offset, Viscous, build_regressor
from casysid.identifiability import (
    RANK_TOLERANCE,
    BaseParameters,
    Identifiability,
    base_parameters_of_gram,
    excited_base_parameters,
    random_states,
    structural_base_parameters,
)
from casysid.moments import Moments
from casysid.robot import JointKind, Robot
from tests.simulated import bundled_robot
from tests.strategies import SINGLE_KINDS, generators, robots

SMOOTH = (Viscous(), Offset(), Armature())
LAWS = settings(max_examples=20, deadline=None)


def rows_of(robot: Robot, rng: np.random.Generator, count: int = 200) -> np.ndarray:
    """Regressor rows (N nv, p) at states that the base parameters were not found from."""
    regressor = build_regressor(robot, friction=SMOOTH)
    return regressor.evaluate(*random_states(robot, count, rng)).reshape(-1, len(regressor.names))


@LAWS
@given(robots(max_joints=4), generators())
def test_base_parameters_give_the_same_torque_as_all_parameters(robot, rng):
    base = structural_base_parameters(build_regressor(robot, friction=SMOOTH))
    rows, theta = rows_of(robot, rng), rng.normal(size=base.transform.shape[1])
    full, reduced = rows @ theta, rows[:, base.independent] @ (base.transform @ theta)
    assert np.linalg.norm(full - reduced) < 1e-7 * np.linalg.norm(np.abs(rows) @ np.abs(theta))


@LAWS
@given(robots(max_joints=4), generators())
def test_the_rank_is_that_of_the_regressor(robot, rng):
    rows = rows_of(robot, rng, 400)
    length = np.linalg.norm(rows, axis=0)
    singular = np.linalg.svd(rows / np.where(length > 1e-9 * length.max(), length, np.inf), compute_uv=False)
    expected = int((singular > 1e-7 * singular[0]).sum())
    assert structural_base_parameters(build_regressor(robot, friction=SMOOTH)).rank == expected


def slowly(rows: np.ndarray, tolerance: float) -> tuple[list[int], np.ndarray]:
    """Gram and Schmidt on the rows' columns one by one, and least squares of all columns on those before them."""
    unit = rows / np.linalg.norm(rows, axis=0)
    basis, independent = np.empty((len(rows), 0)), []
    for column in range(rows.shape[1]):
        rest = unit[:, column] - basis @ (basis.T @ unit[:, column])
        rest -= basis @ (basis.T @ rest)
        if np.linalg.norm(rest) > tolerance * np.sqrt(rows.shape[1]):
            independent.append(column)
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    return independent, np.linalg.lstsq(rows[:, independent], rows, rcond=None)[0]


@settings(max_examples=10, deadline=None)
@given(generators(), st.integers(1, 90), st.integers(70, 150))
def test_columns_are_eliminated_as_by_gram_and_schmidt(rng, rank, p):
    rows = rng.normal(size=(200, min(rank, p))) @ rng.normal(size=(min(rank, p), p))
    base = base_parameters_of_gram(rows.T @ rows, tuple(f"x{k}" for k in range(p)))
    independent, transform = slowly(rows, RANK_TOLERANCE)
    assert base.independent.tolist() == independent
    np.testing.assert_allclose(base.transform, transform, atol=1e-4 * np.abs(transform).max())


@LAWS
@given(robots(max_joints=3))
def test_structure_is_that_of_the_rows_at_random_states(robot):
    regressor = build_regressor(robot, friction=SMOOTH)
    rows = rows_of(robot, np.random.default_rng(0), 60)
    slow = base_parameters_of_gram(rows.T @ rows, regressor.names, quietest=RANK_TOLERANCE)
    base = structural_base_parameters(regressor, samples=60)
    assert base.independent.tolist() == slow.independent.tolist()
    np.testing.assert_allclose(base.transform, slow.transform, atol=1e-6 * np.abs(slow.transform).max())
    assert base.condition_number == pytest.approx(slow.condition_number, rel=1e-6)


@LAWS
@given(generators(), st.integers(1, 8))
def test_a_full_rank_problem_keeps_every_parameter(rng, p):
    rows = rng.normal(size=(50, p)) * 10.0 ** rng.uniform(-3, 3, p)
    base = base_parameters_of_gram(rows.T @ rows, tuple(f"x{k}" for k in range(p)))
    assert base.rank == p
    np.testing.assert_allclose(base.transform, np.eye(p), atol=1e-9)
    assert set(base.identifiability()) == {Identifiability.ALONE}
    assert base.words() == base.names


@LAWS
@given(generators(), st.floats(-4.0, 4.0))
def test_the_combination_does_not_depend_on_units(rng, exponent):
    x, y = rng.normal(size=(2, 100))
    unit = 10.0**exponent
    rows = np.column_stack([x, unit * y, 2.0 * x - 3.0 * unit * y])
    base = base_parameters_of_gram(rows.T @ rows, ("a", "b", "c"))
    np.testing.assert_allclose(base.transform, [[1.0, 0.0, 2.0], [0.0, 1.0, -3.0]], atol=1e-6)
    assert base.words() == ("a + 2 c", "b - 3 c")


@LAWS
@given(robots(max_joints=4, kinds=SINGLE_KINDS), generators())
def test_angles_of_four_digits_do_not_add_rank(robot, rng):
    import pinocchio as pin

    exact = robot.model.copy()
    for k, joint in enumerate(robot.joints):  # right angles, as designers have them
        turn = rng.integers(0, 4, size=3) * np.pi / 2.0
        exact.jointPlacements[k + 1] = pin.SE3(pin.rpy.rpyToMatrix(turn), joint.placement.translation)
    rounded = exact.copy()
    for k in range(1, rounded.njoints):
        turn = np.round(pin.rpy.matrixToRpy(exact.jointPlacements[k].rotation), 4)
        rounded.jointPlacements[k] = pin.SE3(pin.rpy.rpyToMatrix(turn), exact.jointPlacements[k].translation)
    ranks = {
        structural_base_parameters(build_regressor(Robot.from_pin(model), friction=SMOOTH)).rank
        for model in (exact, rounded)
    }
    assert len(ranks) == 1


@LAWS
@given(robots(max_joints=3), generators())
def test_data_show_no_more_than_the_structure_has(robot, rng):
    regressor = build_regressor(robot, friction=SMOOTH)
    rows = regressor.evaluate(*random_states(robot, 3, rng))
    tall = np.concatenate([rows, np.zeros((*rows.shape[:2], 1))], axis=2)
    gram = np.einsum("njm,njk->jmk", tall, tall)[None]
    moments = Moments.from_dense(gram, np.full((1, robot.nv), 3.0), regressor.names, robot.dofs)
    shown = excited_base_parameters(regressor, moments, np.ones(robot.nv))
    assert shown.rank <= min(structural_base_parameters(regressor).rank, 3 * robot.nv)


def test_a_planar_arm_says_what_every_textbook_says():
    base = structural_base_parameters(build_regressor(bundled_robot("two_link.urdf"), friction=()))
    assert base.words() == (
        "upper_link.mcx + 0.5 fore_link.m",
        "upper_link.mcy",
        "upper_link.Izz + 0.25 fore_link.m",
        "fore_link.mcx",
        "fore_link.mcy",
        "fore_link.Izz",
    )
    known = dict(zip(base.names, base.identifiability(), strict=True))
    assert known["fore_link.Izz"] is Identifiability.ALONE
    assert known["fore_link.m"] is Identifiability.COMBINED
    assert known["upper_link.m"] is known["fore_link.mcz"] is Identifiability.NOT_AT_ALL


@pytest.mark.parametrize("kind", [JointKind.FREE_FLYER])
def test_a_free_body_shows_all_ten_parameters(kind):
    from tests.strategies import random_robot

    robot = random_robot(np.random.default_rng(0), [kind])
    base = structural_base_parameters(build_regressor(robot, friction=()))
    assert base.rank == 10
    assert set(base.identifiability()) == {Identifiability.ALONE}


def test_nothing_seen_is_no_base_parameter():
    base = base_parameters_of_gram(np.zeros((3, 3)), ("a", "b", "c"))
    assert isinstance(base, BaseParameters)
    assert base.rank == 0
    assert set(base.identifiability()) == {Identifiability.NOT_AT_ALL}

"""Equations of robots with a free base: against Pinocchio, and three ways to identify against each other."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.accumulation import accumulate_moments
from casysid.dynamics import build_regressor
from casysid.errors import ParameterError
from casysid.estimation import OrdinaryLeastSquares
from casysid.floating import (
    Contact,
    Wrench,
    check_contacts,
    free_projector,
    generalised_forces,
    projected_moments,
    unknown_directions,
)
from casysid.kinematics import Axes, Frame, Kinematics
from casysid.robot import JointKind
from casysid.signals.averaging import BandAverage
from tests.strategies import generators, random_motion, random_placement, random_robot, robots

KINDS = (JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.CONTINUOUS)


@st.composite
def floating_robots(draw):
    tree = draw(robots(max_joints=4, kinds=KINDS))
    kinds = [JointKind.FREE_FLYER, *(joint.kind for joint in tree.joints)]
    return random_robot(draw(generators()), kinds, [0, *(draw(st.integers(0, 2)) for _ in tree.joints)])


def legged(seed, legs=3):
    """A base with legs of three joints, all hanging at it, and their feet."""
    kinds = [JointKind.FREE_FLYER] + [JointKind.REVOLUTE] * (3 * legs)
    branches = [0] + [3 if k and k % 3 == 0 else 0 for k in range(3 * legs)]
    robot = random_robot(np.random.default_rng(seed), kinds, branches)
    feet = [
        Frame(name=f"foot_{k}", joint=3 * k + 3, rotation=np.eye(3), translation=np.array([0.1, 0.2, -0.3]))
        for k in range(legs)
    ]
    return robot, feet


def on_its_feet(robot, feet, samples, seed, flat=False):
    """Random states, and joint torques and wrenches at the feet with which they obey Newton."""
    q, v, a = random_motion(robot, np.random.default_rng(seed), samples)
    data = robot.model.createData()
    needed = np.array([pin.rnea(robot.model, data, *state) for state in zip(q, v, a, strict=True)])
    kinematics = Kinematics(robot)
    jacobians = np.stack([kinematics.jacobians(foot, q, Axes.FRAME) for foot in feet], axis=1)
    usable = jacobians if flat else jacobians[:, :, :3]
    stacked = usable.reshape(samples, -1, robot.nv)
    w = np.array([np.linalg.lstsq(J[:, :6].T, tau[:6], rcond=None)[0] for J, tau in zip(stacked, needed, strict=True)])
    tau = needed - np.einsum("nij,ni->nj", stacked, w)
    values = np.zeros((samples, len(feet), 6))
    values[:, :, : usable.shape[2]] = w.reshape(samples, len(feet), -1)
    wrenches = [Wrench(frame=foot, values=values[:, k]) for k, foot in enumerate(feet)]
    assert np.abs(tau[:, :6]).max() < 1e-8 * np.abs(needed).max()
    return (q, v, a), tau, wrenches


@settings(max_examples=200, deadline=None)
@given(floating_robots(), generators())
def test_the_regressor_with_wrenches_is_pinocchios_free_flyer(robot, rng):
    q, v, a = random_motion(robot, rng, 2)
    regressor, kinematics, data = build_regressor(robot, ()), Kinematics(robot), robot.model.createData()
    place = random_placement(rng)
    joint = int(rng.integers(len(robot.joints)))
    frame = Frame(name="foot", joint=joint, rotation=place.rotation, translation=place.translation)
    values = rng.normal(size=(2, 6))
    forces = generalised_forces(kinematics, q, np.zeros((2, robot.nv)), [Wrench(frame=frame, values=values)])
    left = regressor.evaluate(q, v, a) @ regressor.prior - forces
    for k in range(2):
        outside = [pin.Force.Zero() for _ in range(robot.model.njoints)]
        outside[joint + 1] = place.act(pin.Force(values[k]))
        armature = robot.armature * a[k]  # rnea has it, the regressor without columns for it has not
        wanted = pin.rnea(robot.model, data, q[k], v[k], a[k], outside) - armature
        np.testing.assert_allclose(left[k], wanted, rtol=0, atol=1e-10 * max(np.abs(wanted).max(), 1.0))


@settings(max_examples=30, deadline=None)
@given(generators(), st.integers(0, 8), st.booleans())
def test_the_projector_takes_the_unknown_directions_out_and_nothing_else(rng, count, dependent):
    U = rng.normal(size=(3, count, 9))
    if dependent and count > 1:
        U[:, -1] = U[:, 0]
    P = free_projector(U)
    np.testing.assert_allclose(P @ np.swapaxes(U, 1, 2), 0.0, atol=1e-12)
    np.testing.assert_allclose(P @ P, P, atol=1e-12)
    rank = count - (dependent and count > 1)
    np.testing.assert_allclose(np.einsum("nii->n", P), 9 - rank, atol=1e-12)


@pytest.mark.parametrize(("legs", "flat"), [(3, False), (1, True)])
def test_three_ways_agree_without_noise(legs, flat):
    """In all that each can see: known torques of a prior far from the truth come out as those of the truth."""
    robot, feet = legged(0, legs)
    (q, v, a), tau, wrenches = on_its_feet(robot, feet, 400, 1, flat)
    regressor, kinematics = build_regressor(robot), Kinematics(robot)
    # the simulated torques have no friction
    truth = np.array([0.0 if p.kind in ("viscous", "coulomb") else p.prior for p in regressor.parameters])
    prior = truth * np.random.default_rng(3).uniform(0.5, 1.5, len(truth))
    forces = generalised_forces(kinematics, q, tau, wrenches)
    check = random_motion(robot, np.random.default_rng(7), 50)
    Y = regressor.evaluate(*check)
    ways = {
        "all wrenches": (forces, False, ()),
        "the base alone": (forces, False, robot.dofs[6:]),
        "no wrenches": (tau, True, ()),
    }
    found = {}
    for way, (known, in_contact, unmeasured) in ways.items():
        contacts, again = (
            [Contact(frame=foot, touching=np.ones(n, dtype=bool), is_flat=flat) for foot in feet if in_contact]
            for n in (len(q), 50)
        )
        moments = projected_moments(regressor, q, v, a, known, contacts=contacts, unmeasured=unmeasured)
        found[way] = OrdinaryLeastSquares().estimate(moments, prior)
        rows = free_projector(unknown_directions(kinematics, check.q, again, unmeasured)) @ Y
        wanted, got = rows @ truth, rows @ found[way].parameters
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-6 * np.abs(wanted).max(), err_msg=way)
        assert np.abs(rows @ prior - wanted).max() > 0.05 * np.abs(wanted).max()
    mass = [p.kind == "m" for p in regressor.parameters]
    for way in ("all wrenches", "the base alone"):
        np.testing.assert_allclose(found[way].parameters[mass].sum(), truth[mass].sum(), rtol=1e-6)


def test_unknown_point_contacts_hide_a_mass_at_each_foot_and_nothing_else():
    robot, feet = legged(0, legs=3)
    (q, v, a), tau, wrenches = on_its_feet(robot, feet, 400, 1)
    regressor = build_regressor(robot, ())
    forces = generalised_forces(Kinematics(robot), q, tau, wrenches)
    contacts = [Contact(frame=foot, touching=np.ones(len(q), dtype=bool)) for foot in feet]
    known = projected_moments(regressor, q, v, a, forces).pooled()
    hidden = projected_moments(regressor, q, v, a, tau, contacts=contacts).pooled()
    assert np.linalg.matrix_rank(hidden.xx, tol=1e-7 * np.abs(hidden.xx).max()) == (
        np.linalg.matrix_rank(known.xx, tol=1e-7 * np.abs(known.xx).max()) - len(feet)
    )
    for k, foot in enumerate(feet):
        link, t = 3 * k + 3, foot.translation
        mass = np.zeros(len(regressor.names))
        square = np.dot(t, t) * np.eye(3) - np.outer(t, t)
        mass[10 * link : 10 * link + 10] = [1.0, *t, *square[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]]
        assert mass @ hidden.xx @ mass < 1e-9 * (mass @ known.xx @ mass)


def test_without_unknown_forces_these_are_the_usual_moments():
    robot, _ = legged(1, legs=1)
    q, v, a = random_motion(robot, np.random.default_rng(0), 300)
    regressor = build_regressor(robot)
    tau = np.random.default_rng(1).normal(size=v.shape)
    for average in (None, BandAverage(np.arange(300) * 0.01, 5.0)):
        usual = accumulate_moments(regressor, q, v, a, tau, average=average, blocks=3)
        got = projected_moments(regressor, q, v, a, tau, average=average, blocks=3)
        np.testing.assert_allclose(got.count, usual.count)
        np.testing.assert_allclose(got.gram, usual.gram, rtol=1e-9, atol=1e-9 * np.abs(usual.gram).max())


def test_the_base_alone_needs_no_torques():
    robot, feet = legged(2, legs=2)
    (q, v, a), tau, wrenches = on_its_feet(robot, feet, 100, 1, flat=True)
    forces = generalised_forces(Kinematics(robot), q, tau, wrenches)
    broken = forces.copy()
    broken[:, 6:] = 1e3
    regressor = build_regressor(robot)
    one, other = (projected_moments(regressor, q, v, a, f, unmeasured=robot.dofs[6:]) for f in (forces, broken))
    assert one.joints == robot.dofs[:6]
    np.testing.assert_array_equal(one.count, other.count)
    np.testing.assert_allclose(one.gram, other.gram, atol=1e-9 * np.abs(one.gram).max())


def test_rows_count_as_the_equations_that_are_left():
    robot, feet = legged(3)
    (q, v, a), tau, _ = on_its_feet(robot, feet, 60, 1)
    touching = np.arange(60) < 20
    contacts = [Contact(frame=foot, touching=touching) for foot in feet]
    moments = projected_moments(build_regressor(robot), q, v, a, tau, contacts=contacts, blocks=2)
    np.testing.assert_allclose(moments.count.sum(), 60 * robot.nv - 20 * 9)


def test_noise_weighs_the_equations():
    """The estimate is generalised least squares with the noise that the projection makes of the sensors'."""
    robot, feet = legged(4)
    (q, v, a), tau, _ = on_its_feet(robot, feet, 150, 1)
    rng, regressor = np.random.default_rng(0), build_regressor(robot, ())
    sigma = rng.uniform(0.1, 10.0, robot.nv)
    noisy = tau + sigma * rng.normal(size=tau.shape)
    contacts = [Contact(frame=foot, touching=np.ones(150, dtype=bool)) for foot in feet]
    moments = projected_moments(regressor, q, v, a, noisy, contacts=contacts, noise=sigma)
    got = moments.pooled()
    U = unknown_directions(Kinematics(robot), q, contacts)
    Y, xx, xy = regressor.evaluate(q, v, a), 0.0, 0.0
    for k in range(150):
        N = np.linalg.svd(U[k])[2][U.shape[1] :].T  # (nv, nv - contacts)
        W = N @ np.linalg.solve(N.T @ np.diag(sigma**2) @ N, N.T)
        xx, xy = xx + Y[k].T @ W @ Y[k], xy + Y[k].T @ W @ noisy[k]
    np.testing.assert_allclose(got.xx, xx, atol=1e-8 * np.abs(xx).max())
    np.testing.assert_allclose(got.xy, xy, atol=1e-8 * np.abs(xy).max())


def test_feet_that_rest_pass_and_feet_that_slide_are_named():
    robot, feet = legged(5, legs=1)
    q, v, _ = random_motion(robot, np.random.default_rng(0), 40)
    kinematics = Kinematics(robot)
    J = kinematics.jacobians(feet[0], q, Axes.WORLD)[:, :3]
    resting = v - np.einsum("nij,nj->ni", np.linalg.pinv(J) @ J, v)
    touching = np.ones(40, dtype=bool)
    check_contacts(kinematics, q, resting, [Contact(frame=feet[0], touching=touching)])
    with pytest.raises(ParameterError, match=r"'foot_0'.*moves at .* m/s .* while it is said to touch"):
        check_contacts(kinematics, q, v, [Contact(frame=feet[0], touching=touching)])
    check_contacts(kinematics, q, v, [Contact(frame=feet[0], touching=~touching)])


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"unmeasured": ["nobody"]}, "no degree of freedom 'nobody'"),
        ({"noise": np.zeros(9)}, "noise must be 9 positive numbers"),
        ({"contacts": [Contact(frame="joint_2", touching=np.ones(3, dtype=bool))]}, "a flag for each of 20 samples"),
        ({"contacts": [Contact(frame="knee", touching=np.ones(20, dtype=bool))]}, "no frame 'knee'"),
        ({"unmeasured": None}, "leave no equation"),
    ],
)
def test_bad_input_is_named(more, message):
    robot, _ = legged(6, legs=1)
    q, v, a = random_motion(robot, np.random.default_rng(0), 20)
    more = {"unmeasured": robot.dofs} if more == {"unmeasured": None} else more
    with pytest.raises(ParameterError, match=message):
        projected_moments(build_regressor(robot), q, v, a, np.zeros_like(v), **more)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Wrench(frame="foot", values=np.zeros((3, 5))), r"finite values \(N, 6\)"),
        (lambda: Wrench(frame="foot", values=np.full((3, 6), np.nan)), r"finite values \(N, 6\)"),
        (lambda: Contact(frame="foot", touching=np.ones(3)), "true or false at every sample"),
    ],
)
def test_what_is_no_wrench_or_contact_is_refused(make, message):
    with pytest.raises(ParameterError, match=message):
        make()

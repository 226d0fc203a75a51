"""Mistakes of sign, unit and order are named; a merely bad model file accuses nobody."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from casysid.dynamics import build_regressor
from casysid.errors import CasysidWarning
from casysid.identification import MistakeKind, Settings, choose_band, find_mistakes, identify
from casysid.identification.mistakes import Column, Mistake
from casysid.identification.mistakes.bodies import body_moments
from casysid.identification.mistakes.gravity import GravityFit, angle_between, gravity_torque
from casysid.identification.mistakes.samples import Samples
from casysid.identification.passes import Passes
from casysid.recording import Recording, read_recording
from casysid.robot import Robot
from casysid.simulation import design_sinusoids
from tests.simulated import bundled_robot

REAL = Path(__file__).parents[3] / "shared" / "data"
RATE, DURATION = 200.0, 10.0
LOGS = {
    "emps": ("emps.urdf", "estimation"),
    "staubli_tx40": ("tx40.urdf", "excitation_9s_joint"),
    "kuka_iiwa14_lasa": ("iiwa14.urdf", "motion_30s"),
    "rokae_xmate3pro": ("xmate3pro.urdf", "excitation_20s"),
    "airbot_play": ("airbot_play.urdf", "chirp"),
    "kuka_kr300": ("kuka_kr300.urdf", "traj_A"),
    "kuka_med7_slow": ("med7.urdf", "measurements"),
    "dfki_double_pendulum": ("design_C1.urdf", "design_C1_143339"),
}


def clean_log(name, seed=0):
    robot = bundled_robot(name)
    time = np.arange(0.0, DURATION, 1 / RATE)
    reference = design_sinusoids(robot, duration=DURATION, seed=seed, band=(0.1, 1.5)).sample(time)
    regressor = build_regressor(robot)
    tau = regressor.predict(regressor.prior, reference.q, reference.v, reference.a)
    rng = np.random.default_rng(seed)
    return Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=time,
        position=reference.channels + 1e-4 * rng.normal(size=reference.channels.shape),
        torque=tau + 0.03 * tau.std(axis=0) * rng.normal(size=tau.shape),
    )


def search(robot, recording):
    """Mistakes in a recording that is read as the identification reads it."""
    passes = Passes(robot, [recording], choose_band([recording]))
    return find_mistakes(robot, passes.sparse_motions, passes.band.cutoff)


def with_wrong_masses(robot, seed):
    """The robot as a file that is 30 % off tells it."""
    factors = np.random.default_rng(seed).uniform(0.7, 1.3, (len(robot.links), 1))
    return robot.with_parameters(inertial_parameters=(robot.inertial_parameters.reshape(-1, 10) * factors).ravel())


def changed(recording, q=lambda q: None, tau=lambda tau: None):
    position, torque = recording.position.copy(), recording.torque.copy()
    q(position)
    tau(torque)
    return dataclasses.replace(recording, position=position, torque=torque)


def negate(column):
    def change(values):
        values[:, column] *= -1

    return change


def swap(first, second):
    def change(values):
        values[:, [first, second]] = values[:, [second, first]]

    return change


def scale(column, factor):
    def change(values):
        values[:, column] *= factor

    return change


def shift(column, offset):
    def change(values):
        values[:, column] += offset

    return change


MISTAKES = [
    (MistakeKind.TORQUE_NEGATED, {"tau": negate(1)}, {1}),
    (MistakeKind.POSITION_NEGATED, {"q": negate(1)}, {1}),
    (MistakeKind.AXIS_NEGATED, {"q": negate(1), "tau": negate(1)}, {1}),
    (MistakeKind.ALL_TORQUES_NEGATED, {"tau": negate(slice(None))}, None),
    (MistakeKind.TORQUES_PERMUTED, {"tau": swap(0, 1)}, {0, 1}),
    (MistakeKind.POSITIONS_PERMUTED, {"q": swap(0, 1)}, {0, 1}),
    (MistakeKind.JOINTS_PERMUTED, {"q": swap(0, 1), "tau": swap(0, 1)}, {0, 1}),
    (MistakeKind.ZERO_SHIFTED, {"q": shift(1, np.pi / 2)}, {1}),
    (MistakeKind.DEGREES, {"q": scale(slice(None), 180 / np.pi)}, None),
    (MistakeKind.SCALE, {"tau": scale(1, 1000.0)}, {1}),
    (MistakeKind.SCALE, {"tau": scale(1, 0.01)}, {1}),
]


@pytest.mark.parametrize("name", ["two_link.urdf", "head.urdf"])
@pytest.mark.parametrize(("kind", "changes", "joints"), MISTAKES)
def test_one_mistake_is_named_with_its_joints_though_the_file_is_wrong(name, kind, changes, joints):
    robot = bundled_robot(name)
    mistakes = search(with_wrong_masses(robot, 1), changed(clean_log(name), **changes))
    assert [mistake.kind for mistake in mistakes] == [kind]
    mistake = mistakes[0]
    wanted = robot.dofs if joints is None else tuple(robot.dofs[k] for k in sorted(joints))
    alternatives = " ".join(mistake.alternatives)
    assert set(wanted) == set(mistake.joints) or all(dof in alternatives for dof in wanted)
    if kind is not MistakeKind.SCALE:
        assert mistake.explained[1] > max(mistake.explained[0], 0.8)


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(["two_link.urdf", "scara.urdf", "head.urdf"]), st.integers(0, 2**32 - 1), st.integers(0, 2))
def test_a_file_whose_masses_are_wrong_accuses_nobody(name, seed, log):
    assert search(with_wrong_masses(bundled_robot(name), seed), clean_log(name, log)) == ()


@pytest.mark.parametrize("turned", [(9.81, 0.0, 0.0), (3.0, -5.0, -7.88)])
def test_a_base_that_stands_otherwise_is_named_with_its_gravity(turned):
    log, file = clean_log("head.urdf"), with_wrong_masses(bundled_robot("head.urdf"), 2)
    standing = dataclasses.replace(file, model=turned_model(file, turned), gravity=np.array(turned))
    (mistake,) = search(standing, log)
    assert mistake.kind is MistakeKind.GRAVITY_TURNED
    assert angle_between(np.array(mistake.gravity), np.array([0.0, 0.0, -9.81])) < 3.0
    assert mistake.amount == pytest.approx(angle_between(np.array(turned), np.array(mistake.gravity)))
    assert mistake.sentence.endswith(f"or try {mistake.option}")
    assert mistake.option.startswith("--gravity ")


@pytest.mark.parametrize(("name", "is_told"), [("two_link.urdf", False), ("arm.urdf", True)])
def test_joints_about_one_axis_do_not_tell_the_direction_of_gravity(name, is_told):
    robot, rng = bundled_robot(name), np.random.default_rng(0)
    position, v, a = rng.uniform(-1.0, 1.0, (3, 300, robot.nv))
    regressor = build_regressor(robot, ())
    tau = regressor.predict(regressor.prior, position, v, a)
    noise = 0.01 * tau.std(axis=0) * rng.normal(size=tau.shape)
    fit = GravityFit(robot, Samples(position, v, a, tau + noise, 300.0))
    assert (fit.direction_error(fit.file) < 3.0) == is_told


def test_torque_without_gravity_is_named():
    robot, log = bundled_robot("head.urdf"), clean_log("head.urdf")
    held = gravity_torque(robot, log.position, robot.gravity)
    (mistake,) = search(with_wrong_masses(robot, 3), dataclasses.replace(log, torque=log.torque - held))
    assert mistake.words.startswith("these torques hold no gravity")
    assert mistake.option == "--gravity 0 0 0"


def turned_model(robot, gravity):
    model = robot.model.copy()
    model.gravity.linear = np.array(gravity)
    return model


def test_gravity_is_linear_and_what_the_regressor_has():
    robot, rng = bundled_robot("head.urdf"), np.random.default_rng(0)
    q, still = rng.uniform(-1.0, 1.0, (5, robot.nq)), np.zeros((5, robot.nv))
    regressor = build_regressor(robot, ())
    held = regressor.predict(regressor.prior, q, still, still)
    np.testing.assert_allclose(gravity_torque(robot, q, robot.gravity), held, atol=1e-12)
    np.testing.assert_allclose(gravity_torque(robot, q, -2.0 * robot.gravity), -2.0 * held, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_any_order_of_the_columns_is_named_with_its_signs(seed):
    robot, log = bundled_robot("head.urdf"), clean_log("head.urdf")
    rng = np.random.default_rng(seed)
    order, sign = rng.permutation(robot.nv), rng.choice([-1.0, 1.0], robot.nv, p=[0.3, 0.7])
    position, torque = np.empty_like(log.position), np.empty_like(log.torque)
    position[:, order], torque[:, order] = log.position * sign, log.torque * sign
    permuted = dataclasses.replace(log, position=position, torque=torque)
    (mistake,) = search(with_wrong_masses(robot, seed), permuted)
    turned = [bool(one < 0.0) for one in sign]
    moved = [k for k in range(robot.nv) if order[k] != k or turned[k]]
    truth = Mistake(
        kind=MistakeKind.JOINTS_PERMUTED,
        joints=tuple(robot.dofs[k] for k in moved),
        order=tuple(Column(robot.dofs[order[k]], turned[k], turned[k]) for k in moved),
    )
    assert truth.words in (mistake.words, *mistake.alternatives)  # the head's two eyes are alike


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_torques_that_are_currents_are_doubted_even_at_rest(factor):
    robot, rng = bundled_robot("arm.urdf"), np.random.default_rng(0)
    regressor = build_regressor(robot)
    q, still = np.tile(rng.uniform(-1.0, 1.0, robot.nq), (400, 1)), np.zeros((400, robot.nv))
    q = q + 1e-5 * rng.normal(size=q.shape)
    tau = factor * regressor.predict(regressor.prior, q, still, still)
    tau += 0.01 * np.abs(tau).max() * rng.normal(size=tau.shape)
    log = Recording(
        channels=robot.channels, dofs=robot.dofs, position=q, velocity=still, acceleration=still, torque=tau
    )
    (mistake,) = search(with_wrong_masses(robot, 0), log)
    assert mistake.kind is MistakeKind.ALL_SCALED
    assert mistake.amount == pytest.approx(factor, rel=0.4)


def test_two_mistakes_are_found_one_after_the_other():
    robot, log = bundled_robot("head.urdf"), clean_log("head.urdf")
    mistakes = search(robot, changed(log, tau=lambda tau: [negate(1)(tau), negate(2)(tau)]))
    assert {(one.kind, one.joints) for one in mistakes} == {
        (MistakeKind.TORQUE_NEGATED, (robot.dofs[1],)),
        (MistakeKind.TORQUE_NEGATED, (robot.dofs[2],)),
    }


def test_samples_without_time_are_searched_as_well():
    robot = bundled_robot("two_link.urdf")
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-1, 1, (3, 400, 2))
    regressor = build_regressor(robot)
    tau = regressor.predict(regressor.prior, q, v, a) * [1, -1]
    log = Recording(channels=robot.channels, dofs=robot.dofs, position=q, velocity=v, acceleration=a, torque=tau)
    (mistake,) = search(robot, log)
    assert mistake.words == f"tau of {robot.dofs[1]} looks negated"


def test_identify_warns_and_takes_a_turned_torque_so():
    robot, log = bundled_robot("two_link.urdf"), changed(clean_log("two_link.urdf"), tau=negate(1))
    with pytest.warns(CasysidWarning, match=f"tau of {robot.dofs[1]} looks negated.*It was taken so"):
        result = identify(robot, log, Settings(cutoff=6.0, delay=0.0))
    assert result.to_json()["mistakes"][0]["kind"] == "torque_negated"
    np.testing.assert_array_equal(result.train_motions[0].tau, log.torque)
    np.testing.assert_array_equal(result.choices.signs, [1.0, -1.0])
    straight = identify(robot, clean_log("two_link.urdf"), Settings(cutoff=6.0, delay=0.0))
    np.testing.assert_allclose(result.parameters, straight.parameters, rtol=1e-6, atol=1e-9)
    assert result.train.relative == pytest.approx(straight.train.relative, rel=1e-6)


def test_identify_warns_and_changes_nothing_else():
    robot, log = bundled_robot("two_link.urdf"), changed(clean_log("two_link.urdf"), q=negate(1))
    with pytest.warns(CasysidWarning, match="Nothing was changed"):
        result = identify(robot, log, Settings(cutoff=6.0, delay=0.0))
    np.testing.assert_array_equal(result.choices.signs, [1.0, 1.0])
    np.testing.assert_array_equal(result.train_motions[0].tau, log.torque)


@pytest.mark.parametrize(
    ("changes", "flip"),
    [
        ({"tau": negate(1)}, "tau_elbow"),
        ({"q": negate(1)}, "q_elbow"),
        ({"q": negate(1), "tau": negate(1)}, "elbow"),
        ({"tau": negate(slice(None))}, "tau"),
    ],
)
def test_a_turned_sign_is_mended_by_what_the_warning_says(changes, flip):
    robot, clean = bundled_robot("two_link.urdf"), clean_log("two_link.urdf")
    (mistake,) = search(robot, changed(clean, **changes))
    assert mistake.flip == flip
    assert mistake.sentence.endswith(f"by --flip {flip}")
    settings = Settings(cutoff=6.0, delay=0.0, flip=(flip,))
    found, wanted = (
        identify(robot, changed(clean, **changes), settings),
        identify(robot, clean, dataclasses.replace(settings, flip=())),
    )
    assert found.mistakes == ()
    np.testing.assert_array_equal(found.parameters, wanted.parameters)
    assert found.to_json()["flip"] == [flip]


@pytest.mark.skipif(not REAL.is_dir(), reason="the real robots' logs are not there")
@pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")  # of their model files
@pytest.mark.parametrize("folder", LOGS)
def test_real_logs_are_not_accused(folder):
    urdf, log = LOGS[folder]
    robot = Robot.from_file(REAL / folder / urdf)
    assert search(robot, read_recording(REAL / folder / f"{log}.csv.gz", robot)) == ()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_friction_that_feeds_energy_explains_nothing(seed):
    robot, rng = bundled_robot("two_link.urdf"), np.random.default_rng(seed)
    position, v, a, tau = rng.normal(size=(4, 60, 2))
    moments = body_moments(robot, Samples(position, v, a, tau, 60.0))
    torque_alone = np.zeros(22 * len(robot.links) + 1)
    torque_alone[-1] = 1.0
    for joint in range(2):
        width = 0.01 * np.sqrt(np.mean(v[:, joint] ** 2)) + 1e-12
        brakes = np.column_stack([v[:, joint], np.tanh(v[:, joint] / width), a[:, joint]])
        y = tau[:, joint] - tau[:, joint].mean()
        brakes -= brakes.mean(axis=0)
        free = y - brakes @ np.linalg.lstsq(brakes, y, rcond=None)[0]
        assert moments.left(torque_alone)[joint] == pytest.approx(np.mean(free**2))
        assert moments.left_by_brakes(torque_alone)[joint] == pytest.approx(nnls(brakes, y)[1] ** 2 / 60)

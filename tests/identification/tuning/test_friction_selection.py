"""Kinds of friction and transmissions chosen by the data, and carried into everything that is written."""

import dataclasses
import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from casysid.cli.identify import identify as identify_verb
from casysid.dynamics import (
    DEFAULT_FRICTION,
    AsymmetricViscous,
    Coupling,
    LoadedCoulomb,
    PowerViscous,
    Spring,
    Stribeck,
    Viscous,
    build_regressor,
    with_width,
)
from casysid.errors import ParameterError
from casysid.identification import Settings, identify
from casysid.identification.friction_laws import broken_laws, friction_laws
from casysid.identification.friction_model import model_from_json, model_to_json
from casysid.identification.output import write_result
from casysid.identification.passes import Passes
from casysid.identification.tuning.band import choose_band
from casysid.identification.tuning.candidates import gather_candidates
from casysid.identification.tuning.friction_selection import select_friction
from casysid.inertia import Consistency
from casysid.recording import Recording
from casysid.report import render_report
from casysid.robot import Robot
from casysid.simulation import design_sinusoids
from casysid.validation import read_earlier_result, validate
from tests.simulated import bundled_robot

RATE, CUTOFF, WIDTH, SEED_NOISE = 200.0, 10.0, 5e-3, 100
SETTINGS = Settings(cutoff=CUTOFF, coulomb_width=WIDTH, choose_friction=True, threads=1)
KINDS = {
    "stribeck": Stribeck(velocity={"shoulder": 0.2}),
    "power_viscous": PowerViscous(exponent={"shoulder": 0.5}),
    "viscous_asymmetry": AsymmetricViscous(("shoulder",)),
    "stiffness": Spring(("shoulder",)),
    "loaded_coulomb": LoadedCoulomb(joints=("shoulder",)),
    "coupling": Coupling(("shoulder", "elbow"), (1.0, -1.0), ("viscous", "coulomb")),
}


def recording(kind=None, seed=0, share=0.15, duration=20.0):
    """A robot's torques with one kind of friction more, a share of the joint's torque, and 2 % of noise."""
    robot = bundled_robot("two_link")
    more = KINDS.get(kind)
    columns = DEFAULT_FRICTION if more is None or kind == "coupling" else (*DEFAULT_FRICTION, more)
    regressor = build_regressor(robot, with_width(columns, WIDTH), [more] if kind == "coupling" else [])
    time = np.arange(int(duration * RATE)) / RATE
    motion = design_sinusoids(robot, duration=duration, seed=seed, band=(0.1, 1.0)).sample(time)
    theta = np.array(regressor.prior)
    theta[[name.endswith((".viscous", ".coulomb")) for name in regressor.names]] = 0.2
    extra = [k for k, name in enumerate(regressor.names) if k >= 28]
    theta[extra] = 0.0
    plain = regressor.predict(theta, motion.q, motion.v, motion.a)
    if extra:
        Y = regressor.evaluate(motion.q, motion.v, motion.a)[:, 0, extra].sum(axis=1)
        theta[extra] = share * plain[:, 0].std() / Y.std()
        theta[regressor.names.index("shoulder.viscous")] = 2.0 * theta[extra[0]] if kind == "viscous_asymmetry" else 0.2
    torque = regressor.predict(theta, motion.q, motion.v, motion.a)
    noise = np.random.default_rng(SEED_NOISE + seed).normal(size=torque.shape)
    return Recording(
        channels=robot.channels,
        dofs=robot.dofs,
        time=time,
        position=motion.channels,
        torque=torque + 0.02 * plain.std(axis=0) * noise,
    )


SPRUNG = recording("stiffness", share=0.6, duration=30.0).split(0.6)


def chosen(recording, settings=SETTINGS):
    """What joins, and the candidates that it was chosen from."""
    passes = Passes(bundled_robot("two_link"), [recording], choose_band([recording], settings.cutoff), threads=1)
    candidates = gather_candidates(passes, settings)
    return select_friction(candidates, settings), candidates


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_that_is_there_is_found(kind):
    choice, candidates = chosen(recording(kind))
    usual = {one.kind for one in candidates.base.friction}
    assert kind in usual or kind in [one.kind for one in choice.chosen], choice.chosen
    assert all("shoulder" in one.joints for one in choice.chosen)
    assert all(one.error_after < one.error_before for one in choice.chosen)
    assert len({proposal.name for proposal, _ in choice.taken}) == len(choice.taken)


@pytest.mark.parametrize("seed", range(3))
def test_plain_friction_stays_plain(seed):
    choice, candidates = chosen(recording(seed=seed))
    assert choice.chosen == ()
    assert choice.asked > 20
    usual = {"friction": candidates.base.friction, "choose_friction": False}
    assert choice.settings == dataclasses.replace(SETTINGS, **usual)


def test_nothing_untrue_is_chosen_through_heavy_noise_of_the_positions():
    clean = recording("stiffness")
    for noise in (1e-6, 1e-2):
        position = clean.position + noise * np.random.default_rng(0).normal(size=clean.position.shape)
        choice, _ = chosen(dataclasses.replace(clean, position=position))
        assert [one.kind for one in choice.chosen] == ["stiffness"]


def test_nothing_that_was_declared_is_proposed_again():
    known = dataclasses.replace(
        SETTINGS,
        friction=(*DEFAULT_FRICTION, Stribeck(velocity=0.2)),
        couplings=(Coupling(("shoulder", "elbow"), (1.0, 1.0)),),
    )
    choice, _ = chosen(recording("coupling"), known)
    assert not {"stribeck", "coupling"} & {one.kind for one in choice.chosen}


def test_a_sign_that_physics_forbids_keeps_a_kind_out():
    choice, _ = chosen(recording("stribeck", share=-0.15))
    assert "stribeck" not in [one.kind for one in choice.chosen]


def test_what_helps_in_one_stretch_alone_stays_out():
    plain, sprung = recording(), recording("stiffness", share=0.6)
    torque = np.array(plain.torque)
    torque[1600:2000] += (sprung.torque - plain.torque)[1600:2000]
    choice, _ = chosen(dataclasses.replace(plain, torque=torque))
    assert "stiffness" not in [one.kind for one in choice.chosen]


@pytest.fixture(scope="module")
def result():
    """An identification that found a spring, with a held-out recording."""
    return identify(bundled_robot("two_link"), SPRUNG[0], SETTINGS, held_out=[SPRUNG[1]])


def test_the_choice_pays_on_unseen_data(result):
    robot, plain = bundled_robot("two_link"), dataclasses.replace(SETTINGS, choose_friction=False)
    without = identify(robot, SPRUNG[0], plain, held_out=[SPRUNG[1]])
    assert result.is_physically_consistent
    assert result.held_out.relative < 0.7 * without.held_out.relative
    assert "stiffness" in result.drive_parameters()["shoulder"]


def test_result_json_rebuilds_the_whole_model(result, tmp_path):
    notes = write_result(result, tmp_path)
    assert any("no place for" in note and "stiffness (shoulder)" in note for note in notes)
    earlier = read_earlier_result(tmp_path / "result.json")
    robot, unseen = Robot.from_file(tmp_path / "identified.urdf"), SPRUNG[1]
    again = validate(robot, [unseen], earlier=earlier)
    assert again.total.relative == pytest.approx(result.held_out.relative, rel=1e-6)
    content = json.loads((tmp_path / "result.json").read_text())["friction_model"]
    assert content["chosen"][0]["joints"] == ["shoulder"]
    assert {"viscous", "coulomb", "stiffness"} <= {column["kind"] for column in content["columns"]}


def test_reports_speak_of_what_was_chosen(result):
    html = render_report(result)
    assert "Choice of friction" in html
    assert "shoulder: spring: held-out error" in result.friction.chosen[0].sentence


def test_the_command_line_says_what_was_chosen(tmp_path):
    app, log = typer.Typer(), tmp_path / "log.csv"
    app.command()(identify_verb)
    recording("stiffness", duration=10.0).write(log)
    words = ["two_link", str(log), "--cutoff", "10", "--friction", "auto", "--out", str(tmp_path / "out")]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0, answer.output
    assert "shoulder: spring: held-out error" in answer.stderr


@pytest.mark.parametrize("kind", KINDS)
def test_a_model_survives_its_json(kind):
    robot, more = bundled_robot("two_link"), KINDS[kind]
    columns = with_width(DEFAULT_FRICTION if kind == "coupling" else (*DEFAULT_FRICTION, more), (0.01, 0.02))
    regressor = build_regressor(robot, columns, [more] if kind == "coupling" else [])
    model = model_from_json(json.loads(json.dumps(model_to_json(regressor))))
    again = build_regressor(robot, model.columns, model.couplings)
    assert again.names == regressor.names
    assert again.couplings == regressor.couplings
    state = np.full((1, 2), 0.3), np.full((1, 2), 0.2), np.ones((1, 2))
    np.testing.assert_array_equal(again.evaluate(*state), regressor.evaluate(*state))


def test_columns_of_ones_own_cannot_be_rebuilt_from_json():
    class Own(Viscous):
        """Viscous friction by another hand."""

    regressor = build_regressor(bundled_robot("two_link"), [Own()])
    with pytest.raises(ParameterError, match=r"'viscous' of class .*Own is none of the kinds"):
        model_from_json(model_to_json(regressor))


def test_friction_drives_no_direction_of_motion():
    regressor = build_regressor(bundled_robot("two_link"), [Viscous(), AsymmetricViscous(("elbow",))])
    assert len(friction_laws(regressor)) == 2
    for asymmetry, broken in ((0.9, 0), (-1.0, 0), (1.1, 1), (-1.1, 1)):
        theta = np.zeros(len(regressor.names))
        theta[20:] = 0.5, 1.0, asymmetry
        assert len(broken_laws(regressor, theta)) == broken


def test_the_answer_keeps_the_law_of_either_direction():
    robot = bundled_robot("two_link")
    friction = (*DEFAULT_FRICTION, AsymmetricViscous(("shoulder",)))
    driven = recording("viscous_asymmetry")
    motion_drives = driven.torque.copy()
    velocity = np.gradient(driven.position[:, 0], driven.time)
    motion_drives[:, 0] += 2.0 * driven.torque[:, 0].std() * np.maximum(velocity, 0.0) * -1.0
    asked = Settings(cutoff=CUTOFF, coulomb_width=WIDTH, friction=friction, consistency=None, threads=1)
    driven = dataclasses.replace(driven, torque=motion_drives)
    free, kept = (
        identify(robot, driven, dataclasses.replace(asked, consistency=one)) for one in (None, Consistency.FULL)
    )
    assert any("either direction" in name for name in free.negative_drive_parameters)
    assert kept.is_physically_consistent

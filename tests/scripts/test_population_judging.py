"""Experiments are judged by the truth: rivals, discoveries, coverage, and what tables make of records."""

import importlib
import io
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from casysid.dynamics import build_regressor
from casysid.identification import Settings

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture(scope="module")
def load():
    """Modules of the scripts' folder by name."""
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def experiment(load):
    """Two joints, viscous friction that differs by direction, nothing wrong with the log."""
    drawn = load("population.experiments").draw_experiment(1)
    assert drawn.truth.effects == ("asymmetry",)
    assert not drawn.faults.names
    return drawn


def exact_answer(load, experiment, shift: float = 0.0, std: float = 1.0):
    """An answer with the truth in casysid's own columns, off by so many of its standard errors."""
    from casysid.dynamics import DEFAULT_FRICTION, AsymmetricViscous
    from casysid.identifiability import structural_base_parameters

    regressor = build_regressor(experiment.file, (*DEFAULT_FRICTION, AsymmetricViscous()))
    names = tuple((parameter.owner, parameter.kind) for parameter in regressor.parameters)
    blank = SimpleNamespace(names=names)
    truth = load("population.coverage").true_parameters(experiment, blank)
    base = structural_base_parameters(regressor).transform
    inverse = np.linalg.pinv(base)
    away = inverse @ np.full(len(base), shift * std)
    return load("population.candidate").Answer(
        torque=lambda q, v, a: experiment.fresh_torque + shift * std,
        effects=(),
        clock=1.0,
        delay=np.zeros(experiment.file.nv),
        gains=None,
        negated=(),
        other_mistakes=(),
        quasi_static=False,
        names=names,
        parameters=truth + away,
        covariance=std**2 * inverse @ inverse.T,
        std=np.full(len(truth), np.inf),
        base=base,
        torque_std=lambda q, v, a: np.full(q.shape, std),
        seconds=0.0,
    )


def test_true_parameters_make_the_true_torque_through_casysids_regressor(load, experiment) -> None:
    from casysid.dynamics import DEFAULT_FRICTION, AsymmetricViscous, Coulomb

    widths = {j: term.width for term in experiment.truth.terms if term.kind == "coulomb" for j in term.joints}
    width = tuple(widths.get(j, 1.0) for j in range(experiment.file.nv))
    friction = tuple(Coulomb(width) if isinstance(one, Coulomb) else one for one in DEFAULT_FRICTION)
    regressor = build_regressor(experiment.file, (*friction, AsymmetricViscous()))
    names = tuple((parameter.owner, parameter.kind) for parameter in regressor.parameters)
    truth = load("population.coverage").true_parameters(experiment, SimpleNamespace(names=names))
    np.testing.assert_allclose(regressor.predict(truth, *experiment.fresh), experiment.fresh_torque, atol=1e-9)


@pytest.mark.parametrize(("shift", "inside"), [(0.0, True), (1.9, True), (2.1, False)])
def test_intervals_hold_what_is_within_two_standard_errors(load, experiment, shift: float, inside: bool) -> None:
    counts = load("population.coverage").intervals(experiment, exact_answer(load, experiment, shift))
    assert counts["base"][1] > 10.0
    assert counts["base"][0] == (counts["base"][1] if inside else 0.0)
    assert counts["torque"] == [float(inside), 1.0]


def test_the_rival_that_knows_everything_is_nearly_exact_without_noise_and_better_than_the_other(load) -> None:
    experiments, rivals = load("population.experiments"), load("population.rivals")
    quiet = experiments.draw_frictionless(1, 0.0)
    assert rivals.best_fit(quiet, told=True).error < 2e-3
    assert rivals.best_fit(quiet, told=True, filtered=True).error < 2e-3
    drawn = experiments.draw_experiment(3)
    assert rivals.best_fit(drawn, told=True).error < 0.3 * rivals.best_fit(drawn, told=False).error


def test_a_rival_that_is_told_takes_clock_delay_gain_and_sign_out_of_the_log(load) -> None:
    experiments, sensors, rivals = (load(f"population.{name}") for name in ("experiments", "sensors", "rivals"))
    quiet = experiments.draw_frictionless(1, 0.0)
    joints = quiet.mechanism.robot.nv
    faults = sensors.Faults(2.0, np.full(joints, 0.013), np.linspace(0.8, 1.3, joints), -np.ones(joints))
    log = sensors.Logged(quiet.logged.motion, quiet.sampling, quiet.logged.sensors, faults)
    broken = experiments.Experiment(
        **{
            **vars(quiet),
            "logged": log,
            "recording": sensors.record(np.random.default_rng(0), quiet.file, quiet.truth, log),
            "fresh_torque": quiet.fresh_torque * faults.scale,
        }
    )
    assert rivals.best_fit(broken, told=True).error < 5e-3
    assert rivals.best_fit(broken, told=False).error > 0.05


def test_distance_is_to_the_nearest_end_or_gap(load) -> None:
    t = np.r_[0.0, 1.0, 2.0, 3.0, 10.0, 11.0, 12.0]
    found = load("population.rivals")._distance(t, np.array([0.0, 1.5, 3.0, 5.0, 10.5, 12.0]), 5.0)
    np.testing.assert_allclose(found, [0.0, 1.5, 0.0, 0.0, 0.5, 0.0])


def test_what_was_claimed_is_true_or_false_by_joint(load, experiment) -> None:
    import dataclasses

    scoring = load("population.scoring")
    (joint, *_) = sorted(j for _, j in scoring.effect_sizes(experiment))
    claims = (("asymmetry", joint), ("stribeck", 0), ("power_viscous", 1))
    answer = dataclasses.replace(
        exact_answer(load, experiment), effects=claims, clock=2.0, negated=(0,), gains=np.ones(experiment.file.nv)
    )
    found = scoring.discoveries(experiment, answer)
    assert [one["found"] for one in found["true"] if one["joint"] == joint] == [True]
    assert sorted(found["false"]) == ["power_viscous", "stribeck"]
    claimed = {name for name, one in found["faults"].items() if one["claimed"]}
    assert claimed == {"clock", "gains", "sign"}
    assert not any(one["true"] or one["found"] for one in found["faults"].values() if one["claimed"])


def test_an_answer_is_read_from_the_result_or_from_its_choices(load) -> None:
    candidate, robot = load("population.candidate"), SimpleNamespace(nv=2, dofs=("a", "b"))
    chosen = (SimpleNamespace(kind="coupling", joints=("a", "b")), SimpleNamespace(kind="power_viscous", joints=("b",)))
    negated = SimpleNamespace(kind=SimpleNamespace(name="TORQUE_NEGATED"), joints=("b",), words="")
    found = {
        "time_base": SimpleNamespace(scale=2.0, quasi_static=False),
        "delay": SimpleNamespace(seconds=np.array([0.0, 0.01])),
        "friction": SimpleNamespace(chosen=chosen),
        "torque_gains": SimpleNamespace(found=True, values=(0.9, 1.1)),
        "mistakes": (negated,),
    }
    empty = SimpleNamespace(rank=1, transform=np.eye(1))
    rest = {
        "regressor": SimpleNamespace(parameters=(SimpleNamespace(owner="a", kind="viscous"),)),
        "uncertainty": SimpleNamespace(covariance=np.eye(1), std=np.ones(1)),
        "parameters": np.ones(1),
        "structural": empty,
        "excited": empty,
    }
    flat = candidate.read_answer(robot, SimpleNamespace(**found, **rest))
    nested = candidate.read_answer(robot, SimpleNamespace(choices=SimpleNamespace(**found), **rest))
    for answer in (flat, nested):
        assert answer.effects == (("wrist", 0), ("wrist", 1), ("power_viscous", 1))
        assert (answer.clock, answer.negated, answer.quasi_static) == (2.0, (1,), False)
        np.testing.assert_allclose(answer.delay, [0.0, 0.01])
        np.testing.assert_allclose(answer.gains, [0.9, 1.1])
    nothing = candidate.read_answer(robot, SimpleNamespace(**rest))
    assert (nothing.effects, nothing.clock, nothing.gains, nothing.delay.any()) == ((), 1.0, None, False)


def test_a_real_answer_predicts_the_fresh_motion(load) -> None:
    drawn = load("population.experiments").draw_frictionless(1, 0.01)
    settings = Settings(cutoff=10.0, delay=0.0, choose_friction=False, coulomb_width=0.01)
    answer = load("population.candidate").ask(drawn.file, drawn.recording, settings)
    assert load("population.rivals").relative_error(answer.torque(*drawn.fresh), drawn.fresh_torque) < 0.02
    counts = load("population.coverage").intervals(drawn, answer)
    assert 0.5 * counts["base"][1] < counts["base"][0] <= counts["base"][1]


def test_rivals_are_taken_from_an_earlier_record_of_the_same_experiment_only(load, monkeypatch) -> None:
    scoring, drawn = load("population.scoring"), load("population.experiments").draw_frictionless(1, 0.01)
    other = load("population.experiments").draw_frictionless(1, 0.02)

    def fail(*_: object) -> None:
        raise KeyError("no answer")

    monkeypatch.setattr(scoring, "ask", fail)
    first = scoring.judged(drawn)
    assert first["failure"] == "KeyError: 'no answer'"
    assert "error" not in first
    changed = first | {"told": 123.0}
    assert scoring.judged(drawn, changed)["told"] == 123.0
    assert scoring.judged(other, changed)["told"] < 1.0


def record(seed: int, error: float | None, **other: object) -> dict:
    """A record as judging makes it."""
    blank = {
        "seed": seed, "joints": 2, "motion": "chirp", "rests": False, "friction": "ordinary", "effects": [],
        "file": "units", "faults": [], "sampling": [], "rate": 100.0, "duration": 9.0, "contained": True,
        "told": 0.1, "told_filtered": 0.05, "untold": 0.2, "seconds": 1.0,
    }  # fmt: skip
    return blank | ({"failure": "KeyError: 'x'"} if error is None else {"error": error}) | other


def test_tables_count_failures_as_ratios_of_ten_and_show_the_worst(load) -> None:
    from rich.console import Console

    table = load("population.table")
    records = [record(0, 0.1), record(1, 0.4, motion="designed"), record(2, None)]
    figures = table.summary(records)
    assert (figures["told: median"], figures["mean"]) == (4.0, pytest.approx(40.0 ** (1 / 3)))
    console = Console(record=True, width=200, file=io.StringIO())
    table.show(records, console)
    text = console.export_text()
    assert "1 failures in 3 experiments" in text
    assert "KeyError" in text
    assert "motion: designed" in text


def test_discoveries_are_counted_by_experiment_when_false_and_by_joint_when_true(load) -> None:
    table = load("population.table")
    none = {"true": False, "found": False, "claimed": False}
    faults = dict.fromkeys(table.FAULTS, none)
    blank = {"quasi_static": False, "complaints": [], "faults": faults}
    effect = {"effect": "ripple", "joint": 0, "share": 0.2, "unexplained": 0.01}
    found = [
        {"true": [effect | {"found": True}, effect | {"found": False, "unexplained": 0.1}], "false": [], **blank},
        {"true": [effect | {"found": True, "share": 0.01}], "false": ["stribeck", "stribeck", "stiffness"], **blank},
    ]
    rows = table.discoveries([record(k, 0.1, found=one) for k, one in enumerate(found)])
    assert (rows["stribeck"]["false"], rows["stiffness"]["false"], rows["ripple"]["false"]) == (0.5, 0.5, 0.0)
    assert (rows["ripple"]["true"], rows["ripple"]["found"]) == (2, 0.5)
    assert rows["ripple"]["found, not by ordinary friction"] == 0.0


def test_coverage_takes_designed_motion_apart(load) -> None:
    counts = {"base": [9.0, 10.0], "mass": [0.0, 0.0], "torque": [0.5, 1.0]}
    rows = load("population.table").coverage(
        [record(0, 0.1, coverage=counts), record(1, 0.1, motion="designed", coverage=counts | {"base": [1.0, 10.0]})]
    )
    assert rows["all friction, random motion"]["base"] == 0.9
    assert rows["all friction, designed motion"]["base"] == 0.1
    assert np.isnan(rows["all friction, random motion"]["mass"])


def test_seeds_are_a_range_with_both_ends(load) -> None:
    seeds_of = load("benchmark_population").seeds_of
    assert (seeds_of("17-19"), seeds_of("4")) == (range(17, 20), range(4, 5))
    with pytest.raises(Exception, match="such as 0-99"):
        seeds_of("9-3")

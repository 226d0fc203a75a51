"""What is accepted may be used by a controller; nothing else is accepted."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from casysid.identification import Settings, identify
from casysid.identification.verdict import Criterion, Verdict, Word, judge
from tests.simulated import bundled_robot, simulated_run

QUICK = Settings(cutoff=12.0, delay=0.0, time_scale=1.0, choose_friction=False)
WORDS = (Word.ACCEPTED, Word.DOUBTFUL, Word.REJECTED)


def criterion(value, word, limit=1.0):
    return Criterion(name="a", value=value, limit=limit, word=word, reason=f"{word.value} at {value}", origin="here")


criteria = st.lists(
    st.builds(criterion, st.floats(0.0, 2.0) | st.just(math.nan), st.sampled_from(WORDS[1:])), max_size=8
)


@given(criteria)
def test_the_worst_broken_limit_is_the_word(several):
    verdict = Verdict(tuple(several))
    broken = [WORDS.index(one.word) for one in several if not one.value <= one.limit]
    assert WORDS.index(verdict.word) == max(broken, default=0)
    assert bool(verdict.reasons) == (not verdict.accepted)
    assert set(verdict.reasons) == {one.reason for one in several if not one.met}


@given(criteria, criteria)
def test_looking_at_more_never_makes_it_better(some, more):
    assert WORDS.index(Verdict((*some, *more)).word) >= WORDS.index(Verdict(tuple(some)).word)


def test_every_word_has_an_exit_code_of_its_own():
    assert [word.exit_code for word in WORDS] == [0, 3, 4]


@pytest.fixture(scope="module")
def log():
    return simulated_run("two_link.urdf", 0).recording


def found(train, held_out=()):
    return identify(bundled_robot("two_link.urdf"), train, QUICK, held_out=held_out)


def test_a_good_log_is_accepted_with_and_without_held_out_data(log):
    train, test = log.split(0.6)
    assert judge(found(train, [test])).accepted
    alone = judge(found(log))
    assert alone.accepted
    assert any("blocks of time that are predicted from the others stand in" in remark for remark in alone.remarks)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")
def test_random_torque_is_never_accepted(log, seed):
    rng = np.random.default_rng(seed)
    size = log.torque.std(axis=0)
    noise = dataclasses.replace(log, torque=log.torque.mean(axis=0) + size * rng.normal(size=log.torque.shape))
    train, test = noise.split(0.6)
    assert judge(found(train, [test])).word is Word.REJECTED
    assert judge(found(noise)).word is Word.REJECTED


@pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")
def test_a_joint_without_torque_is_set_aside_and_makes_no_gain(log):
    robot, torque = bundled_robot("two_link.urdf"), np.array(log.torque)
    torque[:, 1] = 0.0
    silent = dataclasses.replace(log, torque=torque)
    result = found(silent)
    verdict = judge(result)
    assert verdict.set_aside == (robot.dofs[1],)
    assert verdict.word is not Word.ACCEPTED
    np.testing.assert_array_equal(result.torque_gains.values, 1.0)


def test_criteria_are_told_with_their_limits(log):
    content = judge(found(log)).to_json()
    assert content["word"] == "accepted"
    for one in content["criteria"]:
        assert one["name"]
        assert one["origin"]
        assert one["met"]

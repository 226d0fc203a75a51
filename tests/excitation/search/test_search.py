import dataclasses

import numpy as np
import pytest

from casysid.bundled import find_model
from casysid.excitation import DOptimal, FourierSeries, build_excitation, design_excitation, verify
from casysid.excitation.search.constraint_sampling import NearLimits, busy_constraints, on_grid
from casysid.excitation.search.program import Evaluation
from casysid.excitation.search.recombination import mixtures
from casysid.robot import Robot

SERIES = FourierSeries(5.0, 3)


@pytest.fixture(scope="module")
def problem():
    return build_excitation(Robot.from_file(find_model("two_link")), series=SERIES, rate=200.0)


@pytest.fixture(scope="module")
def design(problem):
    return design_excitation(problem, starts=4)


def motions(problem, count, size=0.1):
    rng = np.random.default_rng(2)
    return list(size * rng.normal(size=(count, Evaluation(problem, []).variables)))


def test_where_a_motion_is_near_a_limit_or_beyond_it_the_limit_is_watched_at_the_instants_of_the_check(problem):
    x = motions(problem, 1, 0.5)[0]
    worst = verify(problem, problem.trajectory(x)).violations
    assert worst
    near = NearLimits(problem, problem.constraints)
    first, second = near.see(x), near.see(0.01 * x)
    for margin in worst:
        instants = [
            one.time for one in first if margin.label in one.constraint.labels and one.constraint.kind == margin.kind
        ]
        assert min(np.abs(time - margin.instant).min() for time in instants) < 1e-12
    assert all(set(one.time) <= set(two.time) for one, two in zip(first, second, strict=True))


def test_joints_are_watched_one_by_one_and_less_often_than_on_the_grid_of_the_check(problem):
    watched = NearLimits(problem, problem.constraints).see(motions(problem, 1, 0.01)[0])
    parts = [one for one in watched if one.constraint.kind == "velocity"]
    assert [one.constraint.labels for one in parts] == [("joint 'shoulder'",), ("joint 'elbow'",)]
    assert all(len(one.time) < len(on_grid(problem)[0].time) for one in parts)


def test_torque_is_left_out_where_motions_take_little_of_it(problem):
    block = next(one for one in problem.constraints if one.kind == "torque")
    motion = motions(problem, 1)[0]
    peak = np.abs(block.measure(problem.trajectory(motion).motion(SERIES.grid(problem.samples)))).max(axis=0)
    for share, wanted in (([0.5, 0.3], ("joint 'shoulder'",)), ([0.3, 0.3], ()), ([0.5, 0.5], block.labels)):
        limited = dataclasses.replace(
            problem, constraints=(dataclasses.replace(block, limit=peak / share, _mapped={}),)
        )
        watched = [label for one in busy_constraints(limited, [0.1 * motion, motion]) for label in one.labels]
        assert watched == list(wanted)


def test_a_mixture_takes_each_joint_from_one_motion_perhaps_mirrored_or_backwards(problem):
    parents = motions(problem, 3)
    middle = problem.limits.middle / problem.limits.half_range
    best = mixtures(problem, Evaluation(problem), parents, np.random.default_rng(0), 5)
    assert len(best) == 5
    for child in best:
        for joint, row in enumerate(child.reshape(2, -1)):
            seen = []
            for parent in parents:
                there = parent.reshape(2, -1)[joint]
                mirrored = np.concatenate([[2 * middle[joint] - there[0]], -there[1:]])
                for one in (there, mirrored):
                    back = one.copy()
                    back[1:3] *= -1.0
                    seen += [one, back]
            assert min(np.abs(row - one).max() for one in seen) < 1e-12


def test_mixtures_come_best_first(problem):
    every = Evaluation(problem.judged_by(DOptimal()))
    best = mixtures(problem, every, motions(problem, 3, 0.02), np.random.default_rng(0), 20)
    values = [every.objective(x) for x in best]
    assert values == sorted(values)


def test_a_polished_motion_uses_its_limits_up(design, problem):
    shares = [margin.share for margin in design.check().tightest]
    assert 0.0 < min(shares) < 2.0 * problem.tightening
    assert design.shrink > 0.999

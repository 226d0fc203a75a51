import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.accumulation import accumulate_moments
from casysid.bundled import find_model
from casysid.dynamics import Coupling, build_regressor
from casysid.errors import ParameterError, SolverError
from casysid.excitation import (
    ConditionNumber,
    DesignStatus,
    DOptimal,
    FourierSeries,
    HalfSpace,
    after_recordings,
    after_result,
    build_excitation,
    describe,
    design_excitation,
    design_set,
    information_groups,
    limits_of,
    torque_accuracy,
    write_excitation,
)
from casysid.excitation.design.summary import expected_std
from casysid.excitation.playing.files import sample_recording
from casysid.moments import Moments
from casysid.moments_file import write_moments
from casysid.recording import read_recording
from casysid.report.excitation_pictures import write_excitation_pictures
from casysid.robot import JointKind, Robot
from casysid.signals import motion_from_recording
from tests.strategies import random_robot

SERIES = FourierSeries(5.0, 3)
SINGLE = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


@pytest.fixture(scope="module")
def two_link():
    return Robot.from_file(find_model("two_link"))


@pytest.fixture(scope="module")
def problem(two_link):
    floor = HalfSpace("floor", np.array([0.0, 0.0, 1.0]), 0.1)
    return build_excitation(two_link, series=SERIES, obstacles=[floor], rate=200.0)


@pytest.fixture(scope="module")
def design(problem):
    return design_excitation(problem, starts=2)


def test_the_design_converges_and_keeps_every_limit_between_the_instants_it_was_made_at(design):
    assert design.status is DesignStatus.CONVERGED
    for samples in (None, 997, 5000):
        assert design.check(samples).passed
    assert {margin.kind for margin in design.check().tightest} == {"position", "velocity", "torque", "distance"}
    assert all(report.objective < report.first for report in design.starts[:2])


def test_the_design_tells_more_than_random_motions_do(design, problem):
    from casysid.excitation.search.initial import find_standing, random_start
    from casysid.excitation.search.program import Evaluation

    evaluation, rng = Evaluation(problem), np.random.default_rng(5)
    standing = find_standing(problem, 0)
    random = [random_start(problem, evaluation, standing, rng) for _ in range(30)]
    gained = [problem.gained(problem.trajectory(x)) for x in random if x is not None]
    assert len(gained) > 20
    assert design.log_det > max(np.linalg.slogdet(F)[1] for F in gained) + 1.0
    assert design.condition_number < min(np.linalg.cond(F) for F in gained)


def test_the_motion_is_at_rest_at_both_ends(design):
    motion = design.trajectory.motion([0.0, design.trajectory.duration])
    np.testing.assert_allclose(motion.velocity, 0.0, atol=1e-9)
    np.testing.assert_allclose(motion.acceleration, 0.0, atol=1e-8)


def test_the_same_seed_gives_the_same_design(design, problem):
    again = design_excitation(problem, starts=2)
    np.testing.assert_array_equal(again.trajectory.coordinates, design.trajectory.coordinates)


def test_a_start_that_is_given_is_kept(two_link):
    problem = build_excitation(two_link, series=SERIES, start=[0.3, -0.5])
    design = design_excitation(problem, starts=2)
    np.testing.assert_allclose(design.trajectory.start, [0.3, -0.5], atol=1e-9)
    assert design.check().passed


def test_acceleration_and_jerk_are_kept_where_given(two_link):
    limits = limits_of(two_link, acceleration=8.0, jerk=[40.0, 60.0])
    design = design_excitation(build_excitation(two_link, series=SERIES, limits=limits), starts=1)
    motion = design.trajectory.motion(np.linspace(0.0, 5.0, 4001))
    assert np.abs(motion.acceleration).max() <= 8.0
    assert (np.abs(motion.jerk).max(axis=0) <= [40.0, 60.0]).all()


def test_each_criterion_is_best_at_what_it_looks_at(problem, design):
    conditioned = design_excitation(problem.judged_by(ConditionNumber()), starts=2)
    largest = design_excitation(problem.judged_by(DOptimal()), starts=2)
    assert conditioned.condition_number < design.condition_number < largest.condition_number
    assert largest.log_det > conditioned.log_det
    assert largest.log_det - 0.1 * problem.information.size < design.log_det < largest.log_det + 0.1
    criterion = torque_accuracy(problem)
    accurate = design_excitation(problem.judged_by(criterion), starts=2)
    assert criterion.evaluate(accurate.information)[0] <= criterion.evaluate(design.information)[0] + 0.02
    assert conditioned.check().passed
    assert accurate.check().passed


def test_a_set_complements_itself(problem):
    first, second = design_set(problem, 2, starts=1)
    np.testing.assert_allclose(second.problem.known, first.gained)
    doubled = np.linalg.slogdet(2.0 * first.gained)[1]
    assert second.log_det >= doubled - 0.5
    np.testing.assert_array_equal(second.trajectory.start, first.trajectory.start)
    np.testing.assert_allclose(second.information, first.gained + second.gained)


def test_earlier_recordings_count_as_what_they_tell(problem, design):
    recording = sample_recording(design, problem.rate)
    informed = after_recordings(problem, [recording], cutoff=20.0)
    inner = np.linalg.eigvals(np.linalg.solve(design.gained, informed.known)).real
    assert 0.8 < inner.min() <= inner.max() < 1.25
    with pytest.raises(ParameterError, match="at least one earlier recording"):
        after_recordings(problem, [])
    with pytest.raises(ParameterError, match="known information must be finite and of shape"):
        problem.knowing_gram(np.eye(3))


def test_an_identification_counts_as_what_its_recordings_tell(problem, design, tmp_path):
    recording, regressor = sample_recording(design, problem.rate), problem.information.regressor
    motion = motion_from_recording(problem.robot, recording, 20.0)
    moments = accumulate_moments(regressor, motion.q, motion.v, motion.a, motion.tau, blocks=3)
    pairs = tuple(squares / 2.0 for squares in moments.squares)
    halved = dataclasses.replace(moments, squares=pairs, count=moments.count / 2.0)  # as averages of pairs
    write_moments(halved, tmp_path / "moments.npz")
    (tmp_path / "result.json").write_text(json.dumps({"samples": {"train": len(recording)}}))
    wanted = after_recordings(problem, [recording], cutoff=20.0).known
    for path in (tmp_path, tmp_path / "result.json"):
        np.testing.assert_allclose(after_result(problem, path).known, wanted, rtol=1e-9, atol=1e-9 * wanted.max())


def test_friction_that_only_the_identification_has_counts_as_unknown(problem, design, tmp_path):
    recording, regressor = sample_recording(design, problem.rate), problem.information.regressor
    motion, coupling = motion_from_recording(problem.robot, recording, 20.0), Coupling(problem.robot.dofs, (1.0, 1.0))
    richer = build_regressor(problem.robot, regressor.friction, [coupling])
    moments = accumulate_moments(richer, motion.q, motion.v, motion.a, motion.tau, blocks=1)
    write_moments(moments, tmp_path / "moments.npz")
    (tmp_path / "result.json").write_text(json.dumps({"samples": {"train": len(recording)}}))
    rows = richer.evaluate(motion.q, motion.v, motion.a) / problem.information.noise_std[:, None]
    own = np.isin(richer.names, regressor.names)
    wanted, others = (rows.reshape(-1, len(own))[:, chosen] for chosen in (own, ~own))
    assert others.shape[1] > 0
    left = wanted - others @ np.linalg.lstsq(others, wanted)[0]
    known = problem.knowing_gram(left.T @ left).known
    np.testing.assert_allclose(after_result(problem, tmp_path).known, known, rtol=1e-9, atol=1e-9 * known.max())


def test_another_robots_identification_is_refused(problem, tmp_path):
    with pytest.raises(ParameterError, match=r"moments\.npz: there is no such file"):
        after_result(problem, tmp_path)
    regressor = problem.information.regressor
    sums = np.zeros((1, problem.robot.nv, len(regressor.names) + 1, len(regressor.names) + 1))
    write_moments(
        Moments.from_dense(sums, sums[:, :, 0, 0], regressor.names, ("left", "right")), tmp_path / "moments.npz"
    )
    with pytest.raises(ParameterError, match="other joints or columns"):
        after_result(problem, tmp_path)
    write_moments(
        Moments.from_dense(sums, sums[:, :, 0, 0], regressor.names, problem.robot.dofs), tmp_path / "moments.npz"
    )
    (tmp_path / "result.json").write_text("{}")
    with pytest.raises(ParameterError, match=r"no result\.json as casysid identify writes it"):
        after_result(problem, tmp_path)


@pytest.mark.parametrize("interrupt", [False, True])
def test_an_early_end_returns_the_best_so_far(problem, interrupt):
    steps = []

    def stop(step):
        steps.append(step)
        if len(steps) > 8 and interrupt:
            raise KeyboardInterrupt
        return len(steps) > 8

    design = design_excitation(problem, starts=2, progress=stop)
    assert design.status is DesignStatus.INTERRUPTED
    assert design.check().passed
    assert steps[-1].step > 0
    assert design.log_det > -steps[0].objective


def test_too_few_iterations_are_not_called_convergence(problem):
    design = design_excitation(problem, starts=1, max_iterations=3)
    assert design.status is DesignStatus.UNFINISHED
    assert design.check().passed
    with pytest.raises(ParameterError, match="must be positive"):
        design_excitation(problem, starts=0)
    with pytest.raises(ParameterError, match="at least one trajectory"):
        design_set(problem, 0)


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_random_trees_get_motions_within_their_limits(seed):
    rng = np.random.default_rng(seed)
    kinds = [SINGLE[k] for k in rng.integers(3, size=3)]
    robot = random_robot(rng, kinds, rng.integers(0, 2, size=3).tolist())
    problem = build_excitation(robot, series=SERIES)
    design = design_excitation(problem, starts=1, max_iterations=60)
    assert design.check(2000).passed


def test_what_is_written_is_read_back(tmp_path, design, two_link):
    files = write_excitation(design, tmp_path / "out")
    pictures = write_excitation_pictures(design, tmp_path / "out")
    assert {path.name for path in (*files, *pictures)} == {path.name for path in (tmp_path / "out").iterdir()}
    recording = read_recording(files[0], two_link)
    assert recording.rate == pytest.approx(200.0)
    assert recording.duration == pytest.approx(design.trajectory.duration)
    motion = design.trajectory.motion(recording.time)
    np.testing.assert_allclose(recording.position, motion.position, atol=1e-12)
    np.testing.assert_allclose(recording.acceleration, motion.acceleration, atol=1e-12)
    assert (np.abs(recording.torque).max(axis=0) <= design.problem.limits.torque).all()


def test_coefficients_make_the_motion_again(tmp_path, design):
    numbers = json.loads(write_excitation(design, tmp_path)[1].read_text())
    t = np.linspace(0.0, 5.0, 11)
    motion = design.trajectory.motion(t)
    for k, joint in enumerate(numbers["joints"].values()):
        angle = 2 * np.pi * np.multiply.outer(t, 1.0 + np.arange(numbers["harmonics"])) / numbers["period"]
        q = joint["offset"] + np.sin(angle) @ joint["sine"] + np.cos(angle) @ joint["cosine"]
        np.testing.assert_allclose(q, motion.position[:, k], atol=1e-9)


def test_the_ros_message_has_the_same_motion(tmp_path, design):
    text = write_excitation(design, tmp_path)[2].read_text()
    lines = text.splitlines()
    assert lines[0] == 'joint_names: ["shoulder", "elbow"]'
    last = [line for line in lines if "positions" in line][-1]
    np.testing.assert_allclose(json.loads(last.split(":")[1]), design.trajectory.start, atol=1e-8)
    assert lines[-1].strip() == "time_from_start: {sec: 5, nanosec: 0}"


def test_a_motion_beyond_its_limits_is_never_written(tmp_path, design):
    larger = dataclasses.replace(design.trajectory, coordinates=1.5 * design.trajectory.coordinates)
    with pytest.raises(SolverError, match=r"not written.*worst: \w+ of (joint|link).* at .* s: wanted .*too far"):
        write_excitation(dataclasses.replace(design, trajectory=larger), tmp_path / "none")
    assert not (tmp_path / "none").exists()
    with pytest.raises(ParameterError, match="rate must be a positive"):
        write_excitation(design, tmp_path / "none", rate=0.0)


def test_words_name_what_no_motion_can_tell(design):
    text = "\n".join(describe(design))
    assert "Never, whatever the motion: upper_link.m," in text
    assert "Only in combination with others:" in text
    assert "every limit is kept" in text


def test_expected_accuracy_is_that_of_the_information(design):
    info = design.problem.information
    wanted = np.sqrt(np.diag(np.linalg.inv(design.information))) * info.scale
    np.testing.assert_allclose(expected_std(design), wanted, rtol=1e-3)
    groups = information_groups(design)
    assert all(np.isinf(group.before) and 0.0 < group.after < 1.0 for group in groups)

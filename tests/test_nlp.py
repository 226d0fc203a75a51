"""IPOPT behind one door: right answers, honest failures, and a way out."""

import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from casysid.errors import ParameterError, SolverError
from casysid.nlp import HessianKind, NlpSettings, NlpStatus, build_nlp, solve_nlp


def rosenbrock(size=5, **settings):
    x, p = ca.SX.sym("x", size), ca.SX.sym("p")
    f = sum(100 * (x[i + 1] - x[i] ** 2) ** 2 + (p - x[i]) ** 2 for i in range(size - 1))
    return build_nlp(x, f, parameters=p, constraints=ca.sum1(x), settings=NlpSettings(**settings))


@pytest.mark.parametrize("hessian", HessianKind)
def test_the_optimum_is_found_with_either_hessian(hessian):
    solution = solve_nlp(rosenbrock(hessian=hessian), np.full(5, -1.0), parameters=[1.0])
    assert solution.status is NlpStatus.CONVERGED
    assert solution.success
    np.testing.assert_allclose(solution.variables, 1.0, atol=1e-5)
    assert solution.iterations > 0
    assert solution.seconds > 0


def test_one_program_is_solved_for_many_parameters():
    program = rosenbrock(size=2)
    for value in (0.5, 1.0, 2.0):
        solution = solve_nlp(program, [0.0, 0.0], parameters=[value])
        np.testing.assert_allclose(solution.variables, [value, value**2], atol=1e-5)


def test_bounds_and_constraints_are_respected_and_have_multipliers():
    x = ca.SX.sym("x", 2)
    program = build_nlp(x, ca.sumsqr(x - 3), constraints=x[0] + 2 * x[1])
    solution = solve_nlp(program, [0.0, 0.0], upper=[1.0, np.inf], constraint_upper=3.0)
    np.testing.assert_allclose(solution.variables, [1.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(solution.constraints, [3.0], atol=1e-6)
    assert solution.infeasibility < 1e-7
    assert solution.constraint_multipliers[0] > 1.0


def test_a_warm_start_needs_fewer_iterations_and_finds_the_same():
    program = rosenbrock()
    cold = solve_nlp(program, np.full(5, -1.0), parameters=[1.0], lower=-0.5, upper=0.8)
    warm = solve_nlp(program, cold.variables, parameters=[1.0], lower=-0.5, upper=0.8, warm=cold)
    assert warm.success
    assert warm.iterations < cold.iterations / 2
    np.testing.assert_allclose(warm.variables, cold.variables, atol=1e-5)


def test_too_few_iterations_do_not_look_like_success():
    solution = solve_nlp(rosenbrock(max_iterations=2), np.full(5, -1.0), parameters=[1.0])
    assert solution.status is NlpStatus.MAX_ITERATIONS
    assert not solution.success


def test_contradicting_constraints_are_infeasible():
    x = ca.SX.sym("x")
    solution = solve_nlp(build_nlp(x, x**2, constraints=x**2), [1.0], constraint_upper=-1.0)
    assert solution.status is NlpStatus.INFEASIBLE
    assert solution.infeasibility > 0.5


def test_a_function_without_values_fails_honestly():
    x = ca.SX.sym("x")
    solution = solve_nlp(build_nlp(x, ca.log(x)), [-1.0])
    assert solution.status is NlpStatus.FAILED
    assert not solution.success


def test_options_that_ipopt_refuses_are_an_error():
    with pytest.raises(SolverError, match="refused one of its options"):
        solve_nlp(rosenbrock(linear_solver="ma57"), np.zeros(5), parameters=[1.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"start": np.zeros(4)}, r"start must have shape \(5,\); got \(4,\)"),
        ({"start": [np.nan] * 5}, "start must be finite"),
        ({"parameters": []}, "parameters must have shape"),
        ({"lower": 1.0, "upper": 0.0}, "lower bounds must not exceed"),
    ],
)
def test_wrong_input_is_named(arguments, message):
    with pytest.raises(ParameterError, match=message):
        solve_nlp(rosenbrock(), **{"start": np.zeros(5), "parameters": [1.0], **arguments})


def test_settings_out_of_range_are_named():
    with pytest.raises(ParameterError, match="tolerance must be positive"):
        NlpSettings(tolerance=0.0)


def test_progress_sees_every_iteration_and_may_stop():
    seen = []
    full = solve_nlp(rosenbrock(), np.full(5, -1.0), parameters=[1.0], progress=lambda it: seen.append(it))
    assert [it.step for it in seen] == list(range(full.iterations + 1))
    assert seen[-1].objective == pytest.approx(full.objective, abs=1e-12)
    stopped = solve_nlp(rosenbrock(), np.full(5, -1.0), parameters=[1.0], progress=lambda it: it.objective < 5)
    assert stopped.status is NlpStatus.STOPPED
    assert stopped.objective < 5


def test_an_error_in_progress_is_raised():
    def broken(_):
        raise RuntimeWarning("mine")

    with pytest.raises(RuntimeWarning, match="mine"):
        solve_nlp(rosenbrock(), np.full(5, -1.0), parameters=[1.0], progress=broken)


@pytest.fixture
def heard_interrupts():
    """Ctrl-C raises, also where the tests were started in the background of a shell, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard_interrupts")
def test_ctrl_c_stops_within_one_iteration_and_is_raised():
    program, steps = rosenbrock(), []

    def interrupt(iteration):
        steps.append(iteration.step)
        if iteration.step == 2:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        solve_nlp(program, np.full(5, -1.0), parameters=[1.0], progress=interrupt)
    assert steps[-1] <= 3
    assert signal.getsignal(signal.SIGINT) is before
    assert solve_nlp(program, np.full(5, -1.0), parameters=[1.0]).success


def test_threads_may_share_a_program():
    program = rosenbrock(size=3)

    def solve(value):
        assert threading.current_thread() is not threading.main_thread()
        return solve_nlp(program, np.zeros(3), parameters=[value]).objective

    with ThreadPoolExecutor(4) as pool:
        assert max(pool.map(solve, [1.0] * 12)) < 1e-8


def test_nothing_is_printed(capfd):
    solve_nlp(rosenbrock(), np.full(5, -1.0), parameters=[1.0])
    solve_nlp(rosenbrock(max_iterations=1), np.full(5, -1.0), parameters=[1.0])
    assert capfd.readouterr() == ("", "")
